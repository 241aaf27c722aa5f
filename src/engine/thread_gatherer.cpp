#include "engine/thread_gatherer.h"

#include <utility>

namespace surfeit {

ThreadGatherer::ThreadGatherer(std::shared_ptr<const World> world)
    : world_(std::move(world)),
      reader_(*world_->engine().caches, world_->engine().frontSlots()),
      view_(world_->instances() != nullptr
                ? WorldReader(reader_, *world_->instances(), world_->octrees())
                : WorldReader(reader_)),
      gatherer_(world_->rules()) {
  if (world_->instances() == nullptr) reader_.use(*world_->octrees().front());
}

}  // namespace surfeit
