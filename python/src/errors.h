// Failures of the library as exceptions of Python, with the library's own messages.
#pragma once

#include <pybind11/pybind11.h>

#include <string>
#include <utility>

#include "surfeit/status.h"

namespace surfeit::python {

namespace py = pybind11;

// Raises what a failure stands for: ValueError (an argument), OSError with errno and filename where
// the message has them, DamagedFile, MemoryError (a budget), KeyboardInterrupt, Incomplete
// (shards), else RuntimeError. Needs the GIL.
[[noreturn]] void raise(const Status& status);

inline void check(const Status& status) {
  if (!status.ok()) raise(status);
}

template <typename T>
T valueOf(Result<T> result) {
  check(result.status());
  return std::move(*result);
}

}  // namespace surfeit::python
