// Progress for people and farms: a bar with rate and time left on a terminal, whole percents, JSON
// lines, or nothing.
#pragma once

#include <atomic>
#include <chrono>
#include <cstdint>
#include <mutex>
#include <optional>
#include <string>
#include <string_view>

#include "surfeit/progress.h"
#include "tools/frames.h"

namespace surfeit {

// Safe from any thread.
class ConsoleProgress : public Progress {
 public:
  enum class Style : std::uint8_t { kNone, kBar, kPercent, kJson };

  // SIGINT and SIGTERM cancel from now on; a second one ends the program at once.
  // With `verbose` every phase is told as it begins.
  // With `strict` the first note ends the work: it is cancelled, and refused() has the note.
  // With `frame` every line says which frame of a sequence it is about.
  ConsoleProgress(Style style, bool quiet, bool verbose, bool strict,
                  const std::optional<SequenceFrame>& frame = {});
  ~ConsoleProgress() override;

  void beginPhase(std::string_view name, std::uint64_t total, std::string_view unit) override;
  void advance(std::uint64_t count) override;
  void advanceBytes(std::uint64_t count) override { bytes_ += count; }
  void note(const std::string& message) override;
  void inform(const std::string& message) override;
  bool isCancelled() const override;

  // Removes the bar, so that other text may follow.
  void clear();
  // The note that ended the work; empty when none did. When the work is over.
  const std::string& refused() const { return refused_; }
  // The signal that cancelled, 0 when none did.
  static int cancelSignal();

 private:
  void draw();

  const Style style_;
  const bool quiet_;
  const bool verbose_;
  const bool strict_;
  const std::optional<SequenceFrame> frame_;
  std::atomic<bool> is_refused_{false};
  std::mutex mutex_;  // guards what is below, but not the atomic ones
  std::string phase_, unit_, refused_;
  std::uint64_t total_ = 0;
  int last_percent_ = -1;
  bool bar_shown_ = false;
  std::chrono::steady_clock::time_point phase_start_;
  std::atomic<std::uint64_t> done_{0}, bytes_{0};
  std::atomic<std::int64_t> next_draw_ns_{0};
};

}  // namespace surfeit
