#include "tune/sample_curve.h"

#include <algorithm>
#include <limits>

namespace surfeit {
namespace {

constexpr double kNone = std::numeric_limits<double>::infinity();
// So many look-ups that no curve is cut off at them.
constexpr std::uint64_t kManyLookUps = std::uint64_t{1} << 60;

}  // namespace

void StretchMisses::begin(const ReuseDistances& distances, std::uint64_t requests) {
  count(distances, requests, -1);
}

void StretchMisses::end(const ReuseDistances& distances, std::uint64_t requests) {
  count(distances, requests, 1);
}

double StretchMisses::misses(std::size_t d) const {
  return misses_.empty() ? 0 : misses_[std::min(d, misses_.size() - 1)];
}

void StretchMisses::count(const ReuseDistances& distances, std::uint64_t requests, double sign) {
  const MissRatioCurve curve = distances.curve(kManyLookUps);
  const std::uint64_t samples = distances.pagesPerSample();
  const std::size_t sizes = curve.saturation() / samples + 2;
  grow(sizes);
  misses_[0] += sign * double(distances.touches() * samples);
  for (std::size_t d = 1; d < misses_.size(); ++d) misses_[d] += sign * curve.misses(d * samples);
  requests_ += sign * double(requests);
}

void StretchMisses::add(const StretchMisses& others) {
  grow(others.misses_.size());
  for (std::size_t d = 0; d < misses_.size(); ++d) misses_[d] += others.misses(d);
  requests_ += others.requests_;
}

// Larger caches than were counted so far miss as much as the largest did.
void StretchMisses::grow(std::size_t sizes) {
  if (misses_.size() < sizes) misses_.resize(sizes, misses_.empty() ? 0 : misses_.back());
}

double extrapolateToAll(double every, double second, double share) {
  if (every <= 0 || share >= 1) return every;
  if (second >= every) return every;  // grows no more
  if (second <= 0) return kNone;
  // 1 / D(q) = 1 / D1 + (k / D1) / q is a line in 1 / q
  const double slope = share * (1 / second - 1 / every);
  const double at_infinity = 2 / every - 1 / second;
  const double inverse = at_infinity + slope;
  return inverse > 0 ? 1 / inverse : kNone;
}

MissRatioCurve wholeCurve(const StretchMisses& stretches, const SpreadMisses& spread,
                          std::uint64_t page_count, std::uint32_t pages_per_sample) {
  const double requests = spread.every.lookups() / spread.share;
  const double stretch_scale = stretches.requests() > 0 ? requests / stretches.requests() : 0;
  const auto grown = [&](double every, double second) {
    return std::min(extrapolateToAll(every, second, spread.share), requests);
  };

  // Every page is read once, or else never; where more of them are foreseen than there are, so are
  // more misses of all large caches
  const double most_pages = double(page_count);
  const double all = grown(spread.every.unavoidableMisses(), spread.second.unavoidableMisses());
  const double first = std::min(all, most_pages);
  const double bound = all > most_pages ? most_pages / all : 1;

  // The spread receivers look up fewer pages in between than all do, so theirs is the lower bound
  const std::size_t distances = page_count / pages_per_sample + 2;
  std::vector<double> at_least(distances);
  double smaller = requests;
  for (std::size_t d = 0; d < distances; ++d) {
    const double of_stretches = stretches.misses(d) * stretch_scale;
    double misses = of_stretches;
    if (d > 0) {
      const std::uint64_t frames = std::uint64_t{d} * pages_per_sample;
      const double every = spread.every.misses(frames);
      const double of_spread = bound * grown(every, spread.second.misses(frames));
      misses = std::max(std::min(of_stretches, of_spread), every);
    }
    smaller = at_least[d] = std::clamp(misses, std::min(first, smaller), smaller);
  }
  std::vector<double> reuses(distances);
  for (std::size_t d = 0; d < distances; ++d) {
    const double larger = d + 1 < distances ? at_least[d + 1] : std::min(first, smaller);
    reuses[d] = (at_least[d] - larger) / pages_per_sample;
  }
  return MissRatioCurve(pages_per_sample, reuses, std::min(first, smaller) / pages_per_sample,
                        requests);
}

}  // namespace surfeit
