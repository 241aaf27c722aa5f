#include "batch/prefetcher.h"

#include <exception>
#include <memory>
#include <optional>
#include <span>
#include <system_error>

#include "gather/cut/cut.h"

namespace surfeit {

Prefetcher::Prefetcher(const World& world, ReceiverQueue& queue, const PagingController& controller,
                       int threads)
    : world_(world), queue_(queue), controller_(controller) {
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
    // One slot: it has no use for a page but to see it loaded
    PagedOctree::Reader reader(*world_.engine().caches, 1, CacheFront::Role::kPrefetch);
    reader.use(*world_.octrees().front());
    const auto cut = std::make_unique<CutWalk>(world_.rules());
    std::unique_lock lock(mutex_);
    while (!ends_) {
      const std::uint64_t moves = moves_;
      lock.unlock();
      const std::optional<LocalReceiver> receiver =
          queue_.lookAhead(controller_.prefetchReceivers(), kStride);
      bool failed = false;
      if (receiver) {
        const std::span<const LocalReceiver> one(&*receiver, 1);
        failed = !cut->walk(viewPacket(one, world_.rules()), one, reader, IgnoreCut{}).ok();
      } else {
        reader.release();
      }
      lock.lock();
      if (failed) return;
      if (!receiver) changed_.wait(lock, [&] { return ends_ || moves_ != moves; });
    }
  } catch (const std::exception&) {
  }
}

}  // namespace surfeit
