// How long-running work reports its progress, and learns that it should stop.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>

#include "surfeit/api.h"

namespace surfeit {

// Implement it to show progress or to cancel. All calls may come from any thread.
class SURFEIT_API Progress {
 public:
  virtual ~Progress() = default;

  // A new phase begins; `total` counts `unit`s ("surfels", "receivers", "bytes"), 0 when unknown.
  virtual void beginPhase(std::string_view name, std::uint64_t total, std::string_view unit) {
    (void)name, (void)total, (void)unit;
  }
  // `count` more units of the phase are done.
  virtual void advance(std::uint64_t count) { (void)count; }
  // `count` bytes were read from or written to files, for rates only.
  virtual void advanceBytes(std::uint64_t count) { (void)count; }

  // Reports data that was guessed, dropped, narrowed, ignored or left dark: what, how many, and
  // what to do about it. Each rule is reported once. `--strict` turns a note into an error.
  virtual void note(const std::string& message) { (void)message; }
  // Reports a fact of interest; no data is lost.
  virtual void inform(const std::string& message) { (void)message; }

  // Polled often; true makes the work stop with Status::interrupted() and leave nothing behind.
  virtual bool isCancelled() const { return false; }
};

}  // namespace surfeit
