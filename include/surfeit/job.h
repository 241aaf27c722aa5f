// Resources of a job from files to files, and options for reading clouds.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>

#include "surfeit/color_range.h"

namespace surfeit {

struct JobOptions {
  // Budget of the library's part of the process. Code, libraries and the caller's own memory are
  // not counted (the program does count them). 0: three quarters of the memory that the job may
  // use; some jobs take less by default, as their header says.
  std::uint64_t memory_bytes = 0;
  int threads = 0;      // 0: all that the job may use and the budget has room for
  bool strict = false;  // refuse invalid records instead of leaving them out
  // Directory of temporary files. Empty: SLURM_TMPDIR or TMPDIR where set, else beside the output.
  std::string temporary_directory{};
};

// Among the channels of ReadOptions, "--text=decimal-comma" or "--text=decimal-point": how commas
// in text are read. Without, the lines tell.
inline constexpr std::string_view kTextChannel = "--text", kDecimalComma = "decimal-comma",
                                  kDecimalPoint = "decimal-point";

// How clouds are read (docs/files.md).
struct ReadOptions {
  // New names for channels, "FROM=TO,FROM=TO".
  std::string channels{};
  // The part to read in a file with several (grids, layers, elements); empty: the first that holds
  // a cloud.
  std::string part{};
  // Condition for the records to read, "classification == 2". Empty: all records but those that the
  // format marks as unusable.
  std::string filter{};
  // Meaning of color numbers where the file does not state it.
  ColorRange color_range = ColorRange::kAuto;
};

}  // namespace surfeit
