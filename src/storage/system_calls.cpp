#include "storage/system_calls.h"

#include <fcntl.h>
#include <sys/file.h>
#include <unistd.h>

#include <atomic>
#include <cerrno>
#include <chrono>
#include <cstdio>
#include <thread>

#include "surfeit/process.h"

namespace surfeit {
namespace {

std::atomic<int> read_retries{0};
std::atomic<std::uint64_t> reads_retried{0};

}  // namespace

void setReadRetries(int retries) { read_retries = retries; }
std::uint64_t readsRetried() { return reads_retried; }

}  // namespace surfeit

namespace surfeit::system_calls {
namespace {

std::atomic<FaultInjector*> fault_injector{nullptr};

// Makes a call until no signal interrupts it. `function` takes the bytes to transfer.
template <typename Function>
auto make(CallInfo info, Function function) -> decltype(function(info.bytes)) {
  const std::size_t bytes = info.bytes;
  while (true) {
    decltype(function(bytes)) result = -1;
    FaultInjector* const injector = fault_injector.load(std::memory_order_acquire);
    if (injector == nullptr) {
      result = function(bytes);
    } else {
      info.bytes = bytes;
      errno = injector->before(info);
      if (errno == 0) result = function(info.bytes);
      const int error = result < 0 ? errno : 0;
      injector->after(info, error);
      errno = error;
    }
    if (result >= 0 || errno != EINTR) return result;
  }
}

}  // namespace

void FaultInjector::after(const CallInfo&, int) {}

FaultInjector* installFaultInjector(FaultInjector* injector) {
  return fault_injector.exchange(injector, std::memory_order_acq_rel);
}

int open(const char* path, int flags, mode_t mode) {
  return make({.call = Call::kOpen, .path = path, .flags = flags},
              [&](std::size_t) { return ::open(path, flags, mode); });
}

ssize_t pread(int descriptor, void* bytes, std::size_t size, std::uint64_t offset) {
  for (int retry = 0;; ++retry) {
    const ssize_t got =
        make({.call = Call::kPread,
              .descriptor = descriptor,
              .bytes = size,
              .offset = offset,
              .data = bytes},
             [&](std::size_t allowed) {
               return ::pread(descriptor, bytes, allowed, static_cast<off_t>(offset));
             });
    if (got >= 0 || errno != EIO || retry >= read_retries) return got;
    ++reads_retried;
    std::this_thread::sleep_for(std::chrono::milliseconds(10) * (retry + 1));
  }
}

ssize_t pwrite(int descriptor, const void* bytes, std::size_t size, std::uint64_t offset) {
  return make({.call = Call::kPwrite, .descriptor = descriptor, .bytes = size, .offset = offset},
              [&](std::size_t allowed) {
                return ::pwrite(descriptor, bytes, allowed, static_cast<off_t>(offset));
              });
}

int fsync(int descriptor) {
  return make({.call = Call::kFsync, .descriptor = descriptor},
              [&](std::size_t) { return ::fsync(descriptor); });
}

int ftruncate(int descriptor, std::uint64_t size) {
  return make({.call = Call::kFtruncate, .descriptor = descriptor, .offset = size},
              [&](std::size_t) { return ::ftruncate(descriptor, static_cast<off_t>(size)); });
}

int punchHole(int descriptor, std::uint64_t offset, std::uint64_t size) {
  return make({.call = Call::kFallocate, .descriptor = descriptor, .offset = offset},
              [&](std::size_t) {
                return ::fallocate(descriptor, FALLOC_FL_PUNCH_HOLE | FALLOC_FL_KEEP_SIZE,
                                   static_cast<off_t>(offset), static_cast<off_t>(size));
              });
}

int fstat(int descriptor, struct ::stat* info) {
  return make({.call = Call::kFstat, .descriptor = descriptor},
              [&](std::size_t) { return ::fstat(descriptor, info); });
}

int flock(int descriptor, int operation) {
  return make({.call = Call::kFlock, .descriptor = descriptor, .flags = operation},
              [&](std::size_t) { return ::flock(descriptor, operation); });
}

int linkDescriptor(int descriptor, const char* path) {
  // By way of /proc: AT_EMPTY_PATH needs a privilege
  char self[32];
  std::snprintf(self, sizeof self, "/proc/self/fd/%d", descriptor);
  return make(
      {.call = Call::kLinkat, .descriptor = descriptor, .path = self, .new_path = path},
      [&](std::size_t) { return ::linkat(AT_FDCWD, self, AT_FDCWD, path, AT_SYMLINK_FOLLOW); });
}

int rename(const char* path, const char* new_path) {
  return make({.call = Call::kRename, .path = path, .new_path = new_path},
              [&](std::size_t) { return std::rename(path, new_path); });
}

int unlink(const char* path) {
  return make({.call = Call::kUnlink, .path = path}, [&](std::size_t) { return ::unlink(path); });
}

int statvfs(const char* path, struct ::statvfs* info) {
  return make({.call = Call::kStatvfs, .path = path},
              [&](std::size_t) { return ::statvfs(path, info); });
}

int fstatvfs(int descriptor, struct ::statvfs* info) {
  return make({.call = Call::kStatvfs, .descriptor = descriptor},
              [&](std::size_t) { return ::fstatvfs(descriptor, info); });
}

}  // namespace surfeit::system_calls
