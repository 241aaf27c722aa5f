// How fast are look-ups in a page cache that hit, and in one that misses now and then? Tries this
// library's cache, RocksDB's two and a plain one (a list and a hash table behind one mutex) on the
// same look-ups, in turn, so that a busy machine slows all of them. Misses copy 16 KiB from memory.
// Also tells how much memory each takes for a budget, once one thread has filled it and another
// replaced all it held.
#include <fmt/format.h>
#include <sys/wait.h>
#include <unistd.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <barrier>
#include <chrono>
#include <cstdio>
#include <ctime>
#include <fstream>
#include <nlohmann/json.hpp>
#include <random>
#include <thread>

#include "bench/internal/cache_designs.h"
#include "bench/internal/cache_traces.h"

namespace surfeit {
namespace {

using Json = nlohmann::json;

constexpr const char* kExamples =
    "Examples:\n"
    "  cache_bench                                   every trace, 1 and 2 threads\n"
    "  cache_bench --trace nodes.u32 --only recorded the node pages of a recorded gather\n"
    "  cache_bench --only zipf --threads 1 --rounds 9\n"
    "RocksDB's caches take part when the bench was built with its headers installed (Debian:\n"
    "apt install librocksdb-dev, then run cmake again).";

struct BenchOptions {
  std::vector<int> threads = {1, 2};
  int rounds = 5;
  std::size_t lookups = 4'000'000;
  PageNumber pages = 40'000;
  std::size_t resident_mib = 256;
  std::vector<std::string> only;  // parts of names of traces; all when empty
  std::string trace_path;
  std::string json_path;

  bool wants(const std::string& trace_name) const {
    return only.empty() || std::any_of(only.begin(), only.end(), [&](const std::string& part) {
             return trace_name.find(part) != std::string::npos;
           });
  }
};

double threadCpuSeconds() {
  timespec now{};
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &now);
  return double(now.tv_sec) + double(now.tv_nsec) * 1e-9;
}

double median(std::vector<double> values) {
  std::sort(values.begin(), values.end());
  return values[values.size() / 2];
}

// One round: every thread replays the whole trace, each from a place of its own.
struct Round {
  double cpu_ns = 0;   // per look-up, mean of threads
  double wall_ns = 0;  // per look-up of a thread
  double hit_rate = 0;
  std::uint64_t wrong = 0;
};

Round runRound(std::vector<std::unique_ptr<CacheUser>>& users, const CacheTrace& trace,
               PageSource& source) {
  using Clock = std::chrono::steady_clock;
  const std::span<const PageNumber> lookups = trace.lookups;
  std::barrier start(std::ptrdiff_t(users.size() + 1));
  std::vector<double> cpu(users.size());
  std::vector<Clock::time_point> ends(users.size());
  std::vector<std::uint64_t> wrong(users.size());
  std::vector<std::thread> threads;
  for (std::size_t i = 0; i < users.size(); ++i) {
    threads.emplace_back([&, i] {
      const std::size_t begin = lookups.size() * i / users.size();
      start.arrive_and_wait();
      const double cpu_begin = threadCpuSeconds();
      wrong[i] = users[i]->replay(lookups.subspan(begin));
      wrong[i] += users[i]->replay(lookups.first(begin));
      cpu[i] = threadCpuSeconds() - cpu_begin;
      ends[i] = Clock::now();
    });
  }
  const std::uint64_t loads_before = source.loads();
  const Clock::time_point begin = Clock::now();
  start.arrive_and_wait();
  for (std::thread& thread : threads) thread.join();

  Round round;
  for (std::size_t i = 0; i < users.size(); ++i) {
    round.cpu_ns += cpu[i] * 1e9 / double(lookups.size()) / double(users.size());
    round.wrong += wrong[i];
  }
  const Clock::time_point end = *std::max_element(ends.begin(), ends.end());
  round.wall_ns = std::chrono::duration<double>(end - begin).count() * 1e9 / double(lookups.size());
  round.hit_rate =
      1 - double(source.loads() - loads_before) / double(lookups.size()) / double(users.size());
  return round;
}

// Medians of all rounds of one cache.
struct Figures {
  std::string name;
  bool is_peer = false;
  double cpu_ns = 0, wall_ns = 0, hit_rate = 0;
};

Result<std::vector<Figures>> runTrace(const CacheTrace& trace, int threads, int rounds,
                                      const std::vector<NamedDesign>& designs, PageSource& source) {
  struct Contestant {
    std::unique_ptr<CacheDesign> cache;
    std::vector<std::unique_ptr<CacheUser>> users;
    std::vector<double> cpu_ns, wall_ns, hit_rate;
  };
  std::vector<Contestant> contestants;
  for (const NamedDesign& design : designs) {
    Contestant& contestant = contestants.emplace_back();
    contestant.cache = design.make(trace.page_count, trace.frames, source);
    for (int i = 0; i < threads; ++i) contestant.users.push_back(contestant.cache->makeUser());
  }
  for (int i = -1; i < rounds; ++i) {  // the first fills the caches
    for (std::size_t at = 0; at < contestants.size(); ++at) {
      Contestant& contestant = contestants[at];
      const Round round = runRound(contestant.users, trace, source);
      if (round.wrong > 0) {
        return Status::failed(fmt::format("{}, {}: {} look-ups gave a wrong page", designs[at].name,
                                          trace.name, round.wrong));
      }
      if (i < 0) continue;
      contestant.cpu_ns.push_back(round.cpu_ns);
      contestant.wall_ns.push_back(round.wall_ns);
      contestant.hit_rate.push_back(round.hit_rate);
    }
  }
  std::vector<Figures> figures;
  for (std::size_t at = 0; at < contestants.size(); ++at) {
    const Contestant& contestant = contestants[at];
    figures.push_back({designs[at].name, designs[at].is_peer, median(contestant.cpu_ns),
                       median(contestant.wall_ns), median(contestant.hit_rate)});
  }
  return figures;
}

// How much less time a cache takes than the best of the peers; 0 without any.
double bestPeerOver(const std::vector<Figures>& all, double Figures::*field, double value) {
  double best = 0;
  for (const Figures& figures : all) {
    if (figures.is_peer && (best == 0 || figures.*field < best)) best = figures.*field;
  }
  return best / value;
}

// Nanoseconds that a miss spends on copying its page alone, whatever the cache.
double copyNs(PageSource& source, const CacheTrace& trace) {
  std::vector<std::byte> frames(trace.frames * kBenchPageBytes);
  std::mt19937 random(1);
  constexpr int kCopies = 20'000;
  const double begin = threadCpuSeconds();
  for (int i = 0; i < kCopies; ++i) {
    source.load(PageNumber(random() % trace.page_count),
                frames.data() + random() % trace.frames * kBenchPageBytes);
  }
  return (threadCpuSeconds() - begin) * 1e9 / kCopies;
}

Json report(const CacheTrace& trace, int threads, double copy_ns, const std::vector<Figures>& all) {
  fmt::print("\n{}, {} thread{}: {} pages, {} frames; a miss copies for {:.0f} ns\n", trace.name,
             threads, threads > 1 ? "s" : "", trace.page_count, trace.frames, copy_ns);
  fmt::print("  {:24} {:>9} {:>9} {:>9} {:>10} {:>16}\n", "", "hits %", "CPU ns", "wall ns", "M/s",
             "RocksDB / it");
  Json rows = Json::array();
  for (const Figures& figures : all) {
    const double cpu_ratio = bestPeerOver(all, &Figures::cpu_ns, figures.cpu_ns);
    const double wall_ratio = bestPeerOver(all, &Figures::wall_ns, figures.wall_ns);
    const double millions = threads * 1e3 / figures.wall_ns;
    fmt::print("  {:24} {:9.3f} {:9.2f} {:9.2f} {:10.1f}", figures.name, 100 * figures.hit_rate,
               figures.cpu_ns, figures.wall_ns, millions);
    if (cpu_ratio > 0) fmt::print(" {:7.2f} {:7.2f}", cpu_ratio, wall_ratio);
    fmt::print("\n");
    rows.push_back({{"cache", figures.name},
                    {"hit_rate", figures.hit_rate},
                    {"cpu_ns", figures.cpu_ns},
                    {"wall_ns", figures.wall_ns},
                    {"million_lookups_per_second", millions},
                    {"best_rocksdb_cpu_over_this", cpu_ratio},
                    {"best_rocksdb_wall_over_this", wall_ratio}});
  }
  return {{"trace", trace.name},
          {"threads", threads},
          {"pages", trace.page_count},
          {"frames", trace.frames},
          {"copy_ns_per_miss", copy_ns},
          {"lookups_per_thread", trace.lookups.size()},
          {"caches", rows}};
}

std::size_t residentBytes() {
  std::ifstream statm("/proc/self/statm");
  std::size_t all = 0, resident = 0;
  statm >> all >> resident;
  return resident * std::size_t(sysconf(_SC_PAGESIZE));
}

// Resident bytes over budget, of a cache that one thread has filled and another replaced.
double residentOverBudget(const NamedDesign& design, std::size_t frames) {
  PageSource source;
  const std::size_t before = residentBytes();
  const auto cache = design.make(PageNumber(2 * frames), frames, source);
  const auto fill = [&](PageNumber begin) {
    std::vector<PageNumber> pages(frames);
    for (std::size_t i = 0; i < frames; ++i) pages[i] = PageNumber(begin + i);
    cache->makeUser()->replay(pages);
  };
  std::barrier filled(2), counted(2);
  std::thread first([&] {
    fill(0);
    filled.arrive_and_wait();
    counted.arrive_and_wait();  // it lives on, as a pool's threads do
  });
  filled.arrive_and_wait();
  std::thread([&] { fill(PageNumber(frames)); }).join();
  const std::size_t after = residentBytes();
  counted.arrive_and_wait();
  first.join();
  return double(after - before) / double(frames * kBenchPageBytes);
}

// The same in a process of its own, whose allocator has seen nothing yet; 0 when that fails.
double residentInProcess(const NamedDesign& design, std::size_t frames) {
  int ends[2];
  if (::pipe(ends) != 0) return 0;
  std::fflush(nullptr);
  const pid_t child = ::fork();
  if (child == 0) {
    const double ratio = residentOverBudget(design, frames);
    _exit(::write(ends[1], &ratio, sizeof ratio) == sizeof ratio ? 0 : 1);
  }
  ::close(ends[1]);
  double ratio = 0;
  if (child < 0 || ::read(ends[0], &ratio, sizeof ratio) != sizeof ratio) ratio = 0;
  ::close(ends[0]);
  if (child > 0) ::waitpid(child, nullptr, 0);
  return ratio;
}

Json reportResident(const std::vector<NamedDesign>& designs, std::size_t mib) {
  fmt::print("Resident bytes over a budget of {} MiB, replaced by a second thread\n", mib);
  Json rows = Json::array();
  for (const NamedDesign& design : designs) {
    const double ratio = residentInProcess(design, (mib << 20) / kBenchPageBytes);
    fmt::print("  {:24} {:9.3f}\n", design.name, ratio);
    rows.push_back({{"cache", design.name}, {"resident_over_budget", ratio}});
  }
  return rows;
}

Result<std::vector<CacheTrace>> makeTraces(const BenchOptions& options) {
  std::vector<CacheTrace> traces;
  const auto add = [&](const std::string& name, auto make) {
    if (options.wants(name)) traces.push_back(make());
  };
  const PageNumber pages = options.pages;
  const std::size_t lookups = options.lookups;
  add("zipf 99.9 %", [&] { return zipfTrace(pages, lookups, 0.999); });
  add("zipf 95 %", [&] { return zipfTrace(pages, lookups, 0.95); });
  add("uniform 99.9 %", [&] { return uniformTrace(pages, lookups, 0.999); });
  add("sweep 99.9 %", [&] { return sweepTrace(pages, lookups); });
  add("octree cut", [&] { return octreeTrace(lookups); });
  if (!options.trace_path.empty() && options.wants("recorded gather")) {
    SURFEIT_ASSIGN_OR_RETURN(CacheTrace recorded, recordedTrace(options.trace_path, lookups));
    traces.push_back(std::move(recorded));
  }
  return traces;
}

Status runBench(const BenchOptions& options) {
  std::vector<NamedDesign> designs = ownDesigns();
  const std::vector<NamedDesign> peers = rocksDbDesigns();
  designs.insert(designs.end(), peers.begin(), peers.end());
  if (peers.empty()) {
    fmt::print(
        "RocksDB: not built in. Debian: apt install librocksdb-dev, then run cmake again.\n");
  }

  // First, while this process has no threads and may fork
  Json results;
  results["resident"] = reportResident(designs, options.resident_mib);
  SURFEIT_ASSIGN_OR_RETURN(const std::vector<CacheTrace> traces, makeTraces(options));
  PageSource source;
  for (const CacheTrace& trace : traces) {
    const double copy_ns = copyNs(source, trace);
    for (const int threads : options.threads) {
      SURFEIT_ASSIGN_OR_RETURN(const std::vector<Figures> figures,
                               runTrace(trace, threads, options.rounds, designs, source));
      results["lookups"].push_back(report(trace, threads, copy_ns, figures));
      std::fflush(stdout);
    }
  }
  if (!options.json_path.empty()) {
    std::ofstream file(options.json_path);
    file << results.dump(2) << '\n';
    if (!file.flush()) {
      return Status::ioError(fmt::format("{}: cannot be written", options.json_path));
    }
  }
  return {};
}

int parseAndRun(int argc, char** argv) {
  BenchOptions options;
  CLI::App app("Measures look-ups in page caches: this library's, RocksDB's, and a plain one");
  app.footer(kExamples);
  app.add_option("--threads", options.threads, "Numbers of threads, such as 1,2")
      ->delimiter(',')
      ->check(CLI::Range(1, 256));
  app.add_option("--rounds", options.rounds, "Rounds of each setting; medians are told")
      ->check(CLI::Range(1, 1000))
      ->capture_default_str();
  app.add_option("--lookups", options.lookups, "Look-ups of a thread in a round")
      ->check(CLI::Range(1000, 1'000'000'000))
      ->capture_default_str();
  app.add_option("--pages", options.pages, "Pages of 16 KiB that zipf, uniform and sweep go over")
      ->check(CLI::Range(1000, 10'000'000))
      ->capture_default_str();
  app.add_option("--only", options.only,
                 "Traces whose names contain one of these: zipf, uniform, sweep, octree, recorded")
      ->delimiter(',');
  app.add_option("--trace", options.trace_path,
                 "Page numbers of a recorded gather, 4 bytes each, little-endian")
      ->check(CLI::ExistingFile);
  app.add_option("--resident-mib", options.resident_mib, "Budget of the memory test, in MiB")
      ->check(CLI::Range(1, 65536))
      ->capture_default_str();
  app.add_option("--json", options.json_path, "Write all figures to this file");
  CLI11_PARSE(app, argc, argv);
  const Status status = runBench(options);
  if (status.ok()) return 0;
  fmt::print(stderr, "cache_bench: {}\n", status.message());
  return 1;
}

}  // namespace
}  // namespace surfeit

int main(int argc, char** argv) { return surfeit::parseAndRun(argc, argv); }
