// The gather against ray tracing: rates and errors of our engines, of Embree on the same surfels as
// disks, and of Embree on the true triangles, at the same receivers, in one run.
//
// A rate is receivers per second of one thread's processor time, the median of rounds in which all
// methods take turns. Errors are against thousands of rays on the true geometry.

#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <limits>
#include <list>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "bench/internal/embree_peers.h"
#include "bench/internal/embree_truth.h"
#include "bench/internal/gather_bench_options.h"
#include "bench/internal/gather_measure.h"
#include "bench/internal/gather_scenes.h"
#include "core/job_limits.h"

namespace surfeit {
namespace {

struct VersusOptions {
  GatherBenchOptions common;
  TruthOptions truth;
  std::vector<std::string> peers = {"disks", "triangles"};
  std::vector<int> rays = {16, 64, 256, 576};
};

// A method in one mode: a line of the table.
struct Row {
  std::string name;
  GatherMode mode = GatherMode::kOcclusion;
  const PeerScene* peer = nullptr;  // null: one of our engines
  int rays = 0;
  std::vector<std::unique_ptr<Worker>> workers{};  // one per thread
  std::vector<double> rates{};                     // of the rounds
  ErrorSummary errors{};

  double rate() const { return median(rates); }
  bool isBleeding() const { return mode == GatherMode::kBleeding; }
};

constexpr GatherMode kModes[] = {GatherMode::kOcclusion, GatherMode::kBleeding};

// Peers of a scene. A list, since workers refer to them.
Result<std::list<PeerScene>> makePeers(const VersusOptions& options, const GatherScene& scene,
                                       const SceneFile& file, const ReceiverSet& set,
                                       const std::vector<GatherResult>& truth) {
  std::list<PeerScene> peers;
  const int threads = options.truth.threads;  // building is not timed
  const auto isWanted = [&](const char* name) {
    return std::find(options.peers.begin(), options.peers.end(), name) != options.peers.end();
  };
  if (isWanted("disks")) {
    SURFEIT_ASSIGN_OR_RETURN(const std::vector<Surfel> surfels, allSurfels(file));
    SURFEIT_ASSIGN_OR_RETURN(PeerScene disks, makeDiskPeer(scene, surfels, set, truth, threads));
    peers.push_back(std::move(disks));
  }
  if (isWanted("triangles")) {
    for (const bool rejects_backs : {false, true}) {
      if (rejects_backs && scene.geometry().is_two_sided) continue;
      SURFEIT_ASSIGN_OR_RETURN(PeerScene triangles,
                               makeTrianglePeer(scene, rejects_backs, threads));
      peers.push_back(std::move(triangles));
    }
  }
  for (PeerScene& peer : peers) {
    SURFEIT_RETURN_IF_ERROR(chooseRayShapes(set, peer));
    fmt::print("  Embree {}: {}\n", peer.name, peer.notes);
  }
  return peers;
}

Status addEngineRows(const GatherBenchOptions& options, PagedOctree& octree, const ReceiverSet& set,
                     const std::vector<GatherResult>& truth, std::vector<Row>& rows) {
  for (const std::string& engine : options.engines) {
    for (const GatherMode mode : kModes) {
      Row row{.name = engine, .mode = mode};
      for (int thread = 0; thread < options.threads; ++thread) {
        SURFEIT_ASSIGN_OR_RETURN(std::unique_ptr<GatherEngine> made,
                                 makeEngine(engine, mode, options.quality));
        row.workers.push_back(std::make_unique<EngineWorker>(std::move(made), octree));
      }
      SURFEIT_ASSIGN_OR_RETURN(const std::vector<GatherResult> results,
                               gatherJudged(set, engineBlock(engine), *row.workers.front()));
      row.errors = summarise(results, truth);
      rows.push_back(std::move(row));
    }
  }
  return {};
}

Status addPeerRows(const VersusOptions& options, const std::list<PeerScene>& peers,
                   const std::list<RayDirections>& directions, const ReceiverSet& set,
                   const std::vector<GatherResult>& truth, std::vector<Row>& rows) {
  for (const PeerScene& peer : peers) {
    for (const GatherMode mode : kModes) {
      const RayShape shape =
          mode == GatherMode::kOcclusion ? peer.occlusion_shape : peer.bleeding_shape;
      for (const RayDirections& rays : directions) {
        Row row{.name = peer.name, .mode = mode, .peer = &peer, .rays = rays.rays()};
        const auto judge = makeRayWorker(peer, mode, rays, shape, true);
        SURFEIT_ASSIGN_OR_RETURN(const std::vector<GatherResult> results,
                                 gatherJudged(set, 1, *judge));
        row.errors = summarise(results, truth);
        for (int thread = 0; thread < options.common.threads; ++thread) {
          row.workers.push_back(makeRayWorker(peer, mode, rays, shape, false));
        }
        rows.push_back(std::move(row));
      }
    }
  }
  return {};
}

void printTable(const ReceiverSet& set, const std::vector<Row>& rows) {
  fmt::print("  {} receivers: mean occlusion {:.4f}\n", set.name, rows.front().errors.mean);
  fmt::print("  {:<24} {:<9} {:>9} {:>8} {:>8} {:>7} {:>7}   {:>7} {:>8}\n", "method", "mode",
             "rate", "RMSE", "bias", "p95", "max", "color", "bias");
  for (const Row& row : rows) {
    const std::string name =
        row.rays > 0 ? fmt::format("{}, {} rays", row.name, row.rays) : row.name;
    fmt::print("  {:<24} {:<9} {:>9.0f} {:>8.5f} {:>+8.5f} {:>7.4f} {:>7.4f}", name,
               row.isBleeding() ? "bleeding" : "occlusion", row.rate(), row.errors.rmse,
               row.errors.bias, row.errors.p95, row.errors.max);
    if (row.isBleeding()) {
      fmt::print("   {:>7.4f} {:>+8.4f}", row.errors.color_rmse, row.errors.color_bias);
    }
    fmt::print("\n");
  }
}

double errorOf(const Row& row) {
  return row.isBleeding() ? row.errors.color_rmse : row.errors.rmse;
}

// The error that no number of rays takes away (disks are not the true geometry), from the two
// largest numbers n: error^2 = floor^2 + c / n.
double errorFloor(const std::vector<const Row*>& rows) {
  const Row &fewer = *rows[rows.size() - 2], &more = *rows.back();
  const double part =
      more.rays * errorOf(more) * errorOf(more) - fewer.rays * errorOf(fewer) * errorOf(fewer);
  return std::sqrt(std::max(0.0, part / (more.rays - fewer.rays)));
}

// The rate at which a ray tracer has that error, from its rates and errors at some ray counts, by
// straight lines in logarithms. Beyond the counts measured the lines go on, but never steeper than
// rays that are not stratified would have it, rate ~ error^2: where more rays do not help any more,
// that is in the peer's favour. 0: it never has it.
double rateAtError(const std::vector<const Row*>& rows, double error) {
  if (errorFloor(rows) > error) return 0;
  std::size_t k = 1;
  while (k + 1 < rows.size() && errorOf(*rows[k]) > error) ++k;
  const Row &from = *rows[k - 1], &to = *rows[k];
  constexpr double kSteepest = 2;
  const double fall = std::log(errorOf(from) / errorOf(to));
  const double slope =
      fall > 0 ? std::min(kSteepest, std::log(from.rate() / to.rate()) / fall) : kSteepest;
  const Row& nearest = error < errorOf(to) ? to : from;
  return nearest.rate() * std::pow(error / errorOf(nearest), slope);
}

// The best rate of the peers of true triangles, or of disks, at the error of one of our engines.
// NaN: no such peer, or one number of rays alone.
double bestRateAtError(const Row& engine, const std::vector<Row>& rows, bool has_true_geometry) {
  std::vector<const PeerScene*> seen;
  double best = std::numeric_limits<double>::quiet_NaN();
  for (const Row& first : rows) {
    const PeerScene* peer = first.peer;
    if (peer == nullptr || (peer->exact != nullptr) != has_true_geometry) continue;
    if (std::find(seen.begin(), seen.end(), peer) != seen.end()) continue;
    seen.push_back(peer);
    std::vector<const Row*> points;
    for (const Row& row : rows) {
      if (row.peer == peer && row.mode == engine.mode) points.push_back(&row);
    }
    if (points.size() > 1) best = std::fmax(best, rateAtError(points, errorOf(engine)));
  }
  return best;
}

std::string ratioText(double rate, double peer_rate) {
  if (std::isnan(peer_rate)) return "-";
  return peer_rate > 0 ? fmt::format("{:.2f}", rate / peer_rate) : "never";
}

// Our rate over the rates that rays have at our error.
void printEqualErrors(const std::string& scene, const ReceiverSet& set,
                      const std::vector<Row>& rows) {
  for (const Row& row : rows) {
    if (row.peer != nullptr) continue;
    fmt::print("  at equal error: {:<9} {:<9} {:<7} {:<9} {:>7.0f}/s, RMSE {:.4f} ({:+.4f}); ",
               scene, set.name, row.name, row.isBleeding() ? "color" : "occlusion", row.rate(),
               errorOf(row), row.isBleeding() ? row.errors.color_bias : row.errors.bias);
    fmt::print("{} x rays at triangles, {} at disks\n",
               ratioText(row.rate(), bestRateAtError(row, rows, true)),
               ratioText(row.rate(), bestRateAtError(row, rows, false)));
  }
}

// One set of receivers: all methods, all rounds.
Status compare(const std::string& name, const VersusOptions& options,
               const std::list<PeerScene>& peers, const ReceiverSet& set,
               const std::vector<GatherResult>& truth, PagedOctree& octree) {
  std::list<RayDirections> directions;
  for (const int rays : options.rays) directions.emplace_back(rays);
  std::vector<Row> rows;
  SURFEIT_RETURN_IF_ERROR(addEngineRows(options.common, octree, set, truth, rows));
  SURFEIT_RETURN_IF_ERROR(addPeerRows(options, peers, directions, set, truth, rows));
  for (int round = 0; round < options.common.rounds; ++round) {
    for (Row& row : rows) {
      SURFEIT_ASSIGN_OR_RETURN(const Timing timing,
                               timeGather(set, options.common.timed, row.workers));
      row.rates.push_back(timing.rate());
    }
  }
  printTable(set, rows);
  printEqualErrors(name, set, rows);
  return {};
}

Status runScene(const std::string& name, const SceneOptions& place, const VersusOptions& options) {
  Progress quiet;
  SURFEIT_ASSIGN_OR_RETURN(const GatherScene scene, GatherScene::open(name, place, quiet));
  SURFEIT_ASSIGN_OR_RETURN(const std::unique_ptr<PagedOctree> octree,
                           scene.openOctree(options.common.threads));
  fmt::print("{}: {} surfels, {} triangles, {} spheres; max solid angle {}, raster {}\n", name,
             octree->file().header().surfel_count, scene.geometry().exact_triangles,
             scene.geometry().spheres.size(), options.common.quality.max_solid_angle,
             options.common.quality.raster_resolution);
  std::list<PeerScene> peers;
  bool has_peers = false;
  for (const std::string& set_name : options.common.sets) {
    SURFEIT_ASSIGN_OR_RETURN(const ReceiverSet set, chooseReceivers(set_name, octree->file()));
    SURFEIT_ASSIGN_OR_RETURN(const std::vector<GatherResult> truth,
                             traceTruth(scene, set, options.truth));
    if (!std::exchange(has_peers, true)) {
      SURFEIT_ASSIGN_OR_RETURN(peers, makePeers(options, scene, octree->file(), set, truth));
    }
    SURFEIT_RETURN_IF_ERROR(compare(name, options, peers, set, truth, *octree));
  }
  return {};
}

}  // namespace
}  // namespace surfeit

int main(int argc, char** argv) {
  surfeit::VersusOptions options;
  options.truth.threads = surfeit::defaultThreadCount();
  CLI::App app("Our gathers against rays traced by Embree: rates and errors.");
  surfeit::addGatherBenchOptions(app, options.common);
  app.add_option("--peers", options.peers, "Ray tracers to measure")
      ->check(CLI::IsMember({"disks", "triangles", "none"}))
      ->capture_default_str();
  const auto isSquareOfFours = [](const std::string& text) {
    const long side = std::lround(std::sqrt(std::stod(text)) / 4) * 4;
    return std::to_string(side * side) == text && side > 0
               ? std::string()
               : text + ": expected the square of a multiple of 4";
  };
  app.add_option("--rays", options.rays, "Rays of a receiver that ray tracers shoot")
      ->check(isSquareOfFours)
      ->capture_default_str();
  app.add_option("--truth-rays", options.truth.rays, "Rays that errors are measured by")
      ->check(isSquareOfFours)
      ->capture_default_str();
  app.footer(
      "Rates are receivers per second of one thread's processor time, medians of the rounds.\n"
      "At equal error: our rate over the rate that rays have at our error; never: no number of\n"
      "rays has it, for disks are not the true geometry.\n"
      "Examples:\n"
      "  versus_embree --scene spheres --keep scenes\n"
      "  versus_embree --scene all --data ../shared/data --keep scenes > versus.txt\n"
      "  versus_embree --scene bunny --peers none --max-solid-angle 0.1   # our errors alone");
  CLI11_PARSE(app, argc, argv);
  std::sort(options.rays.begin(), options.rays.end());  // as ratios need them
  return surfeit::forEachScene("versus_embree", options.common,
                               [&](const std::string& name, const surfeit::SceneOptions& place) {
                                 return surfeit::runScene(name, place, options);
                               });
}
