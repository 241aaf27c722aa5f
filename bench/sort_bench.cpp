// Two ways to sort more surfels than memory holds, on one thread and without the disk: sorted runs
// that are merged by a loser tree, and buckets of the curve that are sorted when they are taken.
// Both move the same records and use the same radix sort. Prints nanoseconds of processor time per
// surfel.
//
//   sort_bench [MILLIONS OF SURFELS] [RUNS OR BUCKETS]
#include <fmt/format.h>
#include <tbb/task_arena.h>

#include <algorithm>
#include <cstdlib>
#include <ctime>
#include <numeric>
#include <vector>

#include "core/curve_key.h"
#include "io/scene_generator.h"
#include "octree/curve_sort.h"

namespace {

using namespace surfeit;

struct Record {
  CurveKey key;
  Surfel surfel;
};

double cpuSeconds() {
  timespec now{};
  clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &now);
  return double(now.tv_sec) + double(now.tv_nsec) * 1e-9;
}

// Sorts records by key: tickets first, then the records themselves into `out`.
void sortRecords(std::span<const Record> records, std::span<Record> out,
                 std::vector<Ticket>& tickets, std::vector<Ticket>& scratch) {
  tickets.resize(records.size());
  scratch.resize(records.size());
  for (std::size_t i = 0; i < records.size(); ++i) tickets[i] = {records[i].key, i};
  sortByKey(tickets, scratch);
  for (std::size_t i = 0; i < records.size(); ++i) {
    if (i + 16 < records.size()) __builtin_prefetch(&records[tickets[i + 16].index]);
    out[i] = records[tickets[i].index];
  }
}

// A tree of losers over sorted runs: replacing the winner costs one comparison per level.
class LoserTree {
 public:
  explicit LoserTree(const std::vector<std::span<const Record>>& runs) : runs_(runs) {
    size_ = 1;
    while (size_ < runs_.size()) size_ *= 2;
    runs_.resize(size_);
    losers_.assign(size_, 0);
    winner_ = build(1);
  }
  bool isEmpty() const { return runs_[winner_].empty(); }
  const Record& take() {
    const Record& record = runs_[winner_].front();
    runs_[winner_] = runs_[winner_].subspan(1);
    std::size_t at = winner_;
    for (std::size_t node = (at + size_) / 2; node > 0; node /= 2) {
      if (keyOf(losers_[node]) < keyOf(at)) std::swap(losers_[node], at);
    }
    winner_ = at;
    return record;
  }

 private:
  CurveKey keyOf(std::size_t run) const {
    return runs_[run].empty() ? ~CurveKey{0} : runs_[run].front().key;
  }
  std::size_t build(std::size_t node) {
    if (node >= size_) return node - size_;
    std::size_t winner = build(2 * node), loser = build(2 * node + 1);
    if (keyOf(loser) < keyOf(winner)) std::swap(winner, loser);
    losers_[node] = loser;
    return winner;
  }

  std::vector<std::span<const Record>> runs_;
  std::vector<std::size_t> losers_;
  std::size_t size_ = 1, winner_ = 0;
};

// Runs: sort each, then merge all.
void sortByRuns(std::span<const Record> input, std::size_t run_count, std::span<Record> spill,
                std::span<Record> out) {
  std::vector<Ticket> tickets, scratch;
  std::vector<std::span<const Record>> runs;
  for (std::size_t r = 0; r < run_count; ++r) {
    const std::size_t begin = input.size() * r / run_count;
    const std::size_t size = input.size() * (r + 1) / run_count - begin;
    sortRecords(input.subspan(begin, size), spill.subspan(begin, size), tickets, scratch);
    runs.push_back(spill.subspan(begin, size));
  }
  LoserTree tree(runs);
  for (Record& record : out) record = tree.take();
}

// Buckets: distribute batch by batch, as SurfelStore does, then sort each. begin: where buckets lie
// in `spill`, which a temporary file does not need to know.
void sortByBuckets(std::span<const Record> input, std::span<const CurveKey> splitters,
                   const std::vector<std::size_t>& begin, std::span<Record> spill,
                   std::span<Record> out) {
  constexpr std::size_t kBatch = 8192;
  const std::size_t buckets = splitters.size() + 1;
  const auto bucketOf = [&](CurveKey key) {
    return std::size_t(std::upper_bound(splitters.begin(), splitters.end(), key) -
                       splitters.begin());
  };
  std::vector<std::size_t> next = begin;
  std::vector<std::uint32_t> bucket_of(kBatch);
  std::vector<std::size_t> group(buckets + 1);
  std::vector<Record> grouped(kBatch);
  for (std::size_t at = 0; at < input.size(); at += kBatch) {
    const std::span<const Record> batch = input.subspan(at, std::min(kBatch, input.size() - at));
    std::fill(group.begin(), group.end(), 0);
    for (std::size_t i = 0; i < batch.size(); ++i) {
      bucket_of[i] = std::uint32_t(bucketOf(batch[i].key));
      ++group[bucket_of[i] + 1];
    }
    std::partial_sum(group.begin(), group.end(), group.begin());
    for (std::size_t i = 0; i < batch.size(); ++i) grouped[group[bucket_of[i]]++] = batch[i];
    std::size_t from = 0;
    for (std::size_t b = 0; b < buckets; ++b) {
      std::copy(grouped.begin() + std::ptrdiff_t(from), grouped.begin() + std::ptrdiff_t(group[b]),
                spill.begin() + std::ptrdiff_t(next[b]));
      next[b] += group[b] - from;
      from = group[b];
    }
  }
  std::vector<Ticket> tickets, scratch;
  for (std::size_t b = 0; b < buckets; ++b) {
    const std::size_t size = begin[b + 1] - begin[b];
    sortRecords(spill.subspan(begin[b], size), out.subspan(begin[b], size), tickets, scratch);
  }
}

}  // namespace

int main(int argc, char** argv) {
  const std::size_t count = std::size_t(argc > 1 ? std::atoi(argv[1]) : 4) * 1'000'000;
  const std::size_t parts = std::size_t(argc > 2 ? std::atoi(argv[2]) : 125);
  for (const RecordOrder order : {RecordOrder::kScan, RecordOrder::kShuffled}) {
    SceneRecipe recipe;
    recipe.surfels = count;
    recipe.order = order;
    const Result<SceneGenerator> generator = SceneGenerator::create(recipe);
    if (!generator.ok()) return 1;
    std::vector<Surfel> surfels(count);
    generator->generate(0, surfels);
    Bounds3 bounds;
    for (const Surfel& surfel : surfels) bounds.add(surfel.position);
    const RootCube cube = rootCube(bounds);
    std::vector<Record> input, spill(count), out(count);
    for (const Surfel& surfel : surfels) input.push_back({curveKey(surfel.position, cube), surfel});
    surfels = {};
    std::vector<CurveKey> keys, splitters;
    for (const Record& record : input) keys.push_back(record.key);
    std::sort(keys.begin(), keys.end());
    std::vector<std::size_t> begin = {0};
    for (std::size_t b = 1; b < parts; ++b) {
      splitters.push_back(keys[count * b / parts]);
      begin.push_back(
          std::size_t(std::lower_bound(keys.begin(), keys.end(), splitters.back()) - keys.begin()));
    }
    begin.push_back(count);

    tbb::task_arena arena(1);
    std::vector<double> runs_ns, buckets_ns;
    for (int repeat = 0; repeat < 5; ++repeat) {
      double start = cpuSeconds();
      arena.execute([&] { sortByRuns(input, parts, spill, out); });
      runs_ns.push_back((cpuSeconds() - start) / double(count) * 1e9);
      start = cpuSeconds();
      arena.execute([&] { sortByBuckets(input, splitters, begin, spill, out); });
      buckets_ns.push_back((cpuSeconds() - start) / double(count) * 1e9);
      for (std::size_t i = 0; i < count; ++i) {
        if (out[i].key != keys[i]) return 1;
      }
    }
    std::sort(runs_ns.begin(), runs_ns.end());
    std::sort(buckets_ns.begin(), buckets_ns.end());
    fmt::print("{} surfels, {}: {} runs {:.0f} ns, {} buckets {:.0f} ns per surfel\n", count,
               order == RecordOrder::kScan ? "scan order" : "shuffled", parts, runs_ns[2], parts,
               buckets_ns[2]);
  }
}
