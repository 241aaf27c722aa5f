// The gather on scenes by chance, against itself and against the true geometry: what strangers will
// see. A line for each seed, the worst first, and how errors spread over all of them.

#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <atomic>
#include <cstdint>
#include <cstdio>
#include <numeric>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "bench/internal/gather_measure.h"
#include "bench/internal/random_truth.h"
#include "random/indexed_scene.h"
#include "random/random_scene.h"
#include "random/random_scene_files.h"
#include "random/result_differences.h"
#include "tools/gather_options.h"

namespace surfeit {
namespace {

enum class Against { kExact, kEmbree, kAlone };
// What the clouds bring.
enum class Sizes { kGiven, kAreas, kNone };

struct RandomScenesOptions {
  std::uint64_t first = 0, last = 199;
  RandomSampling sampling;
  GatherOptions gather;
  Against against = Against::kExact;
  Sizes sizes = Sizes::kGiven;
  bool mixes_sides = false;
  bool has_opacities = false;
  bool full_precision = false;
  std::uint64_t kept = ~std::uint64_t{0};
  int rays = 4096;
  std::size_t worst = 20;
  int threads = 2;
  bool describes = false;
  std::string write;
};

// What is found of a seed.
struct SeedResult {
  std::uint64_t seed = 0;
  RandomScene scene;  // without surfels and geometry
  GatherSides sides = GatherSides::kFront;
  std::size_t surfels = 0, receivers = 0;
  ResultDifferences found;
  ResultDifferences exact;  // with kEmbree: of the exact gather to the truth
  GatherResult worst, worst_expected;
  double fast_seconds = 0, exact_seconds = 0, index_seconds = 0, truth_seconds = 0;
  std::vector<double> errors;  // of each receiver
  Status status;
};

// Runs something and adds its processor time.
template <typename Work>
auto timed(double& seconds, const Work& work) {
  const double begin = threadCpuSeconds();
  auto result = work();
  seconds += threadCpuSeconds() - begin;
  return result;
}

GatherSides sidesOf(std::uint64_t seed, const RandomScenesOptions& options) {
  if (!options.mixes_sides) return options.gather.quality.sides;
  return seed % 3 == 0 ? GatherSides::kBoth : GatherSides::kFront;
}

// Leaves out receivers that have no truth.
std::vector<GatherResult> truthAsResults(const std::vector<float>& truth,
                                         const std::vector<GatherResult>& instead) {
  std::vector<GatherResult> results(truth.size());
  for (std::size_t i = 0; i < truth.size(); ++i) {
    results[i].occlusion = truth[i] < 0 ? instead[i].occlusion : truth[i];
  }
  return results;
}

Status judge(const RandomScenesOptions& options, const RandomScene& scene, SeedResult& result) {
  GatherOptions gather = options.gather;
  gather.quality.sides = result.sides;
  const GatherRules rules(gather);
  gather.quality.max_solid_angle = 0;
  const GatherRules exact_rules(gather);
  const std::vector<LocalReceiver> receivers = scene.plainReceivers();
  result.surfels = scene.surfels.size();
  result.receivers = receivers.size();
  if (scene.surfels.empty()) return {};

  IndexedSceneOptions indexing;
  indexing.full_precision = options.full_precision;
  SURFEIT_ASSIGN_OR_RETURN(const auto indexed, timed(result.index_seconds, [&] {
                             return IndexedScene::make(scene.surfels, indexing);
                           }));
  SURFEIT_ASSIGN_OR_RETURN(const auto fast, timed(result.fast_seconds, [&] {
                             return indexed->gatherTogether(receivers, rules);
                           }));
  SURFEIT_ASSIGN_OR_RETURN(std::vector<GatherResult> expected, timed(result.exact_seconds, [&] {
                             return indexed->gatherAlone(
                                 receivers,
                                 options.against == Against::kAlone ? rules : exact_rules);
                           }));
  if (options.against == Against::kEmbree) {
    SURFEIT_ASSIGN_OR_RETURN(const std::vector<float> truth, timed(result.truth_seconds, [&] {
                               return traceOcclusion(scene, result.sides, options.rays);
                             }));
    result.exact = differencesOf(expected, truthAsResults(truth, expected));
    expected = truthAsResults(truth, fast);
  }
  result.found = differencesOf(fast, expected);
  result.worst = fast[result.found.worst_receiver];
  result.worst_expected = expected[result.found.worst_receiver];
  for (std::size_t i = 0; i < fast.size(); ++i) {
    result.errors.push_back(std::abs(double(fast[i].occlusion) - double(expected[i].occlusion)));
  }
  return {};
}

SeedResult runSeed(const RandomScenesOptions& options, std::uint64_t seed) {
  SeedResult result;
  result.seed = seed;
  result.sides = sidesOf(seed, options);
  RandomScene scene = makeRandomScene(seed, options.sampling);
  if (options.kept != ~std::uint64_t{0}) scene = scene.only(options.kept);
  if (options.has_opacities) scene = scene.withOpacities();
  if (options.sizes != Sizes::kGiven) scene = scene.withoutSizes(options.sizes == Sizes::kAreas);
  result.status = judge(options, scene, result);
  if (!options.write.empty() && result.status.ok()) {
    const std::string directory = fmt::format("{}/{}", options.write, seed);
    result.status = writeRandomScene(scene, directory);
  }
  scene.surfels = {}, scene.surfel_ingredients = {}, scene.triangles = {}, scene.spheres = {};
  result.scene = std::move(scene);
  return result;
}

std::vector<SeedResult> runSeeds(const RandomScenesOptions& options) {
  std::vector<SeedResult> results(options.last - options.first + 1);
  std::atomic<std::size_t> next = 0;
  std::vector<std::jthread> threads;
  for (int thread = 0; thread < options.threads; ++thread) {
    threads.emplace_back([&] {
      for (std::size_t i = next++; i < results.size(); i = next++) {
        results[i] = runSeed(options, options.first + i);
      }
    });
  }
  threads.clear();
  return results;
}

const char* sidesName(GatherSides sides) {
  return sides == GatherSides::kFront ? "front" : sides == GatherSides::kBoth ? "both" : "back";
}

void printWorst(const RandomScenesOptions& options, std::vector<SeedResult>& results) {
  std::sort(results.begin(), results.end(),
            [](const auto& a, const auto& b) { return a.found.rms > b.found.rms; });
  fmt::print("{:>8} {:>5} {:>7} {:>4} {:>7} {:>7} {:>7} {:>7} {:>7}{}  worst receiver\n", "seed",
             "sides", "surfels", "recv", "rms", "bias", "worst", "light", "l.worst",
             options.against == Against::kEmbree ? "   exact" : "");
  for (std::size_t i = 0; i < std::min(options.worst, results.size()); ++i) {
    const SeedResult& one = results[i];
    const RandomReceiver& receiver = one.scene.receivers[one.found.worst_receiver];
    std::string exact;
    if (options.against == Against::kEmbree) exact = fmt::format(" {:7.4f}", one.exact.rms);
    fmt::print(
        "{:>8} {:>5} {:>7} {:>4} {:7.4f} {:7.4f} {:7.4f} {:7.3f} {:7.2f}{}  {} {} of {}: "
        "{:.3f} for {:.3f}\n",
        one.seed, sidesName(one.sides), one.surfels, one.receivers, one.found.rms, one.found.bias,
        one.found.worst, one.found.irradiance_rms, one.found.irradiance_worst, exact,
        one.found.worst_receiver, receiver.place, receiver.ingredient, one.worst.occlusion,
        one.worst_expected.occlusion);
    if (options.describes) fmt::print("{}", one.scene.describe());
    if (!options.write.empty()) {
      GatherOptions gather = options.gather;
      gather.quality.sides = one.sides;
      fmt::print("{}", gatherCommands(fmt::format("{}/{}", options.write, one.seed), gather));
    }
  }
}

void printSpread(const char* name, const std::vector<double>& values) {
  const auto above = [&](double limit) {
    return std::count_if(values.begin(), values.end(),
                         [limit](double value) { return !(value <= limit); });
  };
  fmt::print("{:<24} {:>8} {:8.4f} {:8.4f} {:8.4f} {:8.4f} {:8.4f} {:>8} {:>8} {:>8}\n", name,
             values.size(), quantile(values, .5), quantile(values, .9), quantile(values, .95),
             quantile(values, .99), quantile(values, 1), above(.01), above(.02), above(.1));
}

void printSummary(const RandomScenesOptions& options, const std::vector<SeedResult>& results,
                  double wall_seconds) {
  std::vector<double> rms, exact, worst, light, all;
  double fast_seconds = 0, exact_seconds = 0, index_seconds = 0, truth_seconds = 0, receivers = 0;
  for (const SeedResult& one : results) {
    rms.push_back(one.found.rms);
    exact.push_back(one.exact.rms);
    worst.push_back(one.found.worst);
    light.push_back(one.found.irradiance_rms);
    all.insert(all.end(), one.errors.begin(), one.errors.end());
    fast_seconds += one.fast_seconds, exact_seconds += one.exact_seconds;
    index_seconds += one.index_seconds, truth_seconds += one.truth_seconds;
    receivers += double(one.receivers);
  }
  fmt::print("\n{:<24} {:>8} {:>8} {:>8} {:>8} {:>8} {:>8} {:>8} {:>8} {:>8}\n", "", "count",
             "median", "90 %", "95 %", "99 %", "most", "> .01", "> .02", "> .1");
  printSpread("scenes: rms", rms);
  if (options.against == Against::kEmbree) {
    printSpread("scenes: rms of exact", exact);
  } else {
    printSpread("scenes: light, relative", light);
  }
  printSpread("scenes: worst receiver", worst);
  printSpread("receivers", all);
  fmt::print(
      "receivers/s of one thread: {:.0f}, {} {:.0f}; processor time: gather {:.1f} s, {} "
      "{:.1f} s, index {:.1f} s, rays {:.1f} s; wall time {:.1f} s\n",
      receivers / fast_seconds, options.against == Against::kAlone ? "alone" : "exact",
      receivers / exact_seconds, fast_seconds,
      options.against == Against::kAlone ? "alone" : "exact", exact_seconds, index_seconds,
      truth_seconds, wall_seconds);
}

int run(const RandomScenesOptions& options) {
  const auto begin = std::chrono::steady_clock::now();
  std::vector<SeedResult> results = runSeeds(options);
  const double seconds =
      std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
  for (const SeedResult& one : results) {
    if (one.status.ok()) continue;
    fmt::print(stderr, "random_scenes: seed {}: {}\n", one.seed, one.status.message());
    return 1;
  }
  printWorst(options, results);
  printSummary(options, results, seconds);
  return 0;
}

void addSeedOptions(CLI::App& app, RandomScenesOptions& options) {
  app.add_option_function<std::string>(
         "--seeds",
         [&options](const std::string& text) {
           const std::size_t dots = text.find("..");
           options.first = std::stoull(text);
           options.last =
               dots == std::string::npos ? options.first : std::stoull(text.substr(dots + 2));
           if (options.last < options.first) throw CLI::ValidationError("--seeds", text);
         },
         "Seeds of the scenes, the last included")
      ->type_name("A..B")
      ->default_str("0..199");
  app.add_option_function<std::vector<int>>(
         "--ingredients",
         [&options](const std::vector<int>& numbers) {
           options.kept = 0;
           for (const int number : numbers) options.kept |= std::uint64_t{1} << number;
         },
         "Ingredients to keep, as --describe numbers them [all]")
      ->delimiter(',');
  app.add_option("--density", options.sampling.density, "Times as many surfels of each surface")
      ->check(CLI::PositiveNumber)
      ->capture_default_str();
  app.add_flag("--no-noise", options.sampling.without_noise,
               "Positions and normals of surfels are those of the surfaces");
  app.add_flag("--opacities", options.has_opacities, "Some surfaces are translucent");
  app.add_flag("--describe", options.describes, "Print what the scenes are made of");
  app.add_option("--worst", options.worst, "Seeds to print, the worst first")
      ->capture_default_str();
  app.add_option("--write", options.write,
                 "Directory for the scenes as files; prints commands that gather from them");
}

}  // namespace
}  // namespace surfeit

int main(int argc, char** argv) {
  using surfeit::Against;
  using surfeit::Sizes;
  CLI::App app("The gather on scenes by chance");
  surfeit::RandomScenesOptions options;
  options.gather.mode = surfeit::GatherMode::kBleeding;
  options.gather.memory_bytes = 1, options.gather.threads = 1;  // neither matters here
  surfeit::addSeedOptions(app, options);
  surfeit::addQualityOptions(app, options.gather.quality);
  app.add_flag("--mixed-sides", options.mixes_sides, "Every third scene with --sides both");
  surfeit::addChoice<Against>(
      app, "--against", options.against, "What errors are measured by",
      {{"exact", Against::kExact}, {"embree", Against::kEmbree}, {"alone", Against::kAlone}});
  surfeit::addChoice<Sizes>(
      app, "--sizes", options.sizes, "Sizes that the clouds bring",
      {{"given", Sizes::kGiven}, {"areas", Sizes::kAreas}, {"none", Sizes::kNone}});
  app.add_flag("--full-precision", options.full_precision, "Index with floats");
  app.add_option("--rays", options.rays, "Rays of a receiver with --against embree, (4 n)^2")
      ->capture_default_str();
  app.add_option("--threads", options.threads, "Scenes at a time")->capture_default_str();
  app.footer(
      "exact: the gather with max solid angle 0, each receiver by itself.\n"
      "embree: occlusion by rays on the true triangles.\n"
      "alone: the same gather, each receiver by itself instead of with all others.\n"
      "--sizes areas, none: index finds the radii, or the areas as well; scenes have no leaves,\n"
      "hair or points, whose sizes places do not tell.\n"
      "Examples:\n"
      "  random_scenes --seeds 0..399\n"
      "  random_scenes --seeds 17 --describe --write /tmp/scenes\n"
      "  random_scenes --seeds 17 --ingredients 0,2   # what does the failure need?");
  CLI11_PARSE(app, argc, argv);
  return surfeit::run(options);
}
