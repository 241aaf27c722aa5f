#include "errors.h"

#include <cstring>
#include <string_view>

namespace surfeit::python {
namespace {

// Linux knows 133 numbers.
constexpr int kLastErrno = 133;

// The library ends a message with the system's words for an errno. 0: these are none.
int errnoOf(std::string_view message) {
  int found = 0;
  std::size_t longest = 0;
  for (int number = 1; number <= kLastErrno; ++number) {
    const std::string_view words = std::strerror(number);
    const bool ends =
        message.size() > words.size() + 2 && message.substr(message.size() - words.size()) == words;
    if (!ends || words.size() <= longest) continue;
    found = number;
    longest = words.size();
  }
  return found;
}

[[noreturn]] void raiseAs(PyObject* type, const std::string& message) {
  PyErr_SetString(type, message.c_str());
  throw py::error_already_set();
}

// A message begins with the path: "city.sft: cannot open: No such file or directory".
[[noreturn]] void raiseOsError(const std::string& message) {
  const int number = errnoOf(message);
  const std::size_t colon = message.find(": ");
  if (number == 0 || colon == std::string::npos) raiseAs(PyExc_OSError, message);
  const py::tuple arguments =
      py::make_tuple(number, message.substr(colon + 2), message.substr(0, colon));
  PyErr_SetObject(PyExc_OSError, arguments.ptr());
  throw py::error_already_set();
}

}  // namespace

void raise(const Status& status) {
  const std::string& message = status.message();
  switch (status.code()) {
    case StatusCode::kInvalidArgument:
      raiseAs(PyExc_ValueError, message);
    case StatusCode::kIoError:
      raiseOsError(message);
    case StatusCode::kCorruption:
      raiseAs(py::module_::import("surfeit._errors").attr("DamagedFile").ptr(), message);
    case StatusCode::kBudgetTooSmall:
      raiseAs(PyExc_MemoryError, message);
    case StatusCode::kInterrupted:
      raiseAs(PyExc_KeyboardInterrupt, message);
    case StatusCode::kIncomplete:
      raiseAs(py::module_::import("surfeit._errors").attr("Incomplete").ptr(), message);
    case StatusCode::kOk:
    case StatusCode::kFailed:
      break;
  }
  const bool lacks_memory = message.find("out of memory") != std::string::npos;
  raiseAs(lacks_memory ? PyExc_MemoryError : PyExc_RuntimeError, message);
}

}  // namespace surfeit::python
