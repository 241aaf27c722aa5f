// Two ways to sort more surfels than memory holds, on one thread and without the disk: sorted runs
// that are merged by a loser tree, and buckets of the curve that are sorted when they are taken.
// Both move the same records and use the same radix sort. And three ways to sort the keys alone.
// Prints nanoseconds of processor time per surfel.
//
//   sort_bench [MILLIONS OF SURFELS] [RUNS OR BUCKETS]
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cstdlib>
#include <ctime>
#include <numeric>
#include <utility>
#include <vector>

#include "core/curve_key.h"
#include "core/parallel.h"
#include "octree/build/curve_sort.h"
#include "surfels/generated/scene_generator.h"

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

// Passes from the bottom alone, over the digits that differ.
void sortFromBottom(std::vector<Ticket>& tickets, std::vector<Ticket>& scratch) {
  CurveKey bits = 0;
  for (const Ticket& ticket : tickets) bits |= ticket.key ^ tickets.front().key;
  for (int shift = 0; shift < 64; shift += 8) {
    if ((bits >> shift & 255) == 0) continue;
    std::array<std::size_t, 256> next{};
    for (const Ticket& ticket : tickets) ++next[ticket.key >> shift & 255];
    std::size_t sum = 0;
    for (std::size_t& n : next) sum += std::exchange(n, sum);
    for (const Ticket& ticket : tickets) scratch[next[ticket.key >> shift & 255]++] = ticket;
    tickets.swap(scratch);
  }
}

// The median over repeats of what a call takes, in nanoseconds of processor time per item.
template <typename Prepare, typename Run>
double medianNs(std::size_t items, Prepare prepare, Run run) {
  constexpr std::size_t kRepeats = 5;
  std::vector<double> ns;
  for (std::size_t repeat = 0; repeat < kRepeats; ++repeat) {
    prepare();
    const double start = cpuSeconds();
    run();
    ns.push_back((cpuSeconds() - start) / double(items) * 1e9);
  }
  std::sort(ns.begin(), ns.end());
  return ns[kRepeats / 2];
}

// A cloud with its keys, and where `parts` equal parts of the curve begin and end in it, sorted.
struct Input {
  std::vector<Record> records;
  std::vector<CurveKey> sorted_keys, splitters;
  std::vector<std::size_t> part_begin;
};

bool makeInput(std::size_t count, RecordOrder order, std::size_t parts, Input& input) {
  SceneRecipe recipe;
  recipe.surfels = count;
  recipe.order = order;
  const Result<SceneGenerator> generator = SceneGenerator::create(recipe);
  if (!generator.ok()) return false;
  std::vector<Surfel> surfels(count);
  generator->generate(0, surfels);
  Bounds3 bounds;
  for (const Surfel& surfel : surfels) bounds.add(surfel.position);
  const RootCube cube = rootCube(bounds);
  for (const Surfel& surfel : surfels) {
    input.records.push_back({curveKey(surfel.position, cube), surfel});
    input.sorted_keys.push_back(input.records.back().key);
  }
  const std::vector<CurveKey>& keys = input.sorted_keys;
  std::sort(input.sorted_keys.begin(), input.sorted_keys.end());
  input.part_begin = {0};
  for (std::size_t b = 1; b < parts; ++b) {
    input.splitters.push_back(keys[count * b / parts]);
    const auto begin = std::lower_bound(keys.begin(), keys.end(), input.splitters.back());
    input.part_begin.push_back(std::size_t(begin - keys.begin()));
  }
  input.part_begin.push_back(count);
  return true;
}

// False when a sort is wrong.
bool measureRecords(const Input& input, std::size_t parts) {
  const std::size_t count = input.records.size();
  std::vector<Record> spill(count), out(count);
  const auto isSorted = [&] {
    for (std::size_t i = 0; i < count; ++i) {
      if (out[i].key != input.sorted_keys[i]) return false;
    }
    return true;
  };
  const auto nothing = [] {};
  const double runs_ns =
      medianNs(count, nothing, [&] { sortByRuns(input.records, parts, spill, out); });
  if (!isSorted()) return false;
  const double buckets_ns = medianNs(count, nothing, [&] {
    sortByBuckets(input.records, input.splitters, input.part_begin, spill, out);
  });
  fmt::print("  records: {} runs {:.0f} ns, {} buckets {:.0f} ns\n", parts, runs_ns, parts,
             buckets_ns);
  return isSorted();
}

bool measureKeys(const Input& input) {
  const std::size_t count = input.records.size();
  std::vector<Ticket> tickets(count), scratch(count);
  const auto prepare = [&] {
    for (std::size_t i = 0; i < count; ++i) tickets[i] = {input.records[i].key, i};
  };
  const auto isSorted = [&] {
    for (std::size_t i = 0; i < count; ++i) {
      if (tickets[i].key != input.sorted_keys[i]) return false;
    }
    return true;
  };
  const double top_ns = medianNs(count, prepare, [&] { sortByKey(tickets, scratch); });
  if (!isSorted()) return false;
  const double bottom_ns = medianNs(count, prepare, [&] { sortFromBottom(tickets, scratch); });
  if (!isSorted()) return false;
  const double comparison_ns = medianNs(count, prepare, [&] {
    std::sort(tickets.begin(), tickets.end(),
              [](const Ticket& a, const Ticket& b) { return a.key < b.key; });
  });
  fmt::print("  keys: from the top {:.0f} ns, from the bottom {:.0f} ns, by comparison {:.0f} ns\n",
             top_ns, bottom_ns, comparison_ns);
  return isSorted();
}

}  // namespace

int main(int argc, char** argv) {
  const std::size_t count = std::size_t(argc > 1 ? std::atoi(argv[1]) : 4) * 1'000'000;
  const std::size_t parts = std::size_t(argc > 2 ? std::atoi(argv[2]) : 125);
  for (const RecordOrder order : {RecordOrder::kScan, RecordOrder::kShuffled}) {
    Input input;
    if (!makeInput(count, order, parts, input)) return 1;
    fmt::print("{} surfels, {}, per surfel:\n", count,
               order == RecordOrder::kScan ? "scan order" : "shuffled");
    bool is_right = false;
    withThreads(1, [&] { is_right = measureRecords(input, parts) && measureKeys(input); });
    if (!is_right) {
      fmt::print(stderr, "sort_bench: a result is not sorted\n");
      return 1;
    }
  }
}
