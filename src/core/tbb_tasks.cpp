#include "core/tbb_tasks.h"

#include <tbb/global_control.h>
#include <tbb/parallel_for.h>
#include <tbb/parallel_pipeline.h>
#include <tbb/task_arena.h>

namespace surfeit::tbb_tasks {

void withThreads(int threads, void (*work)(void* context), void* context) {
  const tbb::global_control limit(tbb::global_control::max_allowed_parallelism,
                                  static_cast<std::size_t>(threads));
  tbb::task_arena arena(threads);
  arena.execute([work, context] { work(context); });
}

void run(std::size_t count, void (*task)(void* context, std::size_t i), void* context) {
  tbb::parallel_for(std::size_t{0}, count, [task, context](std::size_t i) { task(context, i); });
}

void run(std::size_t most, const Pipeline& pipeline, std::span<const Order> orders) {
  using tbb::filter_mode;
  tbb::filter<void, std::size_t> filters = tbb::make_filter<void, std::size_t>(
      filter_mode::serial_in_order, [&pipeline](tbb::flow_control& control) {
        std::size_t item = 0;
        if (!pipeline.source(pipeline.context, item)) control.stop();
        return item;
      });
  const auto work = [&pipeline](std::size_t stage) {
    return [&pipeline, stage](std::size_t item) {
      pipeline.work(pipeline.context, stage, item);
      return item;
    };
  };
  const auto modeOf = [orders](std::size_t stage) {
    return orders[stage] == Order::kSerial ? filter_mode::serial_in_order : filter_mode::parallel;
  };
  const std::size_t last = orders.size() - 1;
  for (std::size_t stage = 0; stage < last; ++stage) {
    filters = filters & tbb::make_filter<std::size_t, std::size_t>(modeOf(stage), work(stage));
  }
  tbb::parallel_pipeline(most,
                         filters & tbb::make_filter<std::size_t, void>(modeOf(last), work(last)));
}

}  // namespace surfeit::tbb_tasks
