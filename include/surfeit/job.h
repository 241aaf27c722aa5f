// What every job from files to files may use, and how it reads.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>

#include "surfeit/color_range.h"

namespace surfeit {

struct JobOptions {
  // Budget of the job. The library's part of the process alone: code, libraries and what the caller
  // holds are not counted (the program counts them). 0: three quarters of what the job may use; the
  // commands that build something take no more than they name in their own header.
  std::uint64_t memory_bytes = 0;
  int threads = 0;      // 0: all that the job may use and the budget feeds
  bool strict = false;  // refuse invalid records instead of leaving them out
  // Where files go that do not outlive the job. Empty: where the job wants them (SLURM_TMPDIR,
  // TMPDIR), else beside the output.
  std::string temporary_directory{};
};

// Among the channels of ReadOptions, "--text=decimal-comma" or "--text=decimal-point": how commas
// in text are read. Without, the lines tell.
inline constexpr std::string_view kTextChannel = "--text", kDecimalComma = "decimal-comma",
                                  kDecimalPoint = "decimal-point";

// How clouds are read (docs/files.md).
struct ReadOptions {
  // Channels to be called otherwise, "FROM=TO,FROM=TO".
  std::string channels{};
  // Of files with several parts (grids, layers, elements) the one to read; empty: the first with a
  // cloud.
  std::string part{};
  // Which records are read, "classification == 2"; empty: all but those that the format marks as
  // not to be used.
  std::string filter{};
  // How colors are read whose numbers do not say what they mean.
  ColorRange color_range = ColorRange::kAuto;
};

}  // namespace surfeit
