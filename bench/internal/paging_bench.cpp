// What a gather costs by memory budget and order of the receivers: time, hit rates, reads, peak
// memory. Every gather is a process of its own, so that its peak is its own; all take turns, round
// by round, and the median of the rounds is printed. All results must be equal, byte for byte.
//
//   paging_bench SCENE.sft RECEIVERS.ply [--shares 1,2,5,10,50,100] [--orders hilbert,morton,input]
#include <fmt/format.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>
#include <xxhash.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <chrono>
#include <cstdio>
#include <fstream>
#include <map>
#include <string>
#include <type_traits>
#include <vector>

#include "batch/gather_input.h"
#include "batch/gather_memory.h"
#include "core/seconds_since.h"
#include "octree/read/paged_octree.h"
#include "octree/read/scene_file.h"
#include "surfeit/bake.h"
#include "surfeit/process.h"

namespace {

using namespace surfeit;

const std::map<std::string, ReceiverOrder> kOrders = {{"hilbert", ReceiverOrder::kHilbert},
                                                      {"morton", ReceiverOrder::kMorton},
                                                      {"input", ReceiverOrder::kInput}};

struct Arguments {
  std::string scene, receivers, result = "paging_bench_result.ply";
  std::vector<double> shares = {1, 2, 5, 10, 50, 100};  // percent of the decoded scene
  std::vector<std::string> orders = {"hilbert"};
  GatherOptions options;
  int rounds = 5;
};

// What a child process tells of its gather.
struct Outcome {
  bool ok = false;
  double wall_seconds = 0, cpu_seconds = 0;
  std::uint64_t peak_bytes = 0;
  std::uint64_t result_hash = 0;
  GatherCacheStats nodes, surfels;
};
static_assert(std::is_trivially_copyable_v<Outcome>);

struct Setting {
  std::string order;
  double share = 0;
  std::uint64_t memory_bytes = 0;
  std::vector<Outcome> outcomes;
};

std::uint64_t hashOf(const std::string& path) {
  XXH3_state_t* const state = XXH3_createState();
  XXH3_64bits_reset(state);
  std::ifstream file(path, std::ios::binary);
  std::vector<char> block(1 << 20);
  while (file.read(block.data(), std::streamsize(block.size())) || file.gcount() > 0) {
    XXH3_64bits_update(state, block.data(), std::size_t(file.gcount()));
  }
  const std::uint64_t hash = XXH3_64bits_digest(state);
  XXH3_freeState(state);
  return hash;
}

// Gathers in a process of its own.
Outcome gather(const Arguments& arguments, const Setting& setting) {
  int ends[2];
  if (pipe(ends) != 0) return {};
  std::fflush(nullptr);
  const auto begin = std::chrono::steady_clock::now();
  const pid_t child = fork();
  if (child == 0) {
    GatherOptions options = arguments.options;
    options.order = kOrders.at(setting.order);
    options.memory_bytes = setting.memory_bytes;
    limitProcess(setting.memory_bytes);
    Progress progress;
    const Result<GatherStats> stats =
        gatherCloud(arguments.scene, arguments.receivers, arguments.result, options, progress);
    Outcome outcome;
    outcome.ok = stats.ok();
    if (stats.ok()) {
      outcome.nodes = stats->node_cache;
      outcome.surfels = stats->surfel_cache;
    } else {
      fmt::print(stderr, "paging_bench: {}\n", stats.status().message());
    }
    const bool told = write(ends[1], &outcome, sizeof outcome) == ssize_t(sizeof outcome);
    _exit(told ? 0 : 1);
  }
  close(ends[1]);
  Outcome outcome;
  const bool told = read(ends[0], &outcome, sizeof outcome) == ssize_t(sizeof outcome);
  close(ends[0]);
  int status = 0;
  rusage usage{};
  wait4(child, &status, 0, &usage);
  outcome.ok = told && outcome.ok && WIFEXITED(status) && WEXITSTATUS(status) == 0;
  outcome.wall_seconds = secondsSince(begin);
  const auto seconds = [](const timeval& time) {
    return double(time.tv_sec) + double(time.tv_usec) * 1e-6;
  };
  outcome.cpu_seconds = seconds(usage.ru_utime) + seconds(usage.ru_stime);
  outcome.peak_bytes = std::uint64_t(usage.ru_maxrss) << 10;
  outcome.result_hash = hashOf(arguments.result);
  std::remove(arguments.result.c_str());
  return outcome;
}

template <typename Value>
double median(const Setting& setting, Value value) {
  std::vector<double> values;
  for (const Outcome& outcome : setting.outcomes) values.push_back(value(outcome));
  std::sort(values.begin(), values.end());
  return values[values.size() / 2];
}

// Budgets are shares of the decoded scene, at least what works.
Result<std::vector<Setting>> makeSettings(const Arguments& arguments, std::uint64_t& decoded) {
  SURFEIT_ASSIGN_OR_RETURN(const SceneFile scene, SceneFile::open(arguments.scene));
  SURFEIT_ASSIGN_OR_RETURN(const GatherInput input, GatherInput::open(arguments.receivers));
  const GatherWork work = gatherWork(input.receivers(), arguments.options);
  decoded = PagedOctree::unlimitedCacheBytes(scene);
  std::vector<Setting> settings;
  for (const std::string& order : arguments.orders) {
    for (const double share : arguments.shares) {
      const std::uint64_t least = leastGatherMemory(scene, work);
      const std::uint64_t most = decoded + gatherMemoryBesideCaches(scene, work);
      const auto bytes = std::uint64_t(share / 100 * double(decoded));
      settings.push_back({order, share, share >= 100 ? most : std::max(bytes, least), {}});
    }
  }
  return settings;
}

void printSetting(const Setting& setting, double base_seconds) {
  const double wall = median(setting, [](const Outcome& o) { return o.wall_seconds; });
  const double cpu = median(setting, [](const Outcome& o) { return o.cpu_seconds; });
  const double peak = median(setting, [](const Outcome& o) { return double(o.peak_bytes); });
  const Outcome& last = setting.outcomes.back();
  const auto rate = [](const GatherCacheStats& cache) {
    return cache.requests > 0 ? 100 * double(cache.hits) / double(cache.requests) : 100;
  };
  constexpr double kMebibyte = 1 << 20;
  fmt::print(
      "{:<8}{:>6.1f}{:>9.0f}{:>9.2f}{:>7.2f}{:>8.2f}{:>10.4f}{:>10.4f}{:>10.0f}{:>10}{:>9.1f}\n",
      setting.order, setting.share, double(setting.memory_bytes) / kMebibyte, wall,
      wall / base_seconds, cpu, rate(last.nodes), rate(last.surfels),
      double(last.nodes.bytes_read + last.surfels.bytes_read) / kMebibyte,
      last.nodes.repeated_loads + last.surfels.repeated_loads, peak / kMebibyte);
}

Status runBench(const Arguments& arguments) {
  std::uint64_t decoded = 0;
  SURFEIT_ASSIGN_OR_RETURN(std::vector<Setting> settings, makeSettings(arguments, decoded));
  for (int round = 0; round < arguments.rounds; ++round) {
    for (Setting& setting : settings) {
      setting.outcomes.push_back(gather(arguments, setting));
      if (!setting.outcomes.back().ok) return Status::failed("a gather failed");
      // Another order makes other packets, and so other last digits
      const auto first = std::find_if(settings.begin(), settings.end(), [&](const Setting& one) {
        return one.order == setting.order;
      });
      if (setting.outcomes.back().result_hash != first->outcomes.front().result_hash) {
        return Status::failed(fmt::format("{} with {} bytes has another result", setting.order,
                                          setting.memory_bytes));
      }
    }
  }
  fmt::print(
      "{}: {:.0f} MiB decoded; {} threads, median of {} rounds{}; all results of an order are "
      "equal\n",
      arguments.scene, double(decoded) / (1 << 20), arguments.options.threads, arguments.rounds,
      arguments.options.direct_io ? ", direct I/O" : "");
  fmt::print("{:<8}{:>6}{:>9}{:>9}{:>7}{:>8}{:>10}{:>10}{:>10}{:>10}{:>9}\n", "order", "%", "MiB",
             "wall s", "ratio", "CPU s", "nodes %", "surfels %", "read MiB", "repeated", "peak");
  const double base = median(
      *std::max_element(settings.begin(), settings.end(),
                        [](const Setting& a, const Setting& b) { return a.share < b.share; }),
      [](const Outcome& o) { return o.wall_seconds; });
  for (const Setting& setting : settings) printSetting(setting, base);
  return {};
}

}  // namespace

int main(int argc, char** argv) {
  CLI::App app("Time, hit rates and reads of a gather by memory budget and order of receivers.");
  Arguments arguments;
  arguments.options.threads = 2;
  app.add_option("SCENE", arguments.scene, "Scene file (.sft)")->required();
  app.add_option("RECEIVERS", arguments.receivers, "Cloud (PLY)")->required();
  app.add_option("--shares", arguments.shares, "Budgets, in percent of the decoded scene")
      ->delimiter(',')
      ->capture_default_str();
  app.add_option("--orders", arguments.orders, "Of hilbert, morton, input")
      ->delimiter(',')
      ->check(CLI::IsMember({"hilbert", "morton", "input"}))
      ->capture_default_str();
  app.add_option("--rounds", arguments.rounds)->check(CLI::Range(1, 99))->capture_default_str();
  app.add_option("--threads", arguments.options.threads)
      ->check(CLI::Range(1, 256))
      ->capture_default_str();
  app.add_option("--cache-split", arguments.options.cache_split,
                 "Share of the nodes, else adaptive");
  app.add_flag("--direct-io", arguments.options.direct_io, "Past the page cache of the system");
  app.add_flag("!--no-prefetch", arguments.options.prefetch, "Read nothing ahead");
  app.add_option("--result", arguments.result, "Where results go, until they are compared")
      ->capture_default_str();
  app.footer(
      "Example:\n"
      "  surfeit generate -o city.recipe --recipe --surfels 30M\n"
      "  surfeit index city.recipe -o city.sft\n"
      "  surfeit generate -o receivers.ply --surfels 200k --order shuffled\n"
      "  paging_bench city.sft receivers.ply\n"
      "  paging_bench city.sft receivers.ply --orders hilbert,morton,input --shares 2,10,100");
  CLI11_PARSE(app, argc, argv);
  const surfeit::Status status = runBench(arguments);
  if (status.ok()) return 0;
  fmt::print(stderr, "paging_bench: {}\n", status.message());
  return 1;
}
