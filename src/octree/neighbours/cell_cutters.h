// The places that cut a cell, beside its own in its plane: how far they are.
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <glm/geometric.hpp>
#include <glm/vec2.hpp>
#include <span>
#include <vector>

namespace surfeit {

inline bool isNearer(const glm::vec2& a, const glm::vec2& b) {
  return glm::dot(a, a) < glm::dot(b, b);
}

// There is one.
inline float nearestCutter(std::span<const glm::vec2> cutters) {
  return glm::length(*std::min_element(cutters.begin(), cutters.end(), isNearer));
}

// Three quarters of them are nearer. `lengths` is scratch.
inline float usualCutter(std::span<const glm::vec2> cutters, std::vector<float>& lengths) {
  lengths.clear();
  for (const glm::vec2& cutter : cutters) lengths.push_back(glm::length(cutter));
  const auto at = lengths.begin() + std::ptrdiff_t(lengths.size() * 3 / 4);
  std::nth_element(lengths.begin(), at, lengths.end());
  return *at;
}

// Whether they are a row of a scan: one, or two on opposite sides, from much closer than all others
// that cut, and about as close as the nearest place of any sheet.
inline bool isRow(std::span<const glm::vec2> cutters, float nearest_place) {
  constexpr float kOwnRow = 3;       // times as far away as the nearest
  constexpr float kOpposite = 0.7f;  // within 45 degrees
  constexpr float kBesideRow = 4;    // times as far away
  std::array<glm::vec2, 3> nearest{};
  const auto end = std::partial_sort_copy(cutters.begin(), cutters.end(), nearest.begin(),
                                          nearest.end(), isNearer);
  const std::ptrdiff_t count = end - nearest.begin();
  const float first = glm::length(nearest[0]);
  if (count == 0 || first > kOwnRow * nearest_place) return false;
  if (count == 1) return true;
  const float second = glm::length(nearest[1]);
  const bool are_opposite = glm::dot(nearest[0], nearest[1]) < -kOpposite * first * second;
  return are_opposite && (count == 2 || glm::length(nearest[2]) > kBesideRow * second);
}

// Where something dense ends a cell: lines through its places, across the way to them.
class CellEnds {
 public:
  void clear() { ends_.clear(); }
  void add(const glm::vec2& end) { ends_.push_back(end); }
  std::size_t count() const { return ends_.size(); }

  // Whether all within `radius` of there lies behind an end. Its places are scattered about it, so
  // whether it lies at least three quarters of the way there.
  bool areBefore(const glm::vec2& there, float radius) const {
    constexpr float kWay = 0.75f;
    return std::any_of(ends_.begin(), ends_.end(), [&](const glm::vec2& end) {
      const float length = glm::length(end);
      return glm::dot(there, end) - radius * length > kWay * length * length;
    });
  }

 private:
  std::vector<glm::vec2> ends_;
};

}  // namespace surfeit
