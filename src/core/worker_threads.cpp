#include "core/worker_threads.h"

#include <fmt/format.h>

#include <cstddef>
#include <exception>
#include <new>
#include <system_error>
#include <thread>
#include <vector>

namespace surfeit {

Status catchAll(const char* doing, const std::function<Status()>& work) noexcept {
  try {
    try {
      return work();
    } catch (const std::bad_alloc&) {
      throw;
    } catch (const std::exception& exception) {
      return Status::failed(fmt::format("cannot {}: {}", doing, exception.what()));
    }
  } catch (...) {
    return Status::failed("out of memory");  // so short a text takes none
  }
}

Status runOnThreads(int threads, FirstFailure& failure, const char* doing,
                    const std::function<Status()>& work) {
  const auto workOrNote = [&] { failure.note(catchAll(doing, work)); };
  {
    std::vector<std::jthread> others;
    try {
      others.reserve(static_cast<std::size_t>(threads));
      for (int i = 1; i < threads; ++i) others.emplace_back(workOrNote);
    } catch (const std::system_error& error) {
      failure.note(Status::failed(fmt::format("cannot start a thread: {}", error.what())));
    } catch (const std::bad_alloc&) {
      failure.note(Status::failed("out of memory"));  // which ends those that have begun
    }
    workOrNote();
  }  // all threads have ended
  return failure.status();
}

}  // namespace surfeit
