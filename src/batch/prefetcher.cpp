#include "batch/prefetcher.h"

#include <exception>
#include <memory>
#include <optional>
#include <system_error>

#include "gather/cut/cut.h"

namespace surfeit {
Prefetcher::Prefetcher(PagedOctree& octree, ReceiverQueue& queue,
                       const PagingController& controller, const GatherRules& rules, int threads)
    : octree_(octree), queue_(queue), controller_(controller), rules_(rules) {
  try {
    for (int i = 0; i < threads; ++i) threads_.emplace_back([this] { work(); });
  } catch (const std::system_error&) {
    // The gather needs none
  }
}

Prefetcher::~Prefetcher() {
  {
    const std::lock_guard lock(mutex_);
    ends_ = true;
  }
  changed_.notify_all();
}  // the threads join

void Prefetcher::notify() {
  if (controller_.prefetchReceivers() == 0) return;
  {
    const std::lock_guard lock(mutex_);
    ++moves_;
  }
  changed_.notify_all();
}

// Nothing that goes wrong here is an error of the gather: where it needs the page, it will meet the
// same.
void Prefetcher::work() {
  try {
    PagedOctree::Reader reader(octree_, CacheFront::Role::kPrefetch);
    const auto cut = std::make_unique<CutWalk>(rules_);
    std::unique_lock lock(mutex_);
    while (!ends_) {
      const std::uint64_t moves = moves_;
      lock.unlock();
      const std::optional<LocalReceiver> receiver =
          queue_.lookAhead(controller_.prefetchReceivers(), kStride);
      bool failed = false;
      if (receiver)
        failed =
            !cut->walk(viewPacket({&*receiver, 1}, rules_), {&*receiver, 1}, reader, IgnoreCut{})
                 .ok();
      if (!receiver) reader.release();
      lock.lock();
      if (failed) return;
      if (!receiver) changed_.wait(lock, [&] { return ends_ || moves_ != moves; });
    }
  } catch (const std::exception&) {
  }
}

}  // namespace surfeit
