// Status and Result: how every function of the library reports failures of the world outside. The
// library never prints, throws across its border, exits or aborts because of input.
#pragma once

#include <cstdint>
#include <new>
#include <optional>
#include <string>
#include <type_traits>
#include <utility>

namespace surfeit {

// Kinds of failures; the program maps each kind to an exit status (docs/architecture.md).
enum class StatusCode : std::uint8_t {
  kOk = 0,
  kInvalidArgument,  // an option or a call that cannot work; exit status 2
  kCorruption,       // bytes that break the rules of the format; exit status 3
  kBudgetTooSmall,   // the memory budget cannot hold the work; exit status 33
  kIoError,          // the system refused to open, read, write, sync or rename; exit status 74
  kInterrupted,      // the caller asked to stop; exit status 130
  kIncomplete,       // other parts of the job must be done first; exit status 75
  kFailed,           // anything else; exit status 1
};

// A code and a message of one line: what, where, found and expected. Immutable.
class [[nodiscard]] Status {
 public:
  Status() = default;
  Status(StatusCode code, std::string message) : code_(code), message_(std::move(message)) {}

  static Status invalidArgument(std::string message) {
    return {StatusCode::kInvalidArgument, std::move(message)};
  }
  static Status corruption(std::string message) {
    return {StatusCode::kCorruption, std::move(message)};
  }
  static Status budgetTooSmall(std::string message) {
    return {StatusCode::kBudgetTooSmall, std::move(message)};
  }
  static Status ioError(std::string message) { return {StatusCode::kIoError, std::move(message)}; }
  static Status interrupted() { return {StatusCode::kInterrupted, "interrupted"}; }
  static Status incomplete(std::string message) {
    return {StatusCode::kIncomplete, std::move(message)};
  }
  static Status failed(std::string message) { return {StatusCode::kFailed, std::move(message)}; }

  bool ok() const { return code_ == StatusCode::kOk; }
  StatusCode code() const { return code_; }
  const std::string& message() const { return message_; }

 private:
  StatusCode code_ = StatusCode::kOk;
  std::string message_;
};

// A value, or the Status that says why there is none. value() requires ok().
template <typename T>
class [[nodiscard]] Result {
 public:
  Result(T value) : value_(std::move(value)) {}          // NOLINT: implicit on purpose
  Result(Status status) : status_(std::move(status)) {}  // NOLINT: implicit on purpose

  bool ok() const { return value_.has_value(); }
  const Status& status() const { return status_; }
  T& value() { return *value_; }
  const T& value() const { return *value_; }
  T& operator*() { return *value_; }
  const T& operator*() const { return *value_; }
  T* operator->() { return &*value_; }
  const T* operator->() const { return &*value_; }

 private:
  Status status_;
  std::optional<T> value_;
};

}  // namespace surfeit

#define SURFEIT_CONCAT_INNER(a, b) a##b
#define SURFEIT_CONCAT(a, b) SURFEIT_CONCAT_INNER(a, b)

// Returns the Status of `expression` from the enclosing function unless it is ok.
#define SURFEIT_RETURN_IF_ERROR(expression)          \
  do {                                               \
    ::surfeit::Status surfeit_status = (expression); \
    if (!surfeit_status.ok()) return surfeit_status; \
  } while (false)

// Declares `target` with the value of the Result `expression`, or returns its Status.
#define SURFEIT_ASSIGN_OR_RETURN(target, expression) \
  SURFEIT_ASSIGN_OR_RETURN_IMPL(SURFEIT_CONCAT(surfeit_result_, __LINE__), target, expression)
#define SURFEIT_ASSIGN_OR_RETURN_IMPL(result, target, expression) \
  auto result = (expression);                                     \
  if (!result.ok()) return result.status();                       \
  target = std::move(*result)
