// The miss-ratio curve of a stream of look-ups: how many of them an LRU cache would have missed,
// for every size that it might have had. ReuseDistances measures one. Sizes are counted in frames,
// of which each holds a page.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <vector>

namespace surfeit {

// Immutable, so threads may share it freely. A curve without look-ups has no misses anywhere.
class MissRatioCurve {
 public:
  MissRatioCurve() = default;

  // `reuses[d]` are the sampled look-ups with d other sampled pages between them and the last
  // look-up of their page, `first_touches` those that had none, and one of `pages_per_sample` pages
  // is sampled. `lookups` is the true count of the stream. Look-ups that are not sampled for being
  // hits of any cache, those that a front answers, may be counted in it. Counts may be fractions,
  // as old look-ups count less than new ones in a curve of recent ones.
  MissRatioCurve(std::uint32_t pages_per_sample, std::span<const double> reuses,
                 double first_touches, double lookups);

  // Predicted misses of a cache of that many frames, first touches included. Never rises with
  // `frames`, and is never more than lookups(). With every page sampled, exact.
  double misses(std::uint64_t frames) const;
  double hitRate(std::uint64_t frames) const;  // of lookups(), 0 .. 1; 1 without look-ups

  double lookups() const { return lookups_; }
  // What the largest cache misses too: the first touches.
  double unavoidableMisses() const;

  // The smallest cache that misses no more than that; nothing when even the largest misses more.
  std::optional<std::uint64_t> framesForMisses(double most_misses) const;

  // The smallest cache that nothing larger would beat: its frames hold all that is ever reused.
  std::uint64_t saturation() const;

  // The size beyond which more memory hardly helps: the smallest with misses within kKneeMisses of
  // the unavoidable ones and kKneeLookups of all look-ups. The first bound is what a run that reads
  // everything once cannot tell from noise; the second forgives a short stream, or one that is
  // nearly all hits, the last few misses. There is always one, though it may be saturation(): pages
  // that are looked up at random have no other knee.
  std::uint64_t knee() const;
  static constexpr double kKneeMisses = 0.05;
  static constexpr double kKneeLookups = 0.0005;

 private:
  double pages_per_sample_ = 1;
  // Sampled look-ups with d or more other sampled pages since the last look-up of their page, first
  // touches included: the misses of d frames in a world of sampled pages. The last one stands for
  // all beyond.
  std::vector<double> at_least_{0};
  double lookups_ = 0;
};

}  // namespace surfeit
