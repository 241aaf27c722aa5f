// How long something has taken.
#pragma once

#include <chrono>

namespace surfeit {

inline double secondsSince(std::chrono::steady_clock::time_point begin) {
  return std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
}

}  // namespace surfeit
