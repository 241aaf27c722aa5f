// Long calls into the library. The work runs on a thread of its own without the GIL. The thread
// that calls looks up twenty times a second, for signals and to tell Python of the progress: only
// there does Python handle Ctrl-C.
#pragma once

#include <pybind11/pybind11.h>

#include <functional>
#include <optional>
#include <utility>

#include "errors.h"
#include "surfeit/progress.h"
#include "surfeit/status.h"

namespace surfeit::python {

// Runs `work` to its end. `watcher` is a surfeit._watch.Watcher, or None. What it raises, and what
// a signal raises, stops the work and is raised here when the work has ended. Needs the GIL, which
// other threads of Python have meanwhile.
void run(const py::object& watcher, const std::function<Status(Progress&)>& work);

// The same for work with a value.
template <typename T>
T runFor(const py::object& watcher, const std::function<Result<T>(Progress&)>& work) {
  std::optional<T> value;
  run(watcher, [&](Progress& progress) -> Status {
    Result<T> result = work(progress);
    if (result.ok()) value.emplace(std::move(*result));
    return result.status();
  });
  return std::move(*value);
}

}  // namespace surfeit::python
