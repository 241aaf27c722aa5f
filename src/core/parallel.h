// Work for the threads of TBB. The thread sanitizer can check it: Debian's TBB is not built with
// it, so that it sees nothing of what TBB orders; here it is told, and TBB's own headers are
// compiled without it (tbb_tasks.cpp).
#pragma once

#include <tbb/parallel_sort.h>

#include <algorithm>
#include <cstddef>
#include <functional>
#include <optional>
#include <span>

namespace surfeit {

// Calls `work` in an arena of `threads` threads, more than there are processors if that is what is
// asked for: what it calls below uses these. Exceptions of the work arrive here, as below.
void withThreads(int threads, const std::function<void()>& work);

// body(i) for all i below `count`, in any order, by the threads of the arena.
void parallelFor(std::size_t count, const std::function<void(std::size_t)>& body);

// Sorts by `less`. Under the thread sanitizer on one thread: what happens inside is TBB's affair.
template <typename Iterator, typename Less>
void parallelSort(Iterator begin, Iterator end, const Less& less) {
#ifdef __SANITIZE_THREAD__
  std::sort(begin, end, less);
#else
  tbb::parallel_sort(begin, end, less);
#endif
}

// A stage that items pass: one after the other in the order of the source, or several at once.
struct PipelineStage {
  enum class Mode { kInOrder, kParallel };
  Mode mode;
  std::function<void(std::size_t item)> work;
};

// Passes items through stages by the threads of the arena, at most `most` of them at a time. Items
// are numbers below `most`, which the source, called by one thread at a time, hands out; it ends
// with nothing. A number may come again when the last stage is done with the item. After an
// exception, which arrives here, items under way pass no further stages.
void runPipeline(std::size_t most, const std::function<std::optional<std::size_t>()>& source,
                 std::span<const PipelineStage> stages);

}  // namespace surfeit
