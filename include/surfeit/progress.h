// How long-running work tells its caller where it stands, and learns that it should stop.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>

#include "surfeit/api.h"

namespace surfeit {

// Implement to show progress or to cancel. All calls may come from any thread.
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

  // What was guessed, dropped, narrowed, ignored or left dark, how many, and what to do: the user
  // reads it once, and may want such a thing to be an error (`--strict`).
  virtual void note(const std::string& message) { (void)message; }
  // What the user may like to know: nothing is lost by it.
  virtual void inform(const std::string& message) { (void)message; }

  // Polled often; true makes the work stop with Status::interrupted() and leave nothing behind.
  virtual bool isCancelled() const { return false; }
};

}  // namespace surfeit
