// The budget of steps that hold what they read, whatever that takes: meshes. What they will need
// shows only as they go.
#pragma once

#include <cstdint>
#include <string>

#include "surfeit/status.h"

namespace surfeit {

// From now on such steps refuse to take this process beyond so many bytes; 0, as at first: no
// limit. Called by the program as a command begins.
void limitResidentBytes(std::uint64_t bytes);

// kBudgetTooSmall when this process would have more than the limit with `more_bytes` more. The
// message names what would do: when `part` (above 0, at most 1) of what a step holds is there, the
// rest takes as much again and `times` as much as all of it is taken in the end. Safe from any
// thread; costs a few microseconds.
Status checkResidentBytes(const std::string& what, std::uint64_t more_bytes, double part = 1,
                          double times = 1);

// Between two jobs in one process: gives back what the first one freed. What is left of it is not
// taken for the beginning of what a step of the second one holds.
void beginResidentStep();

// What this process has, and how much more the limit lets it take: all that there is without one.
struct ResidentRoom {
  std::uint64_t resident_bytes = 0, free_bytes = 0;
};
ResidentRoom residentRoom();

}  // namespace surfeit
