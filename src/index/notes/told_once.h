// Where a cloud is read several times.
#pragma once

#include <cstdint>
#include <mutex>
#include <set>
#include <string>
#include <string_view>

#include "surfeit/progress.h"

namespace surfeit {

// Passes everything on, but each note only once. As safe as the progress that it passes to, which
// outlives it.
class ToldOnce final : public Progress {
 public:
  explicit ToldOnce(Progress& progress) : progress_(progress) {}

  void beginPhase(std::string_view name, std::uint64_t total, std::string_view unit) override {
    progress_.beginPhase(name, total, unit);
  }
  void advance(std::uint64_t count) override { progress_.advance(count); }
  void advanceBytes(std::uint64_t count) override { progress_.advanceBytes(count); }
  void note(const std::string& message) override {
    {
      const std::lock_guard lock(mutex_);
      if (!told_.insert(message).second) return;
    }
    progress_.note(message);
  }
  void inform(const std::string& message) override { progress_.inform(message); }
  bool isCancelled() const override { return progress_.isCancelled(); }

 private:
  Progress& progress_;
  std::mutex mutex_;  // guards what is below
  std::set<std::string> told_;
};

}  // namespace surfeit
