#include "tools/console_progress.h"

#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <csignal>
#include <nlohmann/json.hpp>

#include "surfeit/process.h"
#include "tools/console.h"

namespace surfeit {
namespace {

constexpr std::int64_t kDrawIntervalNs = 200'000'000;

volatile std::sig_atomic_t g_cancel_signal = 0;

extern "C" void onCancelSignal(int signal) {
  if (g_cancel_signal != 0) _exit(128 + signal);
  g_cancel_signal = signal;
}

std::int64_t nowNs() {
  return std::chrono::steady_clock::now().time_since_epoch() / std::chrono::nanoseconds(1);
}

// "1.2 M/s"
std::string formatRate(double per_second) {
  if (per_second >= 1e6) return fmt::format("{:.1f} M/s", per_second / 1e6);
  if (per_second >= 1e3) return fmt::format("{:.1f} k/s", per_second / 1e3);
  return fmt::format("{:.1f} /s", per_second);
}

std::string formatSeconds(double seconds) {
  const auto whole = static_cast<std::uint64_t>(std::max(seconds, 0.0));
  return whole < 60 ? fmt::format("{} s", whole)
                    : fmt::format("{}:{:02}:{:02}", whole / 3600, whole / 60 % 60, whole % 60);
}

}  // namespace

ConsoleProgress::ConsoleProgress(Style style, bool quiet, bool verbose, bool strict,
                                 const std::optional<SequenceFrame>& frame)
    : style_(style), quiet_(quiet), verbose_(verbose), strict_(strict), frame_(frame) {
  struct sigaction action {};
  action.sa_handler = onCancelSignal;
  sigaction(SIGINT, &action, nullptr);
  sigaction(SIGTERM, &action, nullptr);
  setProcessCancelled([] { return g_cancel_signal != 0; });
}

ConsoleProgress::~ConsoleProgress() { clear(); }

int ConsoleProgress::cancelSignal() { return g_cancel_signal; }
bool ConsoleProgress::isCancelled() const { return g_cancel_signal != 0 || is_refused_; }

void ConsoleProgress::beginPhase(std::string_view name, std::uint64_t total,
                                 std::string_view unit) {
  if (verbose_) inform(fmt::format("phase {}: {} {}", name, total, unit));
  const std::lock_guard lock(mutex_);
  phase_ = name;
  unit_ = unit;
  total_ = total;
  done_ = 0;
  bytes_ = 0;
  last_percent_ = -1;
  phase_start_ = std::chrono::steady_clock::now();
  next_draw_ns_ = nowNs() + kDrawIntervalNs;
}

void ConsoleProgress::advance(std::uint64_t count) {
  done_ += count;
  if (style_ == Style::kNone) return;
  std::int64_t due = next_draw_ns_;
  const std::int64_t now = nowNs();
  // One thread draws, the others go on
  if (now < due || !next_draw_ns_.compare_exchange_strong(due, now + kDrawIntervalNs)) return;
  const std::lock_guard lock(mutex_);
  draw();
}

void ConsoleProgress::draw() {
  const std::uint64_t done = done_;
  const double seconds =
      std::chrono::duration<double>(std::chrono::steady_clock::now() - phase_start_).count();
  const double rate = seconds > 0 ? double(done) / seconds : 0;
  const double part = total_ > 0 ? std::min(1.0, double(done) / double(total_)) : 0;
  const double left = rate > 0 && total_ > done ? double(total_ - done) / rate : 0;
  const double byte_rate = seconds > 0 ? double(bytes_) / seconds : 0;
  const std::string bytes = byte_rate > 0 ? fmt::format(" {:.0f} MB/s", byte_rate / 1e6) : "";
  const int percent = static_cast<int>(part * 100);
  const std::string frame = frame_ ? frame_->label() + " " : "";
  if (style_ == Style::kBar) {
    const auto filled = static_cast<std::size_t>(part * 30);
    tellRaw(fmt::format("\r\x1b[K{}{:>8} [{}{}] {:3}%  {} {}{}  {} left", frame, phase_,
                        std::string(filled, '#'), std::string(30 - filled, '.'), percent,
                        formatRate(rate), unit_, bytes, formatSeconds(left)));
    bar_shown_ = true;
  } else if (style_ == Style::kPercent) {
    if (percent == last_percent_) return;
    tell(fmt::format("{}{} {}% {} {}{}, {} left\n", frame, phase_, percent, formatRate(rate), unit_,
                     bytes, formatSeconds(left)));
  } else if (style_ == Style::kJson) {
    nlohmann::json line = {{"phase", phase_},     {"done", done},
                           {"total", total_},     {"unit", unit_},
                           {"per_second", rate},  {"bytes_per_second", byte_rate},
                           {"seconds_left", left}};
    if (frame_) {
      line["frame"] = frame_->number;
      line["frame_index"] = frame_->index;
      line["frame_count"] = frame_->count;
    }
    tell(line.dump() + "\n");
  }
  last_percent_ = percent;
}

void ConsoleProgress::note(const std::string& message) {
  if (!strict_) return inform(message);
  const std::lock_guard lock(mutex_);
  if (!is_refused_) refused_ = message;
  is_refused_ = true;
}

void ConsoleProgress::inform(const std::string& message) {
  if (quiet_) return;
  clear();
  tell(frame_ ? fmt::format("surfeit: frame {}: {}\n", frame_->number, message)
              : fmt::format("surfeit: {}\n", message));
}

void ConsoleProgress::clear() {
  const std::lock_guard lock(mutex_);
  if (bar_shown_) tellRaw("\r\x1b[K");
  bar_shown_ = false;
}

}  // namespace surfeit
