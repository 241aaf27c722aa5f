#include "index/shards/index_shard_ranges.h"

#include <algorithm>
#include <bit>
#include <optional>

#include "core/assert.h"

namespace surfeit {
namespace {

constexpr CurveKey kEnd = ~CurveKey{0};

// The first key of the cell above the one that begins at `key`, at whatever level that is largest.
CurveKey cellAbove(CurveKey key) {
  const int digits = std::countr_zero(key) / 3;
  const int shift = 3 * (digits + 1);
  return shift > 63 ? 0 : key >> shift << shift;
}

// The first key of the largest cell that has `key` and not `before`, which is smaller.
CurveKey cellBehind(CurveKey before, CurveKey key) {
  const int shift = 3 * (kCurveLevels - firstDifferentLevel(before, key));
  return key >> shift << shift;
}

}  // namespace

std::uint64_t leastBefore(Repeats repeats) {
  // Up to 31 of 32 surfels may repeat another
  return repeats == Repeats::kThin ? 8 * kFreshSurfels : kFreshSurfels;
}

// Near every place that would make equal parts, the nearest one behind enough surfels of its cell,
// by the sample; twice as many as needed, for it errs.
std::vector<CurveKey> chooseRanges(std::span<const CurveKey> sample, std::uint64_t surfels,
                                   int count, std::uint64_t least) {
  std::vector<CurveKey> splitters;
  if (sample.empty()) return splitters;
  const double weight = double(surfels) / double(sample.size());
  const auto parts = static_cast<std::size_t>(count);
  const std::size_t reach = sample.size() / (2 * parts);
  for (std::size_t part = 1; part < parts; ++part) {
    const std::size_t target = sample.size() * part / parts;
    CurveKey best = 0;
    double best_score = -1;
    for (std::size_t i = std::max<std::size_t>(1, target - std::min(target, reach));
         i < std::min(sample.size(), target + reach + 1); ++i) {
      if (sample[i - 1] == sample[i]) continue;
      const CurveKey key = cellBehind(sample[i - 1], sample[i]);
      const auto above = std::lower_bound(sample.begin(), sample.end(), cellAbove(key));
      const double before = weight * double(i - std::size_t(above - sample.begin()));
      const double distance = double(i > target ? i - target : target - i) / double(reach + 1);
      // Enough before it, and then near
      const double score = std::min(1.0, before / (2.0 * double(least))) * 2 + 1 - distance;
      if (score <= best_score) continue;
      best_score = score;
      best = key;
    }
    if (best > 0 && (splitters.empty() || best > splitters.back())) splitters.push_back(best);
  }
  return splitters;
}

void RangeCount::add(const RangeCount& other) {
  surfels += other.surfels;
  least = std::min(least, other.least);
  most = std::max(most, other.most);
}

RangeCounts::RangeCounts(const std::vector<CurveKey>& splitters) : splitters_(splitters) {
  for (const CurveKey splitter : splitters_) {
    marks_.push_back(splitter);
    if (const CurveKey above = cellAbove(splitter); above > 0) marks_.push_back(above);
  }
  marks_.push_back(kEnd);
  std::sort(marks_.begin(), marks_.end());
  marks_.erase(std::unique(marks_.begin(), marks_.end()), marks_.end());
  counts_.resize(marks_.size());
}

void RangeCounts::add(std::span<const CurveKey> keys) {
  std::vector<RangeCount> added(marks_.size());
  for (const CurveKey key : keys) {
    const auto mark = std::upper_bound(marks_.begin(), marks_.end(), key) - marks_.begin();
    added[std::size_t(mark)].add({1, key, key});
  }
  const std::lock_guard lock(mutex_);
  add(std::span<const RangeCount>(added));
}

void RangeCounts::add(std::span<const RangeCount> counts) {
  SURFEIT_CHECK(counts.size() == counts_.size());
  for (std::size_t i = 0; i < counts.size(); ++i) counts_[i].add(counts[i]);
}

// Both are marks, or 0.
RangeCount RangeCounts::between(CurveKey begin, CurveKey end) const {
  RangeCount sum;
  for (std::size_t i = 0; i < marks_.size(); ++i) {
    const CurveKey from = i == 0 ? 0 : marks_[i - 1];
    if (from >= begin && marks_[i] <= end) sum.add(counts_[i]);
  }
  return sum;
}

bool RangeCounts::hasBefore(std::size_t range, std::uint64_t least) const {
  const CurveKey begin = splitters_[range - 1];
  return between(cellAbove(begin), begin).surfels >= least;
}

std::vector<RangeCounts::Joined> RangeCounts::join(std::uint64_t least) const {
  std::vector<Joined> joined(1);
  std::vector<RangeCount> counts(1);
  for (std::size_t range = 0; range <= splitters_.size(); ++range) {
    const CurveKey begin = range == 0 ? 0 : splitters_[range - 1];
    const CurveKey end = range == splitters_.size() ? kEnd : splitters_[range];
    if (range > 0 && hasBefore(range, least)) {
      joined.push_back({int(range), int(range), 0, {}});
      counts.emplace_back();
    }
    joined.back().last = int(range);
    counts.back().add(between(begin, end));
    joined.back().surfels = counts.back().surfels;
  }
  // The surfels around each of them
  std::optional<std::size_t> before;
  for (std::size_t i = 0; i < joined.size(); ++i) {
    if (counts[i].surfels == 0) continue;
    if (before) {
      const int level = firstDifferentLevel(counts[*before].most, counts[i].least);
      joined[*before].ends.end_level = level;
      joined[i].ends.begin_level = level;
    }
    before = i;
  }
  return joined;
}

}  // namespace surfeit
