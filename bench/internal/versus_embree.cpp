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

// The rate at which a ray tracer has that error, from its rates and errors at some ray counts, by
// straight lines in logarithms. Beyond the counts measured the lines go on, but never steeper than
// rays that are not stratified would have it, rate ~ error^2: where more rays do not help any more,
// that is in the peer's favour.
double rateAtError(const std::vector<const Row*>& rows, double error) {
  if (rows.size() < 2) return std::numeric_limits<double>::quiet_NaN();
  std::size_t k = 1;
  while (k + 1 < rows.size() && rows[k]->errors.rmse > error) ++k;
  const Row &from = *rows[k - 1], &to = *rows[k];
  constexpr double kSteepest = 2;
  const double fall = std::log(from.errors.rmse / to.errors.rmse);
  const double slope =
      fall > 0 ? std::min(kSteepest, std::log(from.rate() / to.rate()) / fall) : kSteepest;
  const Row& nearest = error < to.errors.rmse ? to : from;
  return nearest.rate() * std::pow(error / nearest.errors.rmse, slope);
}

// Occlusion against triangles at equal error: the better of those with and without fronts only.
void printTriangleRatio(const Row& engine, const std::vector<Row>& rows) {
  double best_rate = 0;
  std::string best;
  bool is_beyond = false;
  for (std::size_t i = 0; i < rows.size(); ++i) {
    const PeerScene* peer = rows[i].peer;
    const bool is_new = peer != nullptr && (i == 0 || rows[i - 1].peer != peer);
    if (!is_new || peer->exact == nullptr) continue;
    std::vector<const Row*> points;
    for (const Row& row : rows) {
      if (row.peer == peer && !row.isBleeding()) points.push_back(&row);
    }
    const double rate = rateAtError(points, engine.errors.rmse);
    if (!(rate > best_rate)) continue;
    best_rate = rate;
    best = peer->name;
    is_beyond = engine.errors.rmse > points.front()->errors.rmse ||
                engine.errors.rmse < points.back()->errors.rmse;
  }
  if (best_rate == 0) return;
  fmt::print("  {} over Embree {} at equal occlusion RMSE {:.5f}: {:.2f}x ({:.0f} over {:.0f}{})\n",
             engine.name, best, engine.errors.rmse, engine.rate() / best_rate, engine.rate(),
             best_rate, is_beyond ? ", beyond the ray counts measured" : "");
}

// Colour against disks with 256 rays.
void printDiskRatio(const Row& engine, const std::vector<Row>& rows) {
  constexpr int kRays = 256;
  for (const Row& row : rows) {
    if (row.peer == nullptr || row.peer->exact != nullptr) continue;
    if (!row.isBleeding() || row.rays != kRays) continue;
    fmt::print("  {} over Embree {}, {} rays, color: {:.2f}x, color RMSE {:.4f} against {:.4f}\n",
               engine.name, row.name, kRays, engine.rate() / row.rate(), engine.errors.color_rmse,
               row.errors.color_rmse);
  }
}

// One set of receivers: all methods, all rounds.
Status compare(const VersusOptions& options, const std::list<PeerScene>& peers,
               const ReceiverSet& set, const std::vector<GatherResult>& truth,
               PagedOctree& octree) {
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
  for (const Row& row : rows) {
    if (row.peer != nullptr) continue;
    if (row.isBleeding()) {
      printDiskRatio(row, rows);
    } else {
      printTriangleRatio(row, rows);
    }
  }
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
    SURFEIT_RETURN_IF_ERROR(compare(options, peers, set, truth, *octree));
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
