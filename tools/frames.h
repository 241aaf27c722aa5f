// Frames of a sequence, and names of files with a place for the number of the frame.
#pragma once

#include <cstddef>
#include <string>
#include <string_view>
#include <vector>

#include "surfeit/status.h"

namespace surfeit {

// One frame while a sequence runs.
struct SequenceFrame {
  int number = 0;
  std::size_t index = 0, count = 0;  // the index-th of count, from 1

  // "frame 7 (3 of 24)"
  std::string label() const;
};

// The largest number of a frame, with either sign, and the most frames of a sequence.
inline constexpr int kLargestFrame = 99'999'999;
inline constexpr std::size_t kMostFrames = 1'000'000;

// "1-240", "1-240x2" (every second), "1,5,10-20", "-10--1": in the order given, each frame once.
// kInvalidArgument says what was found and what is expected.
Result<std::vector<int>> parseFrames(std::string_view text);

// Frames as parseFrames takes them: "1-3,7".
std::string describeFrames(const std::vector<int>& frames);

// Whether a name has a place for the number of a frame: a run of # (as many digits as there are #),
// %d or %04d, $F or $F4.
bool hasFramePattern(std::string_view name);

// The name with the number in all these places. Different frames give different names.
std::string frameName(std::string_view name, int frame);

}  // namespace surfeit
