// What every subcommand of the program shares: common options, progress, statistics, messages and
// exit status. Each subcommand lives in <name>_command.cpp and is thin over the library.
#pragma once

#include <CLI/CLI.hpp>
#include <chrono>
#include <cstdint>
#include <functional>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "surfeit/kept_scene.h"
#include "surfeit/progress.h"
#include "surfeit/status.h"
#include "tools/console_progress.h"
#include "tools/sequence.h"

namespace surfeit {

// The options that mean the same everywhere.
struct CommonOptions {
  int threads = 0;                 // 0: all that the job may use
  std::uint64_t memory_bytes = 0;  // 0: the command's default
  std::string stats_path;          // empty: no statistics file
  std::string progress = "auto";   // auto, bar, percent, json or none
  bool quiet = false;
  bool strict = false;  // what would be told as a note ends the command
  bool verbose = false;
  int read_retries = 0;
};

// Which common options a command takes beside --quiet, --verbose and --progress.
struct CommonOptionSet {
  bool threads = true;
  bool memory = true;
  bool stats = true;
  bool works_in_place = false;  // the output may be one of the inputs
};

class CommandContext {
 public:
  // With `frame` the command runs for that frame of a sequence.
  explicit CommandContext(const std::optional<SequenceFrame>& frame = {});
  ~CommandContext();

  CommonOptions common;
  int exit_status = 0;
  SequenceOptions sequence;
  KeptScene* kept_scene = nullptr;  // of a sequence: the scene of the frame before
  std::vector<std::string> words;   // of the command line

  // Of a command that has run: it is a sequence, so its frames are to run, each by a context of its
  // own, and nothing was done yet.
  bool isSequence() const { return is_sequence_; }
  // How the frame has ended.
  FrameOutcome frameOutcome() const;

  void addCommonOptions(CLI::App& command, const CommonOptionSet& set = {});

  // For commands that take sequences of frames, when they have all their other options.
  void addFrameOptions(CLI::App& command);

  // Runs a command's body; a failure is told in one line on stderr and becomes the exit status.
  // Call from the subcommand's callback.
  void run(const std::function<Status()>& body);

  // Progress of the running command; cancelled by SIGINT and SIGTERM.
  Progress& progress();

  // What the command was asked for, on stdout, --quiet or not. Where it cannot be written the
  // command fails when its body has ended.
  void answer(const std::string& text);

  // A line for people, on stderr; not with --quiet.
  void say(const std::string& line);

  // Adds the fields that all statistics have (docs/stats.md) and writes the file of --stats.
  Status writeStats(nlohmann::json fields);

  // Wall seconds since the command began.
  double wallSeconds() const;

  // Threads the command works with.
  int threads() const;

 private:
  Result<bool> isToWork();
  void end(Status status);

  struct Command {
    const CLI::App* app;
    bool works_in_place;
    bool takes_frames = false;
  };
  const std::optional<SequenceFrame> frame_;
  bool is_sequence_ = false, is_up_to_date_ = false;
  std::vector<Command> commands_;
  std::unique_ptr<ConsoleProgress> progress_;
  Status answered_;
  std::chrono::steady_clock::time_point start_;
  double cpu_start_;
};

// "512M", "2G", "1.5GiB", "4096": bytes; units are powers of 1024.
Result<std::uint64_t> parseByteSize(const std::string& text);
// The same, or "80%" of what the job may hold (memoryLimitBytes).
Result<std::uint64_t> parseMemory(const std::string& text);
// "1.5 GiB"
std::string formatBytes(std::uint64_t bytes);
// "1,234,567"
std::string formatCount(std::uint64_t count);

// --temp; without it files lie where the job wants them, else beside the output.
CLI::Option* addTemporaryOption(CLI::App& command, std::string& directory);

// JSON of several lines, in ASCII: what is no UTF-8 in it, as names of files may be, is replaced.
std::string jsonText(const nlohmann::json& json);

// Seconds by phase, for people, "read 1.2 s, sort 0.3 s", and for statistics.
using PhaseSeconds = std::vector<std::pair<std::string, double>>;
std::string formatPhases(const PhaseSeconds& phases);
nlohmann::json jsonOfPhases(const PhaseSeconds& phases);

// Exit status of a failure (docs/architecture.md): 2 usage, 3 bad data, 33 budget, 74 I/O, 75
// other parts missing, 130 interrupted.
int exitStatus(StatusCode code);

// The subcommands, one file each.
void addSampleCommand(CLI::App& app, CommandContext& context);
void addGenerateCommand(CLI::App& app, CommandContext& context);
void addConvertCommand(CLI::App& app, CommandContext& context);
void addIndexCommand(CLI::App& app, CommandContext& context);
void addInfoCommand(CLI::App& app, CommandContext& context);
void addVerifyCommand(CLI::App& app, CommandContext& context);
void addNormalsCommand(CLI::App& app, CommandContext& context);
void addGatherCommand(CLI::App& app, CommandContext& context);
void addMergeCommand(CLI::App& app, CommandContext& context);
void addRadianceCommand(CLI::App& app, CommandContext& context);
void addRelightCommand(CLI::App& app, CommandContext& context);
void addBounceCommand(CLI::App& app, CommandContext& context);
void addBrickCommand(CLI::App& app, CommandContext& context);
void addTuneCommand(CLI::App& app, CommandContext& context);
void addPlanCommand(CLI::App& app, CommandContext& context);
void addViewCommand(CLI::App& app, CommandContext& context);
void addCompositeCommand(CLI::App& app, CommandContext& context);
void addCubeCommand(CLI::App& app, CommandContext& context);
void addPtfilterCommand(CLI::App& app, CommandContext& context);
void addBrickmakeCommand(CLI::App& app, CommandContext& context);
void addLookupCommand(CLI::App& app, CommandContext& context);

}  // namespace surfeit
