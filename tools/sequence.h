// Sequences of frames: --frames runs a command once for each frame, in this process, with the
// number of the frame in the names of its files.
#pragma once

#include <CLI/CLI.hpp>
#include <functional>
#include <optional>
#include <vector>

#include "surfeit/status.h"
#include "tools/frames.h"

namespace surfeit {

// What a command line says about its sequence.
struct SequenceOptions {
  std::vector<int> frames;  // empty: no sequence
  bool is_newer = false;    // skip frames whose outputs are newer than all inputs
};

// Adds --frames alone, for a command that only speaks of frames.
CLI::Option* addFramesOption(CLI::App& command, SequenceOptions& options);

// Adds --frames and --newer. With `frame`, the names of files that the command gets are those of
// that frame. Call it when the command has all its other options.
void addSequenceOptions(CLI::App& command, SequenceOptions& options,
                        const std::optional<SequenceFrame>& frame);

// Whether the names of a parsed command fit to its frames, none where it is no sequence.
// kInvalidArgument for a pattern without frames, unless it is the name of a file that is there, and
// for frames that would all replace one output.
Status checkFrameNames(const CLI::App& command, const std::vector<int>& frames);

// Of a command with the names of one frame: all outputs are there, and newer than all inputs.
bool isUpToDate(const CLI::App& command);

enum class FrameEnd { kDone, kUpToDate, kFailed, kStop };

// Runs all frames and returns the exit status: that of the frame that stopped all, or that was all,
// else 1 when a frame failed.
struct FrameOutcome {
  FrameEnd end = FrameEnd::kDone;
  int exit_status = 0;
};
int runSequence(const std::vector<int>& frames, bool is_quiet,
                const std::function<FrameOutcome(const SequenceFrame&)>& run_frame);

}  // namespace surfeit
