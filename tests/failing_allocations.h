// Makes allocations fail. Replaces operator new: to be included by one source of a program.
#pragma once

#include <atomic>
#include <cstdlib>
#include <new>

namespace {

std::atomic<long> live_allocations{0};
std::atomic<long> allocations_until_failure{-1};  // negative: none fails
std::atomic<bool> fails_for_ever{false}, has_failed{false};
// Whether those of the code at an address are let through; null: of none.
std::atomic<bool (*)(const void*)> is_spared{nullptr};

void* allocate(std::size_t bytes, std::size_t alignment, const void* caller) {
  const auto spares = is_spared.load();
  if (allocations_until_failure >= 0 && (spares == nullptr || !spares(caller)) &&
      allocations_until_failure.fetch_sub(1) == 0) {
    if (fails_for_ever) allocations_until_failure = 0;
    has_failed = true;
    throw std::bad_alloc();
  }
  void* memory = std::aligned_alloc(alignment, (bytes + alignment) / alignment * alignment);
  if (memory == nullptr) throw std::bad_alloc();
  ++live_allocations;
  return memory;
}

void release(void* memory) {
  if (memory == nullptr) return;
  --live_allocations;
  std::free(memory);
}

}  // namespace

void* operator new(std::size_t bytes) { return allocate(bytes, 16, __builtin_return_address(0)); }
void* operator new[](std::size_t bytes) { return allocate(bytes, 16, __builtin_return_address(0)); }
void* operator new(std::size_t bytes, std::align_val_t alignment) {
  return allocate(bytes, std::size_t(alignment), __builtin_return_address(0));
}
void* operator new[](std::size_t bytes, std::align_val_t alignment) {
  return allocate(bytes, std::size_t(alignment), __builtin_return_address(0));
}
void operator delete(void* memory) noexcept { release(memory); }
void operator delete[](void* memory) noexcept { release(memory); }
void operator delete(void* memory, std::size_t) noexcept { release(memory); }
void operator delete[](void* memory, std::size_t) noexcept { release(memory); }
void operator delete(void* memory, std::align_val_t) noexcept { release(memory); }
void operator delete[](void* memory, std::align_val_t) noexcept { release(memory); }
void operator delete(void* memory, std::size_t, std::align_val_t) noexcept { release(memory); }
void operator delete[](void* memory, std::size_t, std::align_val_t) noexcept { release(memory); }

namespace surfeit {
namespace {

// Allocations fail as long as this lives: the one after `count` others, or all from there on.
class FailingAllocations {
 public:
  FailingAllocations(long count, bool for_ever) {
    fails_for_ever = for_ever;
    has_failed = false;
    allocations_until_failure = count;
  }
  ~FailingAllocations() { allocations_until_failure = -1; }
  bool anyFailed() const { return has_failed; }
};

}  // namespace
}  // namespace surfeit
