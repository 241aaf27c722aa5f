#include "call.h"

#include <malloc.h>

#include <atomic>
#include <chrono>
#include <condition_variable>
#include <cstdint>
#include <exception>
#include <mutex>
#include <new>
#include <string>
#include <thread>
#include <vector>

namespace surfeit::python {
namespace {

constexpr std::chrono::milliseconds kLookEvery{50};

// Collects on the threads of the work what tell() passes on to Python.
class CallProgress : public Progress {
 public:
  // With `strict` the first note ends the work; tell() then raises it.
  explicit CallProgress(bool strict) : is_strict_(strict) {}

  void beginPhase(std::string_view name, std::uint64_t total, std::string_view unit) override {
    const std::lock_guard lock(mutex_);
    phase_ = name;
    unit_ = unit;
    total_ = total;
    done_ = 0;
  }
  void advance(std::uint64_t count) override { done_ += count; }
  void note(const std::string& message) override {
    add("note", message);
    if (is_strict_) cancel();
  }
  void inform(const std::string& message) override { add("inform", message); }
  bool isCancelled() const override { return is_cancelled_.load(std::memory_order_relaxed); }

  void cancel() { is_cancelled_ = true; }

  // Needs the GIL; throws what the watcher raises.
  void tell(const py::object& watcher) {
    if (watcher.is_none()) return;
    std::unique_lock lock(mutex_);
    const std::vector<Message> messages = std::move(messages_);
    messages_.clear();
    const std::string phase = phase_, unit = unit_;
    const std::uint64_t total = total_, done = done_;
    lock.unlock();
    for (const Message& message : messages) watcher.attr(message.kind)(message.text);
    if (!phase.empty()) watcher.attr("update")(phase, done, total, unit);
  }

 private:
  struct Message {
    const char* kind;
    std::string text;
  };

  void add(const char* kind, const std::string& text) {
    const std::lock_guard lock(mutex_);
    messages_.push_back({kind, text});
  }

  const bool is_strict_;
  std::mutex mutex_;  // guards what follows, but not the atomic ones
  std::string phase_, unit_;
  std::uint64_t total_ = 0;
  std::vector<Message> messages_;
  std::atomic<std::uint64_t> done_{0};
  std::atomic<bool> is_cancelled_{false};
};

// Work on its thread.
class Working {
 public:
  Working(const std::function<Status(Progress&)>& work, Progress& progress)
      : thread_([this, &work, &progress] {
          Status status = attempt(work, progress);
          const std::lock_guard lock(mutex_);
          status_ = std::move(status);
          has_ended_ = true;
          ended_.notify_all();
        }) {}

  bool waitFor(std::chrono::milliseconds time) {
    std::unique_lock lock(mutex_);
    return ended_.wait_for(lock, time, [this] { return has_ended_; });
  }

  // When it has ended.
  Status join() {
    thread_.join();
    return std::move(status_);
  }

 private:
  static Status attempt(const std::function<Status(Progress&)>& work, Progress& progress) {
    try {
      return work(progress);
    } catch (const std::bad_alloc&) {
      return Status::failed("out of memory");
    } catch (const std::exception& error) {
      return Status::failed(error.what());
    }
  }

  std::mutex mutex_;
  std::condition_variable ended_;
  bool has_ended_ = false;
  Status status_;
  std::thread thread_;  // last: it uses the others
};

}  // namespace

void run(const py::object& watcher, const std::function<Status(Progress&)>& work) {
  CallProgress progress(!watcher.is_none() && py::cast<bool>(watcher.attr("strict")));
  std::exception_ptr raised;
  Working working(work, progress);
  for (bool has_ended = false; !has_ended;) {
    {
      const py::gil_scoped_release release;
      has_ended = working.waitFor(kLookEvery);
    }
    try {
      if (PyErr_CheckSignals() != 0) throw py::error_already_set();
      if (raised == nullptr) progress.tell(watcher);
    } catch (...) {
      raised = std::current_exception();
      progress.cancel();
    }
  }
  const Status status = working.join();
#ifdef __GLIBC__
  malloc_trim(0);  // what a job has held is for the next one, and for the caller
#endif
  if (raised != nullptr) std::rethrow_exception(raised);
  check(status);
}

}  // namespace surfeit::python
