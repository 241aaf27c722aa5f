// The value at a place from the nearest points of a baked cloud.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <glm/vec3.hpp>
#include <memory>
#include <span>
#include <utility>
#include <vector>

#include "lookup/baked_points.h"
#include "surfeit/lookup.h"
#include "surfeit/status.h"

namespace surfeit {

// One thread at a time. Places that follow each other are close to each other, or it takes long.
class BakedSearch {
 public:
  // Points beyond `reach` do not count.
  BakedSearch(BakedPoints& points, LookupInterpolation interpolation, double reach);

  // The value at a place with a normal, unit or zero, into points.valueCount() floats. False, and
  // nothing written, when no point that faces as the normal does is within reach.
  Result<bool> find(const glm::dvec3& position, const glm::vec3& normal, std::span<float> values);

 private:
  // Points that make a value, and one more that tells where their weight ends.
  static constexpr std::size_t kSmoothPoints = 8;
  struct Near {
    double distance_sq = 0;
    std::uint64_t point = 0;  // page * kPoints + place in the page
    bool operator<(const Near& other) const {
      return distance_sq != other.distance_sq ? distance_sq < other.distance_sq
                                              : point < other.point;
    }
  };
  // A box that may hold nearer points.
  struct Candidate {
    double distance_sq = 0;
    std::uint32_t level = 0;
    std::size_t index = 0;
  };

  double limitSq() const;
  void pushChildren(const Candidate& box);
  Status visitPage(std::size_t number);
  void take(double distance_sq, std::uint64_t point);
  Result<const BakedPage*> hold(std::size_t number);
  Status addValues(const Near& near, double weight);

  BakedPoints& points_;
  const std::size_t wanted_;
  const double reach_sq_;
  glm::dvec3 position_{0};
  glm::vec3 normal_{0};
  bool has_normal_ = false;
  std::array<Near, kSmoothPoints + 1> found_;  // ascending
  std::size_t found_count_ = 0;
  std::vector<Candidate> stack_;
  std::vector<double> sums_;
  std::array<std::pair<std::size_t, std::shared_ptr<const BakedPage>>, BakedPoints::kHeldPages>
      held_;
  std::size_t next_held_ = 0;
};

}  // namespace surfeit
