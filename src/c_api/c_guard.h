// What all C functions do: nothing is thrown out of them, the text of a failure is kept, and
// structs of other versions are read as far as they go.
#pragma once

#include <cstddef>
#include <cstdint>
#include <cstring>
#include <exception>
#include <new>
#include <string>

#include "surfeit/status.h"
#include "surfeit/surfeit.h"

namespace surfeit {

// Of the last failure in this thread.
const char* lastErrorText();
void setLastError(const char* text);

surfeit_code codeOf(StatusCode code);

// Runs what a function does, and keeps the text of a failure.
template <typename Work>
surfeit_code guard(Work&& work) noexcept {
  try {
    const Status status = work();
    if (!status.ok()) setLastError(status.message().c_str());
    return codeOf(status.code());
  } catch (const std::bad_alloc&) {
    setLastError("out of memory");
  } catch (const std::exception& exception) {
    setLastError(exception.what());
  }
  return SURFEIT_FAILED;
}

inline Status missing(const char* what) {
  return Status::invalidArgument(std::string(what) + " is NULL, expected one");
}

// What a caller filled in, in the form of today: members that an older caller does not have are as
// init makes them.
template <typename Options>
Status readOptions(const Options* given, const char* name, Options& options) {
  if (given == nullptr) return {};
  if (given->size < sizeof(std::size_t) || given->size > sizeof(Options)) {
    return Status::invalidArgument(std::string(name) + ".size is " + std::to_string(given->size) +
                                   ", expected " + std::to_string(sizeof(Options)) +
                                   ": use its init function");
  }
  std::memcpy(&options, given, given->size);
  options.size = sizeof(Options);
  return {};
}

// Fills in as much of a struct as the caller has room for.
template <typename Report>
Status writeReport(Report report, const char* name, Report* target) {
  if (target == nullptr) return missing(name);
  if (target->size < sizeof(std::size_t) || target->size > sizeof(Report)) {
    return Status::invalidArgument(std::string(name) + ".size is " + std::to_string(target->size) +
                                   ", expected " + std::to_string(sizeof(Report)));
  }
  report.size = target->size;
  std::memcpy(target, &report, target->size);
  return {};
}

template <typename Enum>
Status readEnum(std::int32_t value, Enum last, const char* name, Enum& result) {
  if (value < 0 || value > std::int32_t(last)) {
    return Status::invalidArgument(std::string(name) + " is " + std::to_string(value) +
                                   ", expected 0 to " + std::to_string(std::int32_t(last)));
  }
  result = Enum(value);
  return {};
}

}  // namespace surfeit
