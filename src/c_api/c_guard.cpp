#include "c_api/c_guard.h"

#include <algorithm>
#include <array>

namespace surfeit {
namespace {

// Room for a message, so that to keep one takes no memory that may be missing.
struct LastError {
  std::array<char, 1024> text{};
  void set(const char* message) {
    const std::size_t length = std::min(std::strlen(message), text.size() - 1);
    std::memcpy(text.data(), message, length);
    text[length] = '\0';
  }
};
LastError& lastError() {
  thread_local LastError error;
  return error;
}

}  // namespace

const char* lastErrorText() { return lastError().text.data(); }
void setLastError(const char* text) { lastError().set(text); }

surfeit_code codeOf(StatusCode code) {
  switch (code) {
    case StatusCode::kOk:
      return SURFEIT_OK;
    case StatusCode::kInvalidArgument:
      return SURFEIT_INVALID_ARGUMENT;
    case StatusCode::kCorruption:
      return SURFEIT_CORRUPTION;
    case StatusCode::kBudgetTooSmall:
      return SURFEIT_BUDGET_TOO_SMALL;
    case StatusCode::kIoError:
      return SURFEIT_IO_ERROR;
    case StatusCode::kInterrupted:
      return SURFEIT_INTERRUPTED;
    case StatusCode::kIncomplete:  // no call of this interface does parts of a job
    case StatusCode::kFailed:
      break;
  }
  return SURFEIT_FAILED;
}

}  // namespace surfeit
