// What core/parallel.h needs of TBB, with nothing but plain functions between the two: TBB's
// headers are compiled in one file, which the thread sanitizer leaves alone.
#pragma once

#include <cstddef>
#include <span>

namespace surfeit::tbb_tasks {

void withThreads(int threads, void (*work)(void* context), void* context);

// task(context, i) for all i below `count`.
void run(std::size_t count, void (*task)(void* context, std::size_t i), void* context);

// The source is false at the end, else sets `item`; stages are counted from 0.
struct Pipeline {
  void* context = nullptr;
  bool (*source)(void* context, std::size_t& item) = nullptr;
  void (*work)(void* context, std::size_t stage, std::size_t item) = nullptr;
};
enum class Order { kSerial, kParallel };
// orders: by stage.
void run(std::size_t most, const Pipeline& pipeline, std::span<const Order> orders);

}  // namespace surfeit::tbb_tasks
