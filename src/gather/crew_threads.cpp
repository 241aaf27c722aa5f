#include "gather/crew_threads.h"

#include <fmt/format.h>

#include <cstddef>
#include <exception>
#include <new>
#include <system_error>
#include <thread>
#include <vector>

namespace surfeit {

Status runOnThreads(int threads, FirstFailure& failure, const std::function<Status()>& work) {
  // What is thrown ends here: past the border of a thread it would end the process
  const auto workOrNote = [&] {
    try {
      failure.note(work());
    } catch (const std::bad_alloc&) {
      failure.note(Status::failed("out of memory"));
    } catch (const std::exception& exception) {
      failure.note(Status::failed(fmt::format("cannot gather: {}", exception.what())));
    }
  };
  {
    std::vector<std::jthread> others;
    try {
      others.reserve(static_cast<std::size_t>(threads));
      for (int i = 1; i < threads; ++i) others.emplace_back(workOrNote);
    } catch (const std::system_error& error) {
      failure.note(Status::failed(fmt::format("cannot start a thread: {}", error.what())));
    }
    workOrNote();
  }  // all threads have ended
  return failure.status();
}

}  // namespace surfeit
