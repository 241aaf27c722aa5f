// The border of the library: nothing is thrown across it.
#pragma once

#include <exception>
#include <new>
#include <string>
#include <utility>

#include "surfeit/status.h"

namespace surfeit {

// A kFailed of both texts; of a short one alone, which takes none, when there is no memory for it.
inline Status failedAt(const std::string& subject, const char* what) noexcept {
  try {
    return Status::failed(subject + ": " + what);
  } catch (const std::exception&) {
    return Status::failed("out of memory");
  }
}

// What `work` returns, a Status or a Result; what it throws becomes a kFailed that begins with
// `subject`, a path for example.
template <typename Work>
auto guarded(const std::string& subject, Work&& work) -> decltype(work()) {
  try {
    return std::forward<Work>(work)();
  } catch (const std::bad_alloc&) {
    return failedAt(subject, "out of memory");
  } catch (const std::exception& exception) {
    return failedAt(subject, exception.what());
  }
}

}  // namespace surfeit
