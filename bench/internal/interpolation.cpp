// What interpolation between receivers (--max-variation) saves and costs: rates beside those of the
// whole gather, and differences from its results.
//
// A ratio is of processor time: the median of rounds in which the two take turns.

#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cmath>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "bench/internal/gather_measure.h"
#include "bench/internal/gather_scenes.h"
#include "gather/packet/group_gatherer.h"
#include "gather/rules/gather_rules.h"

namespace surfeit {
namespace {

struct InterpolationOptions {
  std::vector<std::string> scenes = {"cornell"};
  std::vector<std::string> sets = {"dense", "fine", "scattered"};
  SceneOptions place;
  double max_variation = 0.02;
  std::uint64_t finer = 16;
  int runs = 16, rounds = 5;
};

// Groups of receivers that follow each other along the curve.
struct Groups {
  std::vector<std::vector<LocalReceiver>> groups;
  std::size_t count() const {
    std::size_t sum = 0;
    for (const auto& group : groups) sum += group.size();
    return sum;
  }
};

Result<Groups> consecutiveGroups(const SceneFile& file, int runs) {
  Groups found;
  for (int run = 0; run < runs; ++run) {
    SURFEIT_ASSIGN_OR_RETURN(
        ReceiverSet set, consecutiveReceivers(file, (run + 0.5) / double(runs), kGroupReceivers));
    found.groups.push_back(std::move(set.receivers));
  }
  return found;
}

Result<Groups> scatteredGroups(const SceneFile& file, int runs) {
  SURFEIT_ASSIGN_OR_RETURN(const std::vector<Surfel> all, allSurfels(file));
  Groups found;
  found.groups.resize(std::size_t(runs));
  const std::size_t step =
      std::max<std::size_t>(all.size() / (found.groups.size() * kGroupReceivers), 1);
  std::size_t at = 0;
  for (auto& group : found.groups) {
    for (; group.size() < kGroupReceivers && at < all.size(); at += step) {
      group.push_back({all[at].position, all[at].normal});
    }
  }
  std::erase_if(found.groups, [](const auto& group) { return group.empty(); });
  return found;
}

Result<Groups> makeGroups(const InterpolationOptions& options, const std::string& set,
                          const std::string& scene, const SceneFile& file) {
  if (set == "dense") return consecutiveGroups(file, options.runs);
  if (set == "scattered") return scatteredGroups(file, options.runs);
  SceneOptions place = options.place;
  place.surfels *= options.finer;
  Progress quiet;
  SURFEIT_ASSIGN_OR_RETURN(const GatherScene finer, GatherScene::open(scene, place, quiet));
  SURFEIT_ASSIGN_OR_RETURN(const SceneFile finer_file, SceneFile::open(finer.octreePath()));
  return consecutiveGroups(finer_file, options.runs);
}

using Results = std::vector<std::vector<GatherResult>>;

Status gatherWhole(PacketGatherer& gatherer, const Groups& groups, PagedOctree::Reader& reader,
                   Results& results) {
  for (std::size_t i = 0; i < groups.groups.size(); ++i) {
    const std::span<const LocalReceiver> group = groups.groups[i];
    for (std::size_t at = 0; at < group.size(); at += kClusterReceivers) {
      const std::size_t count = std::min(kClusterReceivers, group.size() - at);
      SURFEIT_RETURN_IF_ERROR(gatherer.gather(group.subspan(at, count), reader,
                                              std::span(results[i]).subspan(at, count)));
    }
  }
  return {};
}

Status gatherSome(GroupGatherer& gatherer, const Groups& groups, PagedOctree::Reader& reader,
                  Results& results) {
  WorldReader world(reader);
  for (std::size_t i = 0; i < groups.groups.size(); ++i) {
    SURFEIT_RETURN_IF_ERROR(gatherer.gather(groups.groups[i], world, results[i]));
  }
  return {};
}

float brightest(const glm::vec3& rgb) { return std::max({rgb.x, rgb.y, rgb.z}); }

// What the option limits: differences of occlusion, and of light over the brightest of a cluster.
std::vector<float> errorsOf(const Results& exact, const Results& found, GatherMode mode) {
  std::vector<float> errors;
  for (std::size_t group = 0; group < exact.size(); ++group) {
    for (std::size_t begin = 0; begin < exact[group].size(); begin += kClusterReceivers) {
      const std::size_t end = std::min(begin + kClusterReceivers, exact[group].size());
      float scale = 0;
      for (std::size_t i = begin; i < end; ++i) {
        scale = std::max(scale, brightest(exact[group][i].irradiance));
      }
      for (std::size_t i = begin; i < end; ++i) {
        const GatherResult &a = exact[group][i], &b = found[group][i];
        float error = std::abs(a.occlusion - b.occlusion);
        if (mode != GatherMode::kOcclusion && scale > 0) {
          error = std::max(error, brightest(glm::abs(a.irradiance - b.irradiance)) / scale);
        }
        errors.push_back(error);
      }
    }
  }
  std::sort(errors.begin(), errors.end());
  return errors;
}

Status measure(const InterpolationOptions& options, const std::string& scene,
               const std::string& set, const Groups& groups, GatherMode mode, PagedOctree& octree) {
  GatherQuality quality;
  PacketGatherer whole(mode, quality);
  quality.max_variation = float(options.max_variation);
  GroupGatherer some(GatherRules(mode, quality));
  PagedOctree::Reader reader(octree);
  Results exact, found;
  for (const auto& group : groups.groups) exact.emplace_back(group.size());
  found = exact;

  // The first round fills the caches
  std::vector<double> ratios, rates;
  for (int round = -1; round < options.rounds; ++round) {
    const double begin = threadCpuSeconds();
    SURFEIT_RETURN_IF_ERROR(gatherWhole(whole, groups, reader, exact));
    const double middle = threadCpuSeconds();
    SURFEIT_RETURN_IF_ERROR(gatherSome(some, groups, reader, found));
    const double end = threadCpuSeconds();
    if (round < 0) continue;
    ratios.push_back((middle - begin) / (end - middle));
    rates.push_back(double(groups.count()) / (middle - begin));
  }
  const double passes = double(options.rounds + 1) * double(groups.count());
  const std::vector<float> errors = errorsOf(exact, found, mode);
  const auto bound = std::upper_bound(errors.begin(), errors.end(), float(options.max_variation));
  fmt::print("| {} | {} | {} | {:.0f} | {:.2f} | {:.1f} | {:.4f} | {:.4f} | {:.3f} | {:.2f} |\n",
             scene, set, mode == GatherMode::kOcclusion ? "occlusion" : "color", median(rates),
             median(ratios), 100 - 100 * double(some.interpolatedCount()) / passes,
             errors[errors.size() / 2], errors[errors.size() * 99 / 100], errors.back(),
             100 * double(errors.end() - bound) / double(errors.size()));
  std::fflush(stdout);
  return {};
}

Status runScene(const InterpolationOptions& options, const std::string& name) {
  Progress quiet;
  SURFEIT_ASSIGN_OR_RETURN(const GatherScene scene, GatherScene::open(name, options.place, quiet));
  SURFEIT_ASSIGN_OR_RETURN(const std::unique_ptr<PagedOctree> octree, scene.openOctree(1));
  for (const std::string& set : options.sets) {
    SURFEIT_ASSIGN_OR_RETURN(const Groups groups, makeGroups(options, set, name, octree->file()));
    for (const GatherMode mode : {GatherMode::kOcclusion, GatherMode::kBleeding}) {
      SURFEIT_RETURN_IF_ERROR(measure(options, name, set, groups, mode, *octree));
    }
  }
  return {};
}

}  // namespace
}  // namespace surfeit

int main(int argc, char** argv) {
  surfeit::InterpolationOptions options;
  options.place.surfels = 1'000'000;
  CLI::App app("What interpolation between receivers saves, and how far off it is.");
  app.add_option("--scene", options.scenes, "Scenes of gather_bench")->capture_default_str();
  app.add_option("--receivers", options.sets,
                 "dense: surfels that follow each other along the curve; fine: the same of the "
                 "scene with --finer times the surfels; scattered: surfels all over the scene")
      ->check(CLI::IsMember({"dense", "fine", "scattered"}))
      ->capture_default_str();
  app.add_option("--max-variation", options.max_variation, "As for surfeit gather")
      ->check(CLI::Range(1e-6, 1.0))
      ->capture_default_str();
  app.add_option("--finer", options.finer, "Receivers of the fine set for each surfel")
      ->check(CLI::Range(2, 1024))
      ->capture_default_str();
  app.add_option("--surfels", options.place.surfels, "Surfels of each scene")
      ->check(CLI::Range(10'000, 100'000'000))
      ->capture_default_str();
  app.add_option("--runs", options.runs, "Runs of 4,096 receivers")
      ->check(CLI::Range(1, 1000))
      ->capture_default_str();
  app.add_option("--rounds", options.rounds, "Rounds, of which ratios are the medians")
      ->check(CLI::Range(1, 1000))
      ->capture_default_str();
  app.add_option("--data", options.place.data, "Directory of meshes, for scenes made of them")
      ->capture_default_str();
  app.add_option("--keep", options.place.keep, "Directory for scenes, to start at once next time");
  CLI11_PARSE(app, argc, argv);
  fmt::print(
      "| scene | receivers | mode | whole gather, receivers/s | times its rate | gathered, % | "
      "difference, p50 | p99 | most | over {}, % |\n|---|---|---|---|---|---|---|---|---|---|\n",
      options.max_variation);
  for (const std::string& scene : options.scenes) {
    const surfeit::Status status = surfeit::runScene(options, scene);
    if (status.ok()) continue;
    fmt::print(stderr, "interpolation: {}: {}\n", scene, status.message());
    return 1;
  }
  return 0;
}
