// Objects that a thread uses again and again, so that the memory they hold is touched for the first
// time only once.
#pragma once

#include <memory>
#include <new>
#include <utility>

namespace surfeit {

namespace thread_scratch {

struct Held {
  virtual ~Held() = default;
  Held* next = nullptr;  // of the same thread
};
// Destroys it when the calling thread ends. Throws std::bad_alloc.
void hold(std::unique_ptr<Held> held);

}  // namespace thread_scratch

// The calling thread's own T for a place in the code, with what it held when it was last there:
//
//   std::vector<Surfel>& surfels = threadScratch<std::vector<Surfel>>([] {});
//
// Every lambda expression has a type of its own, and so names the place. Throws std::bad_alloc. Not
// a thread_local object with a destructor: where glibc has no memory to note that, it ends the
// process.
template <typename T, typename Place>
T& threadScratch(Place) {
  struct Object : thread_scratch::Held {
    T object;
  };
  thread_local T* object = nullptr;
  if (object == nullptr) {
    auto made = std::make_unique<Object>();
    T* const pointer = &made->object;
    thread_scratch::hold(std::move(made));
    object = pointer;
  }
  return *object;
}

}  // namespace surfeit
