#include "cache/miss_ratio_curve.h"

#include <algorithm>
#include <cmath>

#include "core/assert.h"

namespace surfeit {

MissRatioCurve::MissRatioCurve(std::uint32_t pages_per_sample, std::span<const double> reuses,
                               double first_touches, double lookups)
    : pages_per_sample_(pages_per_sample), lookups_(lookups) {
  SURFEIT_ASSERT(pages_per_sample > 0);
  // Distances that never occur at the far end cost nothing
  std::size_t distances = reuses.size();
  while (distances > 0 && reuses[distances - 1] == 0) --distances;

  at_least_.resize(distances + 1);
  at_least_[distances] = first_touches;
  for (std::size_t distance = distances; distance > 0; --distance) {
    at_least_[distance - 1] = at_least_[distance] + reuses[distance - 1];
  }
}

// A sampled page stands for S = pages_per_sample pages, its look-ups for S times as many. With d
// sampled pages in between, there were anything from d S to (d + 1) S - 1 pages, so the reuses of a
// sampled distance are spread evenly over as many true ones. With S = 1 nothing is spread.
//
// Waldspurger et al., "Efficient MRC Construction with SHARDS" (FAST 2015), 3.4: when a very hot
// page happens to be sampled, or not to be, the sample has more or fewer look-ups than S foretells,
// but nearly all of the difference are hits of even a small cache. Their SHARDS-adj puts it there.
// To count misses by the sample, and hits as what is left of the true look-ups, does just that.
double MissRatioCurve::misses(std::uint64_t frames) const {
  if (frames == 0) return lookups_;
  const auto samples = std::uint64_t(pages_per_sample_);
  const std::uint64_t distance = frames / samples;
  if (distance + 1 >= at_least_.size()) return unavoidableMisses();
  const double reuses = at_least_[distance] - at_least_[distance + 1];
  const double misses = pages_per_sample_ * at_least_[distance] - double(frames % samples) * reuses;
  return std::min(misses, lookups_);
}

double MissRatioCurve::hitRate(std::uint64_t frames) const {
  return lookups_ > 0 ? 1 - misses(frames) / lookups_ : 1;
}

double MissRatioCurve::unavoidableMisses() const {
  return std::min(pages_per_sample_ * at_least_.back(), lookups_);
}

std::optional<std::uint64_t> MissRatioCurve::framesForMisses(double most_misses) const {
  if (!(unavoidableMisses() <= most_misses)) return std::nullopt;
  // Bisection: `enough` always is, everything below `begin` is not
  std::uint64_t begin = 0;
  std::uint64_t enough = std::uint64_t(pages_per_sample_) * (at_least_.size() - 1);
  while (begin < enough) {
    const std::uint64_t middle = begin + (enough - begin) / 2;
    if (misses(middle) <= most_misses) {
      enough = middle;
    } else {
      begin = middle + 1;
    }
  }
  return enough;
}

std::uint64_t MissRatioCurve::saturation() const { return *framesForMisses(unavoidableMisses()); }

std::uint64_t MissRatioCurve::knee() const {
  return *framesForMisses((1 + kKneeMisses) * unavoidableMisses() + kKneeLookups * lookups_);
}

}  // namespace surfeit
