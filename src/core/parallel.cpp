#include "core/parallel.h"

#include <vector>

#include "core/assert.h"
#include "core/tbb_tasks.h"
#include "core/thread_check.h"

#ifdef __SANITIZE_THREAD__
#include <sanitizer/tsan_interface.h>
#endif

namespace surfeit {
namespace {

// Something that TBB orders, told to the thread sanitizer: what a thread did before release() is
// seen after acquire(). Neither reads or writes memory that the sanitizer looks at.
class TaskOrder {
 public:
#ifdef __SANITIZE_THREAD__
  void acquire() { __tsan_acquire(&token_); }
  void release() { __tsan_release(&token_); }
#else
  void acquire() {}
  void release() {}
#endif

 private:
  [[maybe_unused]] char token_ = 0;
};

// Tasks begin after what their caller did before, and end before what it does next.
struct TaskGroup {
  TaskOrder begun, ended;
};

// Around the call that runs the tasks.
class CallerScope {
 public:
  explicit CallerScope(TaskGroup& group) : group_(group) { group_.begun.release(); }
  CallerScope(const CallerScope&) = delete;
  CallerScope& operator=(const CallerScope&) = delete;
  ~CallerScope() { group_.ended.acquire(); }

 private:
  TaskGroup& group_;
};

// Around a task: the first thing it does, before it reads what its caller wrote.
class TaskScope {
 public:
  explicit TaskScope(TaskGroup& group) : group_(group) { group_.begun.acquire(); }
  TaskScope(const TaskScope&) = delete;
  TaskScope& operator=(const TaskScope&) = delete;
  ~TaskScope() { group_.ended.release(); }

 private:
  TaskGroup& group_;
};

// Around what is done by one thread at a time, but not always by the same one.
class TurnScope {
 public:
  explicit TurnScope(TaskOrder& order) : order_(order) { order_.acquire(); }
  TurnScope(const TurnScope&) = delete;
  TurnScope& operator=(const TurnScope&) = delete;
  ~TurnScope() { order_.release(); }

 private:
  TaskOrder& order_;
};

// The context of tasks. The group comes first: it is found without reading memory.
struct Job {
  TaskGroup group;
  const std::function<void()>& work;
};

struct Loop {
  TaskGroup group;
  const std::function<void(std::size_t)>& body;
};

struct Pipeline {
  TaskGroup group;
  const std::function<std::optional<std::size_t>()>& source;
  std::span<const PipelineStage> stages;
  TaskOrder source_turns, departures;
  std::vector<TaskOrder> stage_turns, item_turns;
};

void doJob(void* context) {
  Job& job = *static_cast<Job*>(context);
  const TaskScope task(job.group);
  job.work();
}

void doIteration(void* context, std::size_t i) {
  Loop& loop = *static_cast<Loop*>(context);
  const TaskScope task(loop.group);
  loop.body(i);
}

bool takeItem(void* context, std::size_t& item) {
  Pipeline& pipeline = *static_cast<Pipeline*>(context);
  const TaskScope task(pipeline.group);
  const TurnScope turn(pipeline.source_turns);
  pipeline.departures.acquire();
  const std::optional<std::size_t> taken = pipeline.source();
  if (!taken) return false;
  SURFEIT_CHECK(*taken < pipeline.item_turns.size());
  item = *taken;
  pipeline.item_turns[item].release();
  return true;
}

void workOnItem(void* context, std::size_t stage, std::size_t item) {
  Pipeline& pipeline = *static_cast<Pipeline*>(context);
  const TaskScope task(pipeline.group);
  const TurnScope item_turn(pipeline.item_turns[item]);
  const PipelineStage& at = pipeline.stages[stage];
  if (at.mode == PipelineStage::Mode::kParallel) {
    at.work(item);
  } else {
    const TurnScope stage_turn(pipeline.stage_turns[stage]);
    at.work(item);
  }
  if (stage + 1 == pipeline.stages.size()) pipeline.departures.release();
}

}  // namespace

void withThreads(int threads, const std::function<void()>& work) {
  requireThreads(threads);
  Job job{{}, work};
  const CallerScope caller(job.group);
  tbb_tasks::withThreads(threads, doJob, &job);
}

void parallelFor(std::size_t count, const std::function<void(std::size_t)>& body) {
  Loop loop{{}, body};
  const CallerScope caller(loop.group);
  tbb_tasks::run(count, doIteration, &loop);
}

void runPipeline(std::size_t most, const std::function<std::optional<std::size_t>()>& source,
                 std::span<const PipelineStage> stages) {
  SURFEIT_CHECK(!stages.empty());
  Pipeline pipeline{{}, source, stages, {}, {}, {}, {}};
  pipeline.stage_turns.resize(stages.size());
  pipeline.item_turns.resize(most);
  std::vector<tbb_tasks::Order> orders;
  for (const PipelineStage& stage : stages) {
    orders.push_back(stage.mode == PipelineStage::Mode::kInOrder ? tbb_tasks::Order::kSerial
                                                                 : tbb_tasks::Order::kParallel);
  }
  const CallerScope caller(pipeline.group);
  tbb_tasks::run(most, {&pipeline, takeItem, workOnItem}, orders);
}

}  // namespace surfeit
