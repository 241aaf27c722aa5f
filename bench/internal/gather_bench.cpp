// What a gather costs: rates of our engines at dense and at scattered receivers, what they visit
// and draw, gain from threads, growth with the number of surfels, and what it costs
// to keep only a part of the scene in memory.
//
// A rate is receivers per second of one thread's processor time, the median of rounds in which all
// engines take turns.

#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <map>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "bench/internal/gather_bench_options.h"
#include "bench/internal/gather_measure.h"
#include "bench/internal/gather_scenes.h"

namespace surfeit {
namespace {

struct CostOptions {
  GatherBenchOptions common;
  double memory_share = 0;  // of the decoded scene; 0: no such run
};

constexpr GatherMode kModes[] = {GatherMode::kOcclusion, GatherMode::kBleeding};

const char* modeName(GatherMode mode) {
  return mode == GatherMode::kOcclusion ? "occlusion" : "bleeding";
}

using Workers = std::vector<std::unique_ptr<Worker>>;

Result<Workers> makeWorkers(const std::string& engine, GatherMode mode,
                            const GatherQuality& quality, PagedOctree& octree, int threads) {
  Workers workers;
  for (int thread = 0; thread < threads; ++thread) {
    SURFEIT_ASSIGN_OR_RETURN(std::unique_ptr<GatherEngine> made, makeEngine(engine, mode, quality));
    workers.push_back(std::make_unique<EngineWorker>(std::move(made), octree));
  }
  return workers;
}

// An engine in one mode on some threads: a line of the table.
struct Row {
  std::string engine;
  GatherMode mode = GatherMode::kOcclusion;
  Workers workers{};
  std::vector<double> rates{}, wall_rates{};  // of the rounds
  EngineWork work{};                          // of one pass, on one thread
};

// What a pass over the set takes.
Result<EngineWork> measureWork(const Row& row, const CostOptions& options, PagedOctree& octree,
                               const ReceiverSet& set) {
  SURFEIT_ASSIGN_OR_RETURN(std::unique_ptr<GatherEngine> made,
                           makeEngine(row.engine, row.mode, options.common.quality));
  const GatherEngine& engine = *made;
  Workers workers;
  workers.push_back(std::make_unique<EngineWorker>(std::move(made), octree));
  SURFEIT_ASSIGN_OR_RETURN(const Timing timing, timeGather(set, options.common.timed, workers));
  static_cast<void>(timing);
  return engine.work();
}

void printRow(const Row& row) {
  const double receivers = double(row.work.receivers);
  fmt::print("  {:<10}{:<11}{:>7}{:>10.0f}{:>10.0f}{:>9.1f}{:>9.1f}{:>9.1f}\n", row.engine,
             modeName(row.mode), row.workers.size(), median(row.rates), median(row.wall_rates),
             double(row.work.nodes_visited) / receivers,
             double(row.work.surfels_visited) / receivers,
             double(row.work.contributions) / receivers);
}

// Receivers per second of all threads over those of one.
void printThreadGain(const Row& one, const Row& all) {
  fmt::print("  {} {}: {} threads: {:.2f}x by processor time, {:.2f}x by the clock\n", one.engine,
             modeName(one.mode), all.workers.size(),
             double(all.workers.size()) * median(all.rates) / median(one.rates),
             median(all.wall_rates) / median(one.wall_rates));
}

// Rates by engine, mode and set of the first of several sizes of a scene.
class Growth {
 public:
  // Prints how much longer a receiver takes than at first.
  void print(const std::string& scene, const std::string& set, const Row& row) {
    const std::string key = fmt::format("{} {} {} {}", scene, set, row.engine, modeName(row.mode));
    const auto [first, is_new] = first_rates_.emplace(key, median(row.rates));
    if (is_new) return;
    fmt::print("  {} {}: {:.2f} times the time of the first size\n", row.engine, modeName(row.mode),
               first->second / median(row.rates));
  }

 private:
  std::map<std::string, double> first_rates_;
};

// One set of receivers: all engines, all rounds, everything in memory.
Status measureSet(const CostOptions& options, const std::string& scene, const ReceiverSet& set,
                  PagedOctree& octree, Growth& growth) {
  const GatherBenchOptions& common = options.common;
  std::vector<Row> rows;
  for (const std::string& engine : common.engines) {
    for (const GatherMode mode : kModes) {
      for (const int threads : {1, common.threads}) {
        if (threads == 1 && !rows.empty() && rows.back().engine == engine &&
            rows.back().mode == mode) {
          continue;  // one thread was asked for
        }
        Row row{.engine = engine, .mode = mode};
        SURFEIT_ASSIGN_OR_RETURN(row.workers,
                                 makeWorkers(engine, mode, common.quality, octree, threads));
        if (threads == 1) {
          SURFEIT_ASSIGN_OR_RETURN(row.work, measureWork(row, options, octree, set));
        } else {
          row.work = rows.back().work;
        }
        rows.push_back(std::move(row));
      }
    }
  }
  for (int round = 0; round < common.rounds; ++round) {
    for (Row& row : rows) {
      SURFEIT_ASSIGN_OR_RETURN(const Timing timing, timeGather(set, common.timed, row.workers));
      row.rates.push_back(timing.rate());
      row.wall_rates.push_back(timing.wallRate());
    }
  }

  fmt::print("  {} receivers\n  {:<10}{:<11}{:>7}{:>10}{:>10}{:>9}{:>9}{:>9}\n", set.name, "engine",
             "mode", "threads", "rate", "all/s", "nodes", "surfels", "drawn");
  for (const Row& row : rows) printRow(row);
  for (std::size_t i = 0; i < rows.size(); ++i) {
    if (rows[i].workers.size() > 1) {
      printThreadGain(rows[i - 1], rows[i]);
    } else {
      growth.print(scene, set.name, rows[i]);
    }
  }
  return {};
}

// A part of the scene in memory against all of it: receivers along the curve, after as many that
// fill the caches.
Status measureMemory(const CostOptions& options, const GatherScene& scene, PagedOctree& all) {
  constexpr std::size_t kReceivers = 65536;
  constexpr double kFirstPart = 0.4;  // of the curve
  const GatherBenchOptions& common = options.common;
  const SceneFile& file = all.file();
  const double decoded = double(PagedOctree::unlimitedCacheBytes(file));
  const std::size_t bytes = std::max(std::size_t(options.memory_share * decoded),
                                     PagedOctree::leastCacheBytes(file, common.threads));
  SURFEIT_ASSIGN_OR_RETURN(const std::unique_ptr<PagedOctree> part,
                           scene.openOctree(common.threads, bytes));
  SURFEIT_ASSIGN_OR_RETURN(const ReceiverSet both,
                           consecutiveReceivers(file, kFirstPart, 2 * kReceivers));
  const std::size_t half = both.receivers.size() / 2 / both.run_length * both.run_length;
  const auto middle = both.receivers.begin() + std::ptrdiff_t(half);
  const ReceiverSet before{.name = "before",
                           .receivers = {both.receivers.begin(), middle},
                           .run_length = both.run_length};
  const ReceiverSet timed{
      .name = "timed", .receivers = {middle, both.receivers.end()}, .run_length = both.run_length};

  fmt::print("  {:.1f} % of the decoded scene in memory ({:.1f} of {:.1f} MiB), {} receivers\n",
             100 * double(bytes) / decoded, double(bytes) / 0x1p20, decoded / 0x1p20,
             timed.receivers.size());
  for (const std::string& engine : common.engines) {
    for (const GatherMode mode : kModes) {
      std::vector<double> rates[2], wall_rates[2];
      for (int round = 0; round < common.rounds; ++round) {
        for (const int is_part : {0, 1}) {
          PagedOctree& octree = is_part == 1 ? *part : all;
          SURFEIT_ASSIGN_OR_RETURN(const Workers workers, makeWorkers(engine, mode, common.quality,
                                                                      octree, common.threads));
          SURFEIT_ASSIGN_OR_RETURN(const Timing warmed,
                                   timeGather(before, before.run_length, workers));
          static_cast<void>(warmed);
          SURFEIT_ASSIGN_OR_RETURN(const Timing timing,
                                   timeGather(timed, timed.run_length, workers));
          rates[is_part].push_back(timing.rate());
          wall_rates[is_part].push_back(timing.wallRate());
        }
      }
      fmt::print(
          "  {:<10}{:<11} rate {:.0f} over {:.0f}: {:.3f} times the processor time, {:.3f} "
          "by the clock\n",
          engine, modeName(mode), median(rates[1]), median(rates[0]),
          median(rates[0]) / median(rates[1]), median(wall_rates[0]) / median(wall_rates[1]));
    }
  }
  return {};
}

Status runScene(const CostOptions& options, const std::string& name, const SceneOptions& place,
                Growth& growth) {
  Progress quiet;
  SURFEIT_ASSIGN_OR_RETURN(const GatherScene scene, GatherScene::open(name, place, quiet));
  SURFEIT_ASSIGN_OR_RETURN(const std::unique_ptr<PagedOctree> octree,
                           scene.openOctree(options.common.threads + 1));
  const SceneHeader& header = octree->file().header();
  fmt::print("{}: {} surfels, {} nodes; max solid angle {}, raster {}\n", name, header.surfel_count,
             header.node_count, options.common.quality.max_solid_angle,
             options.common.quality.raster_resolution);
  for (const std::string& set_name : options.common.sets) {
    SURFEIT_ASSIGN_OR_RETURN(const ReceiverSet set, chooseReceivers(set_name, octree->file()));
    SURFEIT_RETURN_IF_ERROR(measureSet(options, name, set, *octree, growth));
  }
  if (options.memory_share > 0) {
    SURFEIT_RETURN_IF_ERROR(measureMemory(options, scene, *octree));
  }
  return {};
}

}  // namespace
}  // namespace surfeit

int main(int argc, char** argv) {
  surfeit::CostOptions options;
  CLI::App app("What our gathers cost: rates, work, threads, growth, memory.");
  surfeit::addGatherBenchOptions(app, options.common);
  app.add_option("--memory", options.memory_share,
                 "Also gather with this share of the decoded scene in memory, 0..1")
      ->check(CLI::Range(0.0, 1.0));
  app.footer(
      "Columns: receivers per second of one thread's processor time, and of all threads by the\n"
      "clock; nodes and surfels visited and patches drawn, per receiver. Receivers that are\n"
      "gathered together share these.\n"
      "Examples:\n"
      "  gather_bench --scene spheres --keep scenes\n"
      "  gather_bench --scene city --surfels 1M 10M 100M --engine packet   # growth\n"
      "  gather_bench --scene city --threads 2 --memory 0.02");
  CLI11_PARSE(app, argc, argv);
  surfeit::Growth growth;
  return surfeit::forEachScene("gather_bench", options.common,
                               [&](const std::string& name, const surfeit::SceneOptions& place) {
                                 return surfeit::runScene(options, name, place, growth);
                               });
}
