// What benches do with failures: tell them and end.
#pragma once

#include <fmt/format.h>

#include <cstdio>
#include <cstdlib>
#include <utility>

#include "surfeit/status.h"

namespace surfeit {

inline void need(const Status& status) {
  if (status.ok()) return;
  fmt::print(stderr, "{}\n", status.message());
  std::exit(1);
}

// The value, or the end of the program.
template <typename T>
T take(Result<T> result) {
  if (!result.ok()) need(result.status());
  return std::move(*result);
}

}  // namespace surfeit
