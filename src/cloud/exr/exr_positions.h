// Whether the positions of a picture are what they seem: pixels that a surface covers in part may
// hold them times alpha, and half floats hold them coarsely.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

namespace surfeit {

// A decoded scan line; null where the picture lacks the channel.
struct ExrScanLine {
  const float* position[3] = {};
  const float* normal[3] = {};
  const float* alpha = nullptr;
  const float* depth = nullptr;
  std::size_t width = 0;

  // Does pixel x hold a position?
  bool isSet(std::size_t x) const;
  bool isPartlyCovered(std::size_t x) const { return alpha != nullptr && alpha[x] < 1; }
};

// Collects evidence from all scan lines. A normal times alpha is as long as alpha, and a position
// times alpha lies off the pixels beside it, which it rejoins when it is divided. The greater
// number of pixels decides for all.
class ExrPositions {
 public:
  enum class Edges { kKeep, kDivide, kLeaveOut };

  void look(const ExrScanLine& line);
  Edges edges() const;
  std::uint64_t count() const {
    return edges() == Edges::kLeaveOut ? set_ - partly_covered_ : set_;
  }
  // What a user should know; `are_half`: positions are stored in 16 bits.
  std::vector<std::string> notes(bool are_half) const;

 private:
  void vote(const ExrScanLine& line, std::size_t x);
  std::optional<std::string> noteOfHalf() const;

  std::uint64_t set_ = 0, partly_covered_ = 0;
  std::uint64_t for_division_ = 0, against_division_ = 0;
  double largest_ = 0;   // of coordinates
  double step_sum_ = 0;  // between pixels beside each other, of distances above 0
  std::uint64_t steps_ = 0;
};

}  // namespace surfeit
