#include "tools/command.h"

#include <fmt/format.h>
#include <unistd.h>

#include <charconv>
#include <cmath>
#include <exception>
#include <limits>
#include <new>

#include "surfeit/output.h"
#include "surfeit/process.h"
#include "tools/console.h"
#include "tools/output_check.h"

namespace surfeit {
namespace {

constexpr int kStatsVersion = 1;

ConsoleProgress::Style progressStyle(const CommonOptions& common) {
  using Style = ConsoleProgress::Style;
  if (common.quiet || common.progress == "none") return Style::kNone;
  if (common.progress == "percent") return Style::kPercent;
  if (common.progress == "json") return Style::kJson;
  if (common.progress == "bar") return Style::kBar;
  return isatty(STDERR_FILENO) ? Style::kBar : Style::kNone;
}

}  // namespace

CommandContext::CommandContext(const std::optional<SequenceFrame>& frame)
    : frame_(frame),
      start_(std::chrono::steady_clock::now()),
      cpu_start_(frame ? processCpuSeconds() : 0) {}
CommandContext::~CommandContext() = default;

void CommandContext::addCommonOptions(CLI::App& command, const CommonOptionSet& set) {
  commands_.push_back({&command, set.works_in_place});
  constexpr const char* kGroup = "Common";
  if (set.threads) {
    command.add_option("--threads", common.threads, "Threads (default: what the job may use)")
        ->check(CLI::Range(1, kMostThreads))
        ->group(kGroup);
  }
  if (set.memory) {
    const auto parse = [this](const std::string& text) {
      const Result<std::uint64_t> bytes = parseMemory(text);
      if (!bytes.ok()) throw CLI::ValidationError("--memory", bytes.status().message());
      common.memory_bytes = *bytes;
    };
    command
        .add_option_function<std::string>(
            "--memory", parse, "Limit of the process: 512M, 2G, or 80% of what the job may hold")
        ->type_name("SIZE")
        ->group(kGroup);
  }
  if (set.stats) {
    command.add_option("--stats", common.stats_path, "Write statistics to this JSON file")
        ->group(kGroup);
  }
  command.add_option("--progress", common.progress, "auto, bar, percent, json or none")
      ->check(CLI::IsMember({"auto", "bar", "percent", "json", "none"}))
      ->group(kGroup);
  command
      .add_flag(
          "--strict", common.strict,
          "Fail where data is guessed, skipped, narrowed or left out, instead of reporting it")
      ->group(kGroup);
  command
      .add_option("--read-retries", common.read_retries,
                  "Tries again so many times a read that fails with EIO (networked file systems)")
      ->check(CLI::Range(0, 100))
      ->group(kGroup);
  command.add_flag("-q,--quiet", common.quiet, "Say nothing but errors")->group(kGroup);
  command.add_flag("-v,--verbose", common.verbose, "Say which phase begins")->group(kGroup);
}

void CommandContext::run(const std::function<Status()>& body) {
  Status status;
  progress_ = std::make_unique<ConsoleProgress>(progressStyle(common), common.quiet, common.verbose,
                                                common.strict, frame_);
  // The peak of earlier frames is none of the program's own
  if (!frame_) limitProcess(common.memory_bytes);
  setReadRetries(common.read_retries);
  try {
    const Result<bool> is_to_work = isToWork();
    status = is_to_work.status();
    if (is_to_work.ok() && *is_to_work) status = body();
  } catch (const std::bad_alloc&) {
    // Told without a Status, whose text would take some
    progress_->clear();
    tellRaw("surfeit: out of memory; give the job more, or --memory a smaller budget\n");
    exit_status = exitStatus(StatusCode::kFailed);
    return;
  } catch (const CLI::Error&) {
    throw;
  } catch (const std::exception& error) {
    status = Status::failed(error.what());
  }
  progress_->clear();
  const std::string& refused = progress_->refused();
  if (!refused.empty()) {
    status = Status::corruption(refused + " (refused by --strict)");
  }
  end(status.ok() ? answered_ : std::move(status));
}

void CommandContext::end(Status status) {
  if (status.ok()) return;
  const std::string frame = frame_ ? fmt::format("frame {}: ", frame_->number) : "";
  tell(fmt::format("surfeit: {}{}\n", frame, status.message()));
  exit_status = exitStatus(status.code());
  if (status.code() == StatusCode::kInterrupted && ConsoleProgress::cancelSignal() != 0) {
    exit_status = 128 + ConsoleProgress::cancelSignal();
  }
}

void CommandContext::addFrameOptions(CLI::App& command) {
  addSequenceOptions(command, sequence, frame_);
  commands_.back().takes_frames = true;
}

// Looks at what the command was given before it works.
Result<bool> CommandContext::isToWork() {
  for (const Command& command : commands_) {
    if (!command.app->parsed()) continue;
    if (!frame_ && command.takes_frames) {
      SURFEIT_RETURN_IF_ERROR(checkFrameNames(*command.app, sequence.frames));
      is_sequence_ = !sequence.frames.empty();
      if (is_sequence_) return false;
    }
    SURFEIT_RETURN_IF_ERROR(checkOutputs(*command.app, command.works_in_place));
    is_up_to_date_ = frame_ && sequence.is_newer && isUpToDate(*command.app);
    if (is_up_to_date_) return false;
    if (frame_) say(frame_->label());
  }
  return true;
}

FrameOutcome CommandContext::frameOutcome() const {
  if (exit_status == 0) return {is_up_to_date_ ? FrameEnd::kUpToDate : FrameEnd::kDone, 0};
  // What is wrong with the command line is wrong with every frame
  const bool is_to_stop = ConsoleProgress::cancelSignal() != 0 ||
                          exit_status == exitStatus(StatusCode::kInvalidArgument);
  return {is_to_stop ? FrameEnd::kStop : FrameEnd::kFailed, exit_status};
}

Progress& CommandContext::progress() { return *progress_; }

void CommandContext::answer(const std::string& text) {
  progress_->clear();
  Status written = writeAnswer(text.ends_with('\n') ? text : text + "\n");
  if (answered_.ok()) answered_ = std::move(written);
}

void CommandContext::say(const std::string& line) {
  if (common.quiet) return;
  progress_->clear();
  tell(line + "\n");
}

Status CommandContext::writeStats(nlohmann::json fields) {
  if (common.stats_path.empty()) return {};
  fields["stats_version"] = kStatsVersion;
  fields["wall_seconds"] = wallSeconds();
  fields["cpu_seconds"] = processCpuSeconds() - cpu_start_;
  fields["peak_resident_bytes"] = peakResidentBytes();
  fields["threads"] = threads();
  if (frame_) fields["frame"] = frame_->number;
  if (common.read_retries > 0) fields["reads_retried"] = readsRetried();
  return writeOutput(common.stats_path, jsonText(fields) + "\n");
}

double CommandContext::wallSeconds() const {
  return std::chrono::duration<double>(std::chrono::steady_clock::now() - start_).count();
}

int CommandContext::threads() const {
  return common.threads > 0 ? common.threads : defaultThreadCount();
}

Result<std::uint64_t> parseMemory(const std::string& text) {
  if (!text.ends_with('%')) return parseByteSize(text);
  double percent = 0;
  const char* const end = text.data() + text.size() - 1;
  const auto [number_end, error] = std::from_chars(text.data(), end, percent);
  if (error != std::errc() || number_end != end || !(percent > 0 && percent <= 100)) {
    return Status::invalidArgument(
        fmt::format("found \"{}\", expected more than 0% and at most 100%", text));
  }
  return static_cast<std::uint64_t>(percent / 100 * double(memoryLimitBytes()));
}

Result<std::uint64_t> parseByteSize(const std::string& text) {
  double value = 0;
  const char* const end = text.data() + text.size();
  const auto [unit_begin, error] = std::from_chars(text.data(), end, value);
  std::string unit(unit_begin, end);
  for (char& c : unit) c = static_cast<char>(std::toupper(static_cast<unsigned char>(c)));
  if (unit.size() > 1 && unit.ends_with("IB")) unit.resize(unit.size() - 2);
  if (unit.size() > 1 && unit.ends_with("B")) unit.resize(unit.size() - 1);
  const std::string_view units = "BKMGT";
  const std::size_t power = unit.empty() ? 0 : units.find(unit);
  const double bytes = std::ldexp(value, static_cast<int>(10 * std::min<std::size_t>(power, 6)));
  if (error != std::errc() || unit.size() > 1 || power == std::string_view::npos || !(bytes >= 1) ||
      bytes > 1e18) {
    return Status::invalidArgument(
        fmt::format("found \"{}\", expected a size such as 512M, 2G, 1048576 or 80%", text));
  }
  return static_cast<std::uint64_t>(bytes);
}

std::string formatBytes(std::uint64_t bytes) {
  constexpr const char* kUnits[] = {"B", "KiB", "MiB", "GiB", "TiB", "PiB"};
  double value = double(bytes);
  std::size_t unit = 0;
  while (value >= 1024 && unit + 1 < std::size(kUnits)) {
    value /= 1024;
    ++unit;
  }
  return unit == 0 ? fmt::format("{} B", bytes) : fmt::format("{:.1f} {}", value, kUnits[unit]);
}

std::string formatCount(std::uint64_t count) {
  if (count < 1000) return std::to_string(count);
  return fmt::format("{},{:03}", formatCount(count / 1000), count % 1000);
}

CLI::Option* addTemporaryOption(CLI::App& command, std::string& directory) {
  return command
      .add_option("--temp", directory,
                  "Directory of temporary files (default: SLURM_TMPDIR, TMPDIR, beside the output)")
      ->type_name("DIRECTORY");
}

std::string jsonText(const nlohmann::json& json) {
  return json.dump(2, ' ', true, nlohmann::json::error_handler_t::replace);
}

std::string formatPhases(const PhaseSeconds& phases) {
  std::string text;
  for (const auto& [phase, seconds] : phases) {
    text += fmt::format("{}{} {:.1f} s", text.empty() ? "" : ", ", phase, seconds);
  }
  return text;
}

nlohmann::json jsonOfPhases(const PhaseSeconds& phases) {
  nlohmann::json json = nlohmann::json::object();
  for (const auto& [phase, seconds] : phases) json[phase] = seconds;
  return json;
}

int exitStatus(StatusCode code) {
  switch (code) {
    case StatusCode::kOk:
      return 0;
    case StatusCode::kInvalidArgument:
      return 2;
    case StatusCode::kCorruption:
      return 3;
    case StatusCode::kBudgetTooSmall:
      return 33;
    case StatusCode::kIoError:
      return 74;
    case StatusCode::kInterrupted:
      return 130;
    case StatusCode::kIncomplete:
      return 75;
    case StatusCode::kFailed:
      return 1;
  }
  return 1;
}

}  // namespace surfeit
