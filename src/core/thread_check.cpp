#include "core/thread_check.h"

#include <fmt/format.h>

#include <algorithm>
#include <atomic>
#include <latch>
#include <stdexcept>
#include <system_error>
#include <thread>
#include <vector>

namespace surfeit {
namespace {

// TBB keeps the threads that it has started.
std::atomic<int> most_started{1};

}  // namespace

void requireThreads(int threads) {
  if (threads <= most_started) return;
  std::latch all_started(1);
  std::vector<std::jthread> others;
  others.reserve(static_cast<std::size_t>(threads));
  try {
    for (int i = 1; i < threads; ++i) others.emplace_back([&] { all_started.wait(); });
  } catch (const std::system_error& error) {
    all_started.count_down();
    throw std::runtime_error(fmt::format(
        "cannot start {} threads, only {}: {}: give fewer --threads, or raise the limit "
        "of processes (ulimit -u)",
        threads, others.size() + 1, error.code().message()));
  }
  all_started.count_down();
  int before = most_started;
  while (before < threads && !most_started.compare_exchange_weak(before, threads)) {
  }
}

}  // namespace surfeit
