#include "core/thread_scratch.h"

#include <pthread.h>

namespace surfeit::thread_scratch {
namespace {

void destroyAll(void* first) {
  for (Held* held = static_cast<Held*>(first); held != nullptr;) {
    delete std::exchange(held, held->next);
  }
}

// A list per thread; one of the first keys of a process has its room in every thread.
struct ThreadList {
  ThreadList() : is_there(pthread_key_create(&key, destroyAll) == 0) {}
  pthread_key_t key{};
  const bool is_there;
};

}  // namespace

void hold(std::unique_ptr<Held> held) {
  static const ThreadList list;
  if (!list.is_there) throw std::bad_alloc();
  held->next = static_cast<Held*>(pthread_getspecific(list.key));
  if (pthread_setspecific(list.key, held.get()) != 0) throw std::bad_alloc();
  held.release();
}

}  // namespace surfeit::thread_scratch
