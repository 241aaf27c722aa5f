#include "tools/sequence.h"

#include <fmt/format.h>
#include <malloc.h>
#include <sys/stat.h>

#include <algorithm>
#include <span>
#include <string>

#include "tools/console.h"
#include "tools/output_check.h"

namespace surfeit {
namespace {

constexpr const char* kSequenceGroup = "Sequences";

// Inputs that are not given by position.
constexpr const char* kInputOptions[] = {"environment", "brick", "like", "mesh", "camera-file"};
// Inputs behind a word, or numbers (--group NAME=FILE, --cube 0,0,0,1).
constexpr const char* kWordOptions[] = {"group", "cube"};

bool isOneOf(const CLI::Option& option, std::span<const char* const> names) {
  return std::any_of(names.begin(), names.end(),
                     [&](const char* name) { return option.check_lname(name); });
}

bool isInputOption(const CLI::Option& option) {
  return option.get_positional() || isOneOf(option, kInputOptions) || isOneOf(option, kWordOptions);
}

struct FileName {
  std::string name;
  bool is_output = false;
};

// The file that a value of --group or --cube names; empty for numbers.
std::string fileBehindWord(const std::string& value) {
  const bool is_numbers = value.find_first_not_of("+-.0123456789eE, ") == std::string::npos;
  return is_numbers ? "" : filesIn(value).back();
}

// The files that a parsed command names.
std::vector<FileName> fileNames(const CLI::App& command) {
  std::vector<FileName> names;
  for (const CLI::Option* const option : command.get_options()) {
    const bool is_output = isOutputOption(*option);
    if (option->count() == 0 || (!is_output && !isInputOption(*option))) continue;
    for (const std::string& value : option->results()) {
      const std::string name = isOneOf(*option, kWordOptions) ? fileBehindWord(value) : value;
      if (!name.empty()) names.push_back({name, is_output});
    }
  }
  return names;
}

// Whether a later time is known to be later: clocks of files may be coarse.
bool isLater(const timespec& a, const timespec& b) {
  return a.tv_sec > b.tv_sec || (a.tv_sec == b.tv_sec && a.tv_nsec > b.tv_nsec);
}

// Whether a file of this very name is there, or may be: the pattern is that of a directory.
bool isPlainName(const std::string& name) {
  struct ::stat info {};
  if (!hasFramePattern(name) || ::stat(name.c_str(), &info) == 0) return true;
  const std::size_t slash = name.rfind('/');
  return slash != name.npos && !hasFramePattern(name.substr(slash + 1)) &&
         ::stat(name.substr(0, slash + 1).c_str(), &info) == 0;
}

Status checkNoPattern(const std::vector<FileName>& names) {
  for (const FileName& file : names) {
    if (isPlainName(file.name)) continue;
    return Status::invalidArgument(fmt::format(
        "{}: this is a pattern of frames (\"{}\" is frame 1), and no file of this very name is "
        "there: give --frames, such as --frames 1-240, or a name without the pattern",
        file.name, frameName(file.name, 1)));
  }
  return {};
}

Status checkPatterns(const std::vector<FileName>& names) {
  bool has_output = false;
  for (const FileName& file : names) {
    if (!file.is_output) continue;
    has_output = true;
    if (hasFramePattern(file.name)) continue;
    return Status::invalidArgument(fmt::format(
        "{}: with --frames every frame would replace this output: put ####, %04d or $F4 into its "
        "name, for the number of the frame",
        file.name));
  }
  if (has_output) return {};
  return Status::invalidArgument("--frames: the command writes no file");
}

}  // namespace

CLI::Option* addFramesOption(CLI::App& command, SequenceOptions& options) {
  return command
      .add_option_function<std::string>(
          "--frames",
          [&options](const std::string& text) {
            Result<std::vector<int>> parsed = parseFrames(text);
            if (!parsed.ok()) throw CLI::ValidationError("--frames", parsed.status().message());
            options.frames = std::move(*parsed);
          },
          "Run once per frame, with its number for ####, %04d, $F4 or $F in names of files: "
          "1-240, 1-240x2 (every second) or 1,5,10-20 (docs/farm.md)")
      ->type_name("FRAMES")
      ->group(kSequenceGroup);
}

void addSequenceOptions(CLI::App& command, SequenceOptions& options,
                        const std::optional<SequenceFrame>& frame) {
  for (CLI::Option* const option : command.get_options()) {
    if (!frame || (!isOutputOption(*option) && !isInputOption(*option))) continue;
    option->transform(
        [number = frame->number](const std::string& name) { return frameName(name, number); });
  }
  CLI::Option* const frames = addFramesOption(command, options);
  command
      .add_flag("--newer", options.is_newer,
                "Skip frames whose outputs are newer than all their inputs")
      ->needs(frames)
      ->group(kSequenceGroup);
}

Status checkFrameNames(const CLI::App& command, const std::vector<int>& frames) {
  const std::vector<FileName> names = fileNames(command);
  return frames.empty() ? checkNoPattern(names) : checkPatterns(names);
}

bool isUpToDate(const CLI::App& command) {
  timespec newest_input{}, oldest_output{};
  bool has_output = false;
  for (const FileName& file : fileNames(command)) {
    struct ::stat info {};
    // A file that is missing is for the command to make, or to report
    if (::stat(file.name.c_str(), &info) != 0) return false;
    if (!file.is_output) {
      if (isLater(info.st_mtim, newest_input)) newest_input = info.st_mtim;
    } else if (!has_output || isLater(oldest_output, info.st_mtim)) {
      oldest_output = info.st_mtim;
      has_output = true;
    }
  }
  return has_output && isLater(oldest_output, newest_input);
}

int runSequence(const std::vector<int>& frames, bool is_quiet,
                const std::function<FrameOutcome(const SequenceFrame&)>& run_frame) {
  std::vector<int> failed;
  int last_status = 0;
  std::size_t up_to_date = 0;
  for (std::size_t i = 0; i < frames.size(); ++i) {
    const FrameOutcome outcome = run_frame({frames[i], i + 1, frames.size()});
    if (outcome.end == FrameEnd::kStop) {
      tell(fmt::format("surfeit: stopped; frames that are left: {}\n",
                       describeFrames({frames.begin() + std::ptrdiff_t(i), frames.end()})));
      return outcome.exit_status;
    }
    last_status = outcome.exit_status;
    if (outcome.end == FrameEnd::kFailed) failed.push_back(frames[i]);
    if (outcome.end == FrameEnd::kUpToDate) ++up_to_date;
    // What a frame has freed counts against the budget of the next until the system has it back
    malloc_trim(0);
  }
  if (!is_quiet) {
    tell(fmt::format("{} frame{}: {} done, {} up to date, {} failed\n", frames.size(),
                     frames.size() == 1 ? "" : "s", frames.size() - up_to_date - failed.size(),
                     up_to_date, failed.size()));
  }
  if (failed.empty()) return 0;
  // A single frame may be the task of a farm, which goes by the status
  if (frames.size() == 1) return last_status;
  tell(fmt::format("surfeit: {} of {} frames failed; again with --frames {}\n", failed.size(),
                   frames.size(), describeFrames(failed)));
  return 1;
}

}  // namespace surfeit
