// Seconds by phase of the indexer.
#pragma once

#include <chrono>

#include "surfeit/index.h"

namespace surfeit {

// From construction on: finish() ends a phase, and the next one begins.
class PhaseClock {
 public:
  explicit PhaseClock(IndexStats& stats) : stats_(stats) {}
  void finish(const char* phase) {
    const auto now = std::chrono::steady_clock::now();
    stats_.phase_seconds.emplace_back(phase, std::chrono::duration<double>(now - last_).count());
    last_ = now;
  }

 private:
  IndexStats& stats_;
  std::chrono::steady_clock::time_point last_ = std::chrono::steady_clock::now();
};

}  // namespace surfeit
