// A progress without notes and other words, for runs inside a run: their advice is not for the
// user.
#pragma once

#include <cstdint>
#include <string_view>

#include "surfeit/progress.h"

namespace surfeit {

class QuietProgress : public Progress {
 public:
  explicit QuietProgress(Progress& progress) : progress_(progress) {}
  void beginPhase(std::string_view name, std::uint64_t total, std::string_view unit) override {
    progress_.beginPhase(name, total, unit);
  }
  void advance(std::uint64_t count) override { progress_.advance(count); }
  void advanceBytes(std::uint64_t count) override { progress_.advanceBytes(count); }
  bool isCancelled() const override { return progress_.isCancelled(); }

 private:
  Progress& progress_;
};

}  // namespace surfeit
