// Ways in which system calls fail, for tests: each is a FaultInjector (storage/system_calls.h), and
// several work together as Faults. Safe from any thread.
#pragma once

#include <fcntl.h>
#include <signal.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <cerrno>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <initializer_list>
#include <iterator>
#include <mutex>
#include <set>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "storage/system_calls.h"

namespace surfeit {

using system_calls::Call;
using system_calls::CallInfo;
using system_calls::FaultInjector;

// Which calls a fault is about; empty: all.
using CallFilter = std::function<bool(const CallInfo&)>;

inline CallFilter only(Call call) {
  return [call](const CallInfo& info) { return info.call == call; };
}

// Installs several injectors while it lives. The first that fails a call decides. No call may be
// under way when it comes or goes.
class Faults : public FaultInjector {
 public:
  explicit Faults(std::initializer_list<FaultInjector*> injectors) : injectors_(injectors) {
    before_ = system_calls::installFaultInjector(this);
  }
  Faults(const Faults&) = delete;
  Faults& operator=(const Faults&) = delete;
  ~Faults() override { system_calls::installFaultInjector(before_); }

  int before(CallInfo& info) override {
    for (FaultInjector* injector : injectors_) {
      if (const int error = injector->before(info); error != 0) return error;
    }
    return 0;
  }
  void after(const CallInfo& info, int error) override {
    for (FaultInjector* injector : injectors_) injector->after(info, error);
  }

 private:
  std::vector<FaultInjector*> injectors_;
  FaultInjector* before_;
};

// Counts the calls that pass the filter.
class CountCalls : public FaultInjector {
 public:
  explicit CountCalls(CallFilter filter = {}) : filter_(std::move(filter)) {}
  int before(CallInfo& info) override {
    if (!filter_ || filter_(info)) ++count_;
    return 0;
  }
  int count() const { return count_; }

 private:
  CallFilter filter_;
  std::atomic<int> count_{0};
};

// Fails call `number` (from 1) of those that pass the filter, and all later ones if asked to.
class FailCall : public FaultInjector {
 public:
  enum class Repeat { kOnce, kForEver };
  FailCall(int number, int error, Repeat repeat = Repeat::kOnce, CallFilter filter = {})
      : number_(number), error_(error), repeat_(repeat), filter_(std::move(filter)) {}

  int before(CallInfo& info) override {
    if (filter_ && !filter_(info)) return 0;
    const int number = ++count_;
    if (number < number_ || (repeat_ == Repeat::kOnce && number > number_)) return 0;
    if (number == number_) failed_call_ = info.call;
    has_failed_ = true;
    return error_;
  }
  // Whether there was such a call, and which it was.
  bool hasFailed() const { return has_failed_; }
  Call failedCall() const { return failed_call_; }

 private:
  const int number_, error_;
  const Repeat repeat_;
  CallFilter filter_;
  std::atomic<int> count_{0};
  std::atomic<bool> has_failed_{false};
  std::atomic<Call> failed_call_{Call::kOpen};
};

// Damages what read `number` (from 1) of those that pass the filter has brought: one bit, in the
// middle.
class FlipBit : public FaultInjector {
 public:
  FlipBit(int number, CallFilter filter) : number_(number), filter_(std::move(filter)) {}
  int before(CallInfo&) override { return 0; }
  void after(const CallInfo& info, int error) override {
    if (info.call != Call::kPread || error != 0 || !filter_(info) || ++count_ != number_) return;
    static_cast<std::byte*>(info.data)[info.bytes / 2] ^= std::byte{4};
  }

 private:
  const int number_;
  CallFilter filter_;
  std::atomic<int> count_{0};
};

// Does something at the first call that passes the filter, before it is made; the calls of what it
// does are not looked at.
class ActAtCall : public FaultInjector {
 public:
  ActAtCall(CallFilter filter, std::function<void()> action)
      : filter_(std::move(filter)), action_(std::move(action)) {}
  int before(CallInfo& info) override {
    if (filter_(info) && !has_acted_.exchange(true)) action_();
    return 0;
  }
  bool hasActed() const { return has_acted_; }

 private:
  CallFilter filter_;
  std::function<void()> action_;
  std::atomic<bool> has_acted_{false};
};

// The process dies at call `number`, before it is made, as by kill -9.
class DieAtCall : public FaultInjector {
 public:
  explicit DieAtCall(int number) : number_(number) {}
  int before(CallInfo&) override {
    if (++count_ == number_) ::kill(::getpid(), SIGKILL);
    return 0;
  }

 private:
  const int number_;
  std::atomic<int> count_{0};
};

// Every call is interrupted twice before it succeeds.
class InterruptStorm : public FaultInjector {
 public:
  int before(CallInfo&) override {
    thread_local unsigned calls = 0;
    return ++calls % 3 == 0 ? 0 : EINTR;
  }
};

// Reads and writes transfer at most `limit` bytes; or, with 0, some number of bytes that is less
// than asked for.
class ShortTransfers : public FaultInjector {
 public:
  explicit ShortTransfers(std::size_t limit) : limit_(limit) {}
  int before(CallInfo& info) override {
    if ((info.call != Call::kPread && info.call != Call::kPwrite) || info.bytes < 2) return 0;
    std::size_t limit = limit_;
    if (limit == 0) {
      const std::uint64_t number = ++calls_ * 0x9e3779b97f4a7c15ull;
      limit = 1 + static_cast<std::size_t>(number >> 20) % (info.bytes - 1);
    }
    info.bytes = std::min(info.bytes, limit);
    return 0;
  }

 private:
  const std::size_t limit_;
  std::atomic<std::uint64_t> calls_{0};
};

// The first read or write transfers `length` bytes at most, the others all.
class ShortFirstTransfer : public FaultInjector {
 public:
  explicit ShortFirstTransfer(std::size_t length) : length_(length) {}
  int before(CallInfo& info) override {
    if (info.call != Call::kPread && info.call != Call::kPwrite) return 0;
    if (!was_first_.exchange(true)) info.bytes = std::min(info.bytes, length_);
    return 0;
  }

 private:
  const std::size_t length_;
  std::atomic<bool> was_first_{false};
};

// The disk takes `bytes` bytes, then no more.
class FullDisk : public FaultInjector {
 public:
  explicit FullDisk(std::uint64_t bytes, int error = ENOSPC) : left_(bytes), error_(error) {}
  int before(CallInfo& info) override {
    if (info.call != Call::kPwrite) return 0;
    const std::lock_guard lock(mutex_);
    if (left_ == 0) return error_;
    info.bytes = static_cast<std::size_t>(std::min<std::uint64_t>(info.bytes, left_));
    left_ -= info.bytes;
    return 0;
  }

 private:
  std::mutex mutex_;
  std::uint64_t left_;
  const int error_;
};

// A file system without files that have no name.
class RefuseUnnamed : public FaultInjector {
 public:
  int before(CallInfo& info) override {
    return info.call == Call::kOpen && (info.flags & O_TMPFILE) == O_TMPFILE ? EOPNOTSUPP : 0;
  }
};

// A file system without direct I/O: says so when a file is opened, or only when it is used.
class RefuseDirect : public FaultInjector {
 public:
  enum class When { kOpened, kUsed };
  explicit RefuseDirect(When when) : when_(when) {}
  int before(CallInfo& info) override {
    if (when_ == When::kOpened) {
      return info.call == Call::kOpen && (info.flags & O_DIRECT) != 0 ? EINVAL : 0;
    }
    if (info.call != Call::kPread && info.call != Call::kPwrite) return 0;
    return (::fcntl(info.descriptor, F_GETFL) & O_DIRECT) != 0 ? EINVAL : 0;
  }

 private:
  const When when_;
};

// Keeps the names of the files that were created and are neither removed nor renamed yet.
class NameLog : public FaultInjector {
 public:
  int before(CallInfo&) override { return 0; }
  void after(const CallInfo& info, int error) override {
    if (error != 0) return;
    const std::lock_guard lock(mutex_);
    if (info.call == Call::kOpen && (info.flags & O_EXCL) != 0) add(info.path);
    if (info.call == Call::kLinkat) add(info.new_path);
    if (info.call == Call::kUnlink || info.call == Call::kRename) names_.erase(info.path);
  }
  std::set<std::string> liveNames() const {
    const std::lock_guard lock(mutex_);
    return names_;
  }
  // Of all times.
  int nameCount() const {
    const std::lock_guard lock(mutex_);
    return count_;
  }

 private:
  void add(const char* name) {
    names_.insert(name);
    ++count_;
  }
  mutable std::mutex mutex_;
  std::set<std::string> names_;
  int count_ = 0;
};

// Entries of a directory of /proc: open descriptors ("/proc/self/fd", with the one that counts) or
// threads ("/proc/self/task").
inline std::ptrdiff_t entryCount(const char* directory) {
  return std::distance(std::filesystem::directory_iterator(directory),
                       std::filesystem::directory_iterator());
}

// Whether no more than `threads` threads are left. The kernel may list a thread for a moment after
// it was joined, so this waits for those to go.
inline bool threadsComeDownTo(std::ptrdiff_t threads) {
  const auto deadline = std::chrono::steady_clock::now() + std::chrono::seconds(30);
  while (entryCount("/proc/self/task") > threads) {
    if (std::chrono::steady_clock::now() > deadline) return false;
    std::this_thread::sleep_for(std::chrono::milliseconds(1));
  }
  return true;
}

}  // namespace surfeit
