// The border of the library: nothing is thrown across it.
#pragma once

#include <exception>
#include <new>
#include <string>
#include <utility>

#include "surfeit/status.h"

namespace surfeit {

// What `work` returns, a Status or a Result; what it throws becomes a kFailed that begins with
// `subject`, a path for example.
template <typename Work>
auto guarded(const std::string& subject, Work&& work) -> decltype(work()) {
  try {
    return std::forward<Work>(work)();
  } catch (const std::bad_alloc&) {
    return Status::failed(subject + ": out of memory");
  } catch (const std::exception& exception) {
    return Status::failed(subject + ": " + exception.what());
  }
}

}  // namespace surfeit
