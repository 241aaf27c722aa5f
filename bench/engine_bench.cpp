// The engine as callers use it, through its public headers alone:
//
//   engine_bench calls SCENE.sft [--receivers 20480] [--call 256] [--memory 64 ...] [--rounds 5]
//     [--draft]
//     many small calls against one call of all, each in an engine of its own: processor time, hits
//     and the engine's memory, in turns
//   engine_bench forest [--trees 10000] [--surfels 1M] [--receivers 20480] [--memory 512]
//     instances of one tree: rate beside that of the single tree, resident memory, and the error
//     against the same forest indexed as one scene, at a size where that can be done
#include <fmt/format.h>
#include <sys/resource.h>
#include <time.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdint>
#include <cstdlib>
#include <filesystem>
#include <glm/geometric.hpp>
#include <glm/vec3.hpp>
#include <random>
#include <string>
#include <vector>

#include "bench/or_exit.h"
#include "surfeit/engine.h"
#include "surfeit/surfel_source.h"

namespace surfeit {
namespace {

double processorSeconds() {
  timespec time{};
  clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &time);
  return double(time.tv_sec) + 1e-9 * double(time.tv_nsec);
}

double peakMebibytes() {
  rusage usage{};
  getrusage(RUSAGE_SELF, &usage);
  return double(usage.ru_maxrss) / 1024;
}

double median(std::vector<double> values) {
  std::sort(values.begin(), values.end());
  return values[values.size() / 2];
}

Engine makeEngine(std::uint64_t memory_bytes) {
  EngineOptions options;
  options.memory_bytes = memory_bytes;
  options.threads = 1;
  return take(Engine::create(options));
}

GatherSettings bleeding() {
  GatherSettings settings;
  settings.mode = GatherMode::kBleeding;
  return settings;
}

// Of a grid above the middle of a scene, row by row, that look up at what is above them.
std::vector<Receiver> receiversAbove(const glm::dvec3& min, const glm::dvec3& max, UpAxis up,
                                     std::size_t count, double height) {
  const auto rows = std::max<std::size_t>(1, std::size_t(std::sqrt(double(count))));
  const int axis = int(up), right = (axis + 1) % 3, back = (axis + 2) % 3;
  std::vector<Receiver> receivers;
  for (std::size_t i = 0; i < count; ++i) {
    const std::size_t row = i / rows, within = i % rows;
    const std::size_t column = row % 2 == 0 ? within : rows - 1 - within;
    Receiver receiver;
    receiver.position[right] =
        min[right] + (max[right] - min[right]) * (double(column) + .5) / double(rows);
    receiver.position[back] =
        min[back] + (max[back] - min[back]) * (double(row) + .5) / double(rows);
    receiver.position[axis] = min[axis] + height;
    receiver.normal[axis] = 1;
    receivers.push_back(receiver);
  }
  return receivers;
}

// An engine with one gatherer of a scene.
class OneGatherer {
 public:
  OneGatherer(const std::string& path, std::uint64_t memory, const GatherSettings& settings)
      : engine_(makeEngine(memory)),
        scene_(take(engine_.open(path))),
        gatherer_(take(engine_.gatherer(scene_, settings))) {}

  const SceneInfo& info() const { return scene_.info(); }

  // Gathers by calls of `size`; returns the processor time.
  double gather(const std::vector<Receiver>& receivers, std::size_t size,
                std::vector<GatherResult>& results) {
    const EngineStatistics before = engine_.statistics();
    const double begin = processorSeconds();
    for (std::size_t i = 0; i < receivers.size(); i += size) {
      need(gatherer_.gather(&receivers[i], std::min(size, receivers.size() - i), &results[i]));
    }
    const double seconds = processorSeconds() - begin;
    const EngineStatistics now = engine_.statistics();
    const auto grown = [&](std::uint64_t GatherCacheStats::*count) {
      return double(now.node_cache.*count - before.node_cache.*count + now.surfel_cache.*count -
                    before.surfel_cache.*count);
    };
    hits_ = 100 * grown(&GatherCacheStats::hits) / grown(&GatherCacheStats::requests);
    return seconds;
  }
  double hits() const { return hits_; }  // of the last gather, in %

  // What it holds, and the most that its caches have held.
  double mebibytes() const {
    const EngineStatistics now = engine_.statistics();
    return double(now.held_bytes + now.node_cache.peak_bytes + now.surfel_cache.peak_bytes) /
           (1 << 20);
  }

 private:
  Engine engine_;
  Scene scene_;
  Gatherer gatherer_;
  double hits_ = 0;
};

// An engine for either way, in turns.
void measureCalls(const std::string& path, std::size_t count, std::size_t call,
                  const std::vector<std::uint64_t>& budgets, int rounds, bool is_draft) {
  fmt::print("{:>10} {:>12} {:>12} {:>7} {:>9} {:>9} {:>9} {:>9}\n", "memory", "one call /s",
             fmt::format("of {} /s", call), "ratio", "hits %", "hits %", "MiB", "MiB");
  GatherSettings settings = bleeding();
  if (is_draft) setQuality(QualityPreset::kDraft, settings.quality);
  for (const std::uint64_t memory : budgets) {
    OneGatherer one(path, memory, settings), many(path, memory, settings);
    const SceneInfo& info = one.info();
    const std::vector<Receiver> receivers =
        receiversAbove(info.min, info.max, info.up, count, 1e-3 * glm::length(info.max - info.min));
    std::vector<GatherResult> results(receivers.size());
    const std::vector<Receiver> first(receivers.begin(),
                                      receivers.begin() + std::ptrdiff_t(std::min(count, call)));
    for (OneGatherer* each : {&one, &many}) each->gather(first, first.size(), results);  // warm
    std::vector<double> at_once, by_calls, ratios;
    for (int round = 0; round < rounds; ++round) {
      at_once.push_back(one.gather(receivers, receivers.size(), results));
      by_calls.push_back(many.gather(receivers, call, results));
      ratios.push_back(by_calls.back() / at_once.back());
    }
    fmt::print("{:>7} MiB {:>12.0f} {:>12.0f} {:>7.3f} {:>9.3f} {:>9.3f} {:>9.1f} {:>9.1f}\n",
               memory >> 20, double(count) / median(at_once), double(count) / median(by_calls),
               median(ratios), one.hits(), many.hits(), one.mebibytes(), many.mebibytes());
  }
}

// A tree: a trunk, and leaves in a crown, each a small disk that both sides are seen of.
std::vector<Surfel> makeTree(std::size_t count) {
  std::mt19937 bits(7);
  const auto unit = [&] { return float(bits() >> 8) * 0x1p-24f; };
  const std::size_t trunk = count / 20;
  std::vector<Surfel> surfels;
  surfels.reserve(count);
  for (std::size_t i = 0; i < trunk; ++i) {
    const float angle = 6.2831853f * unit(), height = 3 * unit();
    Surfel surfel;
    surfel.normal = {std::cos(angle), 0, std::sin(angle)};
    surfel.position = .2f * surfel.normal + glm::vec3(0, height, 0);
    surfel.area = 3 * 6.2831853f * .2f / float(trunk);
    surfel.radius = std::sqrt(surfel.area);
    surfel.radiosity = {.2f, .15f, .1f};
    surfels.push_back(surfel);
  }
  // Leaf area 3 m^2 for each square metre below the crown
  const float leaf_area = 3 * 3.14159265f * 4 / float(count - trunk);
  while (surfels.size() < count) {
    const glm::vec3 place(2 * unit() - 1, 2 * unit() - 1, 2 * unit() - 1);
    if (glm::length(place) > 1) continue;
    Surfel surfel;
    surfel.position = glm::vec3(0, 4.2f, 0) + 2.f * place;
    const float height = 2 * unit() - 1, angle = 6.2831853f * unit();
    const float side = std::sqrt(1 - height * height);
    surfel.normal = {side * std::cos(angle), height, side * std::sin(angle)};
    surfel.flags = kSurfelTwoSided;
    surfel.area = leaf_area;
    surfel.radius = std::sqrt(leaf_area / 3.14159265f);
    surfel.radiosity = glm::vec3(.1f, .3f, .05f) * (1 + place.y);
    surfels.push_back(surfel);
  }
  return surfels;
}

CloudChannels treeChannels() {
  CloudChannels channels;
  channels.normal = channels.radius = channels.area = channels.radiosity = true;
  channels.two_sided = true;
  return channels;
}

// Trees on a jittered grid, turned about their stems and of different sizes.
std::vector<Transform> placeTrees(std::size_t count) {
  std::mt19937 bits(11);
  const auto unit = [&] { return double(bits() >> 8) * 0x1p-24; };
  const auto rows = std::size_t(std::ceil(std::sqrt(double(count))));
  constexpr double kSpacing = 5;
  std::vector<Transform> transforms;
  for (std::size_t i = 0; i < count; ++i) {
    const double angle = 6.283185307179586 * unit(), scale = .7 + .6 * unit();
    Transform& transform = transforms.emplace_back();
    transform.m = {scale * std::cos(angle),
                   0,
                   scale * std::sin(angle),
                   kSpacing * (double(i % rows) + .6 * (unit() - .5)),
                   0,
                   scale,
                   0,
                   0,
                   -scale * std::sin(angle),
                   0,
                   scale * std::cos(angle),
                   kSpacing * (double(i / rows) + .6 * (unit() - .5))};
  }
  return transforms;
}

// All surfels of a forest, one tree after the other.
class ForestSurfels : public SurfelProvider {
 public:
  ForestSurfels(const std::vector<Surfel>& tree, const std::vector<Transform>& places)
      : tree_(tree), places_(places) {}
  std::uint64_t count() const override { return tree_.size() * places_.size(); }
  CloudChannels channels() const override { return treeChannels(); }
  Status read(std::uint64_t first, std::size_t count, Surfel* surfels) override {
    for (std::size_t i = 0; i < count; ++i) {
      const std::uint64_t number = first + i;
      const auto& m = places_[number / tree_.size()].m;
      Surfel surfel = tree_[number % tree_.size()];
      const glm::dvec3 place(surfel.position), normal(surfel.normal);
      const double scale = std::sqrt(m[0] * m[0] + m[4] * m[4] + m[8] * m[8]);
      for (int axis = 0; axis < 3; ++axis) {
        const double* const row = &m[std::size_t(4 * axis)];
        surfel.position[axis] =
            float(row[0] * place.x + row[1] * place.y + row[2] * place.z + row[3]);
        surfel.normal[axis] =
            float((row[0] * normal.x + row[1] * normal.y + row[2] * normal.z) / scale);
      }
      surfel.radius *= float(scale);
      surfel.area *= float(scale * scale);
      surfels[i] = surfel;
    }
    return {};
  }

 private:
  const std::vector<Surfel>& tree_;
  const std::vector<Transform>& places_;
};

// On the ground and in the crowns, tree by tree.
std::vector<Receiver> receiversIn(const std::vector<Transform>& places, std::size_t count) {
  std::mt19937 bits(13);
  const auto unit = [&] { return double(bits() >> 8) * 0x1p-24; };
  std::vector<Receiver> receivers;
  const std::size_t of_tree = std::min<std::size_t>(256, count);
  const std::size_t trees = (count + of_tree - 1) / of_tree;
  for (std::size_t i = 0; i < trees && receivers.size() < count; ++i) {
    const auto& m = places[i * places.size() / trees].m;
    for (std::size_t k = 0; k < of_tree && receivers.size() < count; ++k) {
      Receiver receiver;
      const bool is_on_ground = k < of_tree / 2;
      receiver.position = {m[3] + 5 * (unit() - .5), is_on_ground ? 0 : 2.5 + 3.5 * unit(),
                           m[11] + 5 * (unit() - .5)};
      receiver.normal = {0, 1, 0};
      receivers.push_back(receiver);
    }
  }
  return receivers;
}

struct Gathered {
  std::vector<GatherResult> results;
  double rate = 0, build_seconds = 0;
};

Gathered gatherFrom(Engine& engine, const std::vector<Instance>& instances,
                    const std::vector<Receiver>& receivers) {
  Gathered gathered;
  const double begin = processorSeconds();
  Gatherer gatherer = take(engine.gatherer(instances, bleeding()));
  gathered.build_seconds = processorSeconds() - begin;
  gathered.results.resize(receivers.size());
  need(gatherer.gather(receivers.data(), receivers.size(), gathered.results.data()));  // warm
  std::vector<double> seconds;
  for (int round = 0; round < 3; ++round) {
    const double start = processorSeconds();
    need(gatherer.gather(receivers.data(), receivers.size(), gathered.results.data()));
    seconds.push_back(processorSeconds() - start);
  }
  gathered.rate = double(receivers.size()) / median(seconds);
  return gathered;
}

void printError(const std::vector<GatherResult>& found, const std::vector<GatherResult>& whole) {
  double occlusion = 0, square = 0, light = 0, mean = 0;
  for (std::size_t i = 0; i < found.size(); ++i) {
    const double off = double(found[i].occlusion) - double(whole[i].occlusion);
    occlusion += std::abs(off);
    square += off * off;
    light += double(glm::length(found[i].irradiance - whole[i].irradiance));
    mean += double(glm::length(whole[i].irradiance));
  }
  const auto count = double(found.size());
  fmt::print(
      "error against the forest indexed whole: occlusion mean {:.5f}, RMS {:.5f}; light "
      "{:.4f} of its mean\n",
      occlusion / count, std::sqrt(square / count), light / mean);
}

void measureForest(std::size_t trees, std::size_t surfels, std::size_t count,
                   std::uint64_t memory_bytes) {
  const std::filesystem::path directory =
      std::filesystem::temp_directory_path() / fmt::format("engine_bench_{}", getpid());
  std::filesystem::create_directories(directory);
  const auto file = [&](const char* name) { return (directory / name).string(); };
  Progress progress;
  IndexOptions indexing;
  indexing.memory_bytes = std::uint64_t{256} << 20;
  const auto indexTree = [&](std::size_t of, const char* name) {
    const std::vector<Surfel> tree = makeTree(of);
    SurfelSpan span(tree.data(), tree.size(), treeChannels());
    take(indexSurfels(span, file(name), indexing, progress));
    return tree;
  };

  // The whole forest, where it fits: 64 trees
  {
    const std::vector<Surfel> tree = indexTree(30'000, "small.sft");
    const std::vector<Transform> places = placeTrees(64);
    ForestSurfels all(tree, places);
    take(indexSurfels(all, file("whole.sft"), indexing, progress));
    const std::vector<Receiver> receivers = receiversIn(places, 8'192);
    Engine engine = makeEngine(std::uint64_t{512} << 20);
    const Scene small = take(engine.open(file("small.sft")));
    std::vector<Instance> instances;
    for (const Transform& place : places) instances.push_back({small, place});
    const Gathered forest = gatherFrom(engine, instances, receivers);
    const Gathered whole =
        gatherFrom(engine, {Instance{take(engine.open(file("whole.sft"))), {}}}, receivers);
    fmt::print("64 trees of 30,000 surfels: instances {:.0f}/s, indexed whole {:.0f}/s\n",
               forest.rate, whole.rate);
    printError(forest.results, whole.results);
    std::fflush(stdout);
  }

  indexTree(surfels, "tree.sft");
  const std::vector<Transform> places = placeTrees(trees);
  const std::vector<Receiver> receivers = receiversIn(places, count);
  Engine engine = makeEngine(memory_bytes);
  const Scene tree = take(engine.open(file("tree.sft")));
  const std::vector<Receiver> below =
      receiversIn({Transform{}}, std::min<std::size_t>(count, 4096));
  const Gathered single = gatherFrom(engine, {Instance{tree, {}}}, below);
  std::vector<Instance> instances;
  for (const Transform& place : places) instances.push_back({tree, place});
  const Gathered forest = gatherFrom(engine, instances, receivers);
  const EngineStatistics statistics = engine.statistics();
  fmt::print(
      "{} instances of {} surfels, {:.3g} in all: world made in {:.1f} s, {:.0f} receivers/s; one "
      "tree {:.0f}/s; ratio {:.2f}\n",
      trees, surfels, double(trees) * double(surfels), forest.build_seconds, forest.rate,
      single.rate, forest.rate / single.rate);
  fmt::print(
      "budget {} MiB; held {:.1f} MiB, caches {:.1f} MiB; peak of the process {:.0f} MiB\n",
      memory_bytes >> 20, double(statistics.held_bytes) / (1 << 20),
      double(statistics.node_cache.peak_bytes + statistics.surfel_cache.peak_bytes) / (1 << 20),
      peakMebibytes());
  std::filesystem::remove_all(directory);
}

int run(int argc, char** argv) {
  CLI::App app("Measures the engine");
  app.require_subcommand(1);
  std::string scene;
  std::size_t receivers = 20'480, call = 256, trees = 10'000, surfels = 1'000'000;
  std::vector<std::uint64_t> budgets = {64};
  int rounds = 5;
  bool is_draft = false;
  std::size_t forest_receivers = 20'480;
  std::uint64_t memory = 512;
  CLI::App* const calls = app.add_subcommand("calls", "Many small calls against one of all");
  calls->add_option("SCENE", scene)->required();
  calls->add_option("--receivers", receivers);
  calls->add_option("--call", call);
  calls->add_option("--memory", budgets, "MiB, several");
  calls->add_option("--rounds", rounds);
  calls->add_flag("--draft", is_draft, "Draft quality");
  CLI::App* const forest = app.add_subcommand("forest", "Instances of a tree");
  forest->add_option("--trees", trees);
  forest->add_option("--surfels", surfels);
  forest->add_option("--receivers", forest_receivers);
  forest->add_option("--memory", memory, "MiB");
  CLI11_PARSE(app, argc, argv);
  if (calls->parsed()) {
    for (std::uint64_t& each : budgets) each <<= 20;
    measureCalls(scene, receivers, call, budgets, rounds, is_draft);
  } else {
    measureForest(trees, surfels, forest_receivers, memory << 20);
  }
  return 0;
}

}  // namespace
}  // namespace surfeit

int main(int argc, char** argv) { return surfeit::run(argc, argv); }
