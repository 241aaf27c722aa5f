// Objects that are used again and again, so that the memory they hold is not touched for the first
// time each time: fresh memory is dearer than the disk.
#pragma once

#include <cstddef>
#include <memory>
#include <mutex>
#include <utility>
#include <vector>

namespace surfeit {

// Hands out objects that come back when their last owner lets go, whichever thread that is; they
// may outlive the recycler. What they held stays in them. Safe from any thread.
template <typename T>
class Recycler {
 public:
  std::shared_ptr<T> take() {
    std::unique_ptr<T> object;
    {
      const std::lock_guard lock(free_->mutex);
      if (!free_->objects.empty()) {
        object = std::move(free_->objects.back());
        free_->objects.pop_back();
      }
    }
    if (object == nullptr) object = std::make_unique<T>();
    return std::shared_ptr<T>(object.release(), [free = free_](T* returned) {
      std::unique_ptr<T> owned(returned);
      const std::lock_guard lock(free->mutex);
      // Kept where there is room for it: a deleter may not throw
      if (free->objects.size() < free->objects.capacity())
        free->objects.push_back(std::move(owned));
    });
  }

 private:
  static constexpr std::size_t kMostKept = 1024;
  struct Free {
    Free() { objects.reserve(kMostKept); }
    std::mutex mutex;
    std::vector<std::unique_ptr<T>> objects;
  };
  std::shared_ptr<Free> free_ = std::make_shared<Free>();
};

}  // namespace surfeit
