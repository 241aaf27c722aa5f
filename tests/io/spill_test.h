// What the tests of things that spill to a temporary file share: the memory they take, and system
// calls that fail or throw.
#pragma once

#include <fcntl.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <malloc.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <cerrno>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <new>
#include <string>
#include <system_error>
#include <utility>

#include "io/fault_injector.h"
#include "io/test_directory.h"
#include "surfeit/status.h"

namespace surfeit {

// Memory in which nothing needs to spill.
inline constexpr std::uint64_t kPlenty = std::uint64_t{1} << 30;

#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
inline constexpr bool kHasSanitizer = true;  // whose allocator neither fails nor is counted
#else
inline constexpr bool kHasSanitizer = false;
#endif

// The most memory that was allocated, since it was made, at any system call and any look().
class PeakMemory : public FaultInjector {
 public:
  int before(CallInfo&) override {
    look();
    return 0;
  }
  void look() {
    const std::size_t now = allocatedBytes();
    std::size_t peak = peak_;
    while (now > peak && !peak_.compare_exchange_weak(peak, now)) {
    }
  }
  std::size_t bytes() const { return peak_ - before_; }

 private:
  static std::size_t allocatedBytes() {
    const struct ::mallinfo2 info = ::mallinfo2();
    return info.uordblks + info.hblkhd;
  }
  const std::size_t before_ = allocatedBytes();
  std::atomic<std::size_t> peak_{before_};
};

// The first call that passes the filter runs out of memory.
class ThrowAtCall : public FaultInjector {
 public:
  explicit ThrowAtCall(CallFilter filter) : filter_(std::move(filter)) {}
  int before(CallInfo& info) override {
    if (filter_(info) && !has_thrown_.exchange(true)) throw std::bad_alloc();
    return 0;
  }

 private:
  CallFilter filter_;
  std::atomic<bool> has_thrown_{false};
};

// Changes a byte of the file that is read first, just before that.
class DamageBeforeRead : public FaultInjector {
 public:
  explicit DamageBeforeRead(std::uint64_t place) : place_(place) {}
  int before(CallInfo& info) override {
    if (info.call != Call::kPread || has_acted_.exchange(true)) return 0;
    const std::string path = "/proc/self/fd/" + std::to_string(info.descriptor);
    const int descriptor = ::open(path.c_str(), O_RDWR | O_CLOEXEC);
    const auto offset = static_cast<off_t>(info.offset + place_);
    char byte = 0;
    EXPECT_EQ(::pread(descriptor, &byte, 1, offset), 1);
    byte = static_cast<char>(byte ^ 1);
    EXPECT_EQ(::pwrite(descriptor, &byte, 1, offset), 1);
    ::close(descriptor);
    return 0;
  }

 private:
  const std::uint64_t place_;
  std::atomic<bool> has_acted_{false};
};

class SpillTest : public DirectoryTest {
 protected:
  // Fails one system call of `work` after the other, later on some of them, once and for good: it
  // either succeeds all the same or says why not, and nothing is left of its file.
  void failEveryCall(const std::function<Status()>& work) {
    for (const auto repeat : {FailCall::Repeat::kOnce, FailCall::Repeat::kForEver}) {
      bool has_failed = true;
      int failures = 0;
      for (int number = 1; has_failed; number += number < 10 ? 1 : 13) {
        SCOPED_TRACE(testing::Message() << "call " << number);
        FailCall fail(number, EIO, repeat);
        const Status status = statusWith(fail, work);
        has_failed = fail.hasFailed();
        if (status.ok()) continue;
        ++failures;
        EXPECT_TRUE(has_failed);
        EXPECT_EQ(status.code(), StatusCode::kIoError) << status.message();
        EXPECT_THAT(status.message(), testing::HasSubstr(directory_.string()));
        ASSERT_FALSE(HasFailure());
      }
      EXPECT_GT(failures, 5);
    }
  }

  // Bytes on the disk of the open file without a name.
  std::uint64_t diskBytes() const {
    std::uint64_t bytes = 0;
    for (const auto& entry : std::filesystem::directory_iterator("/proc/self/fd")) {
      std::error_code error;
      const std::string file = std::filesystem::read_symlink(entry.path(), error);
      struct ::stat info {};
      if (!file.starts_with(directory_.string()) || ::stat(entry.path().c_str(), &info) != 0) {
        continue;
      }
      bytes = std::max(bytes, static_cast<std::uint64_t>(info.st_blocks) * 512);
    }
    return bytes;
  }

  // What `work` returns under a fault, after which nothing is left open, named or running.
  Status statusWith(FaultInjector& injector, const std::function<Status()>& work) {
    const std::ptrdiff_t descriptors = entryCount("/proc/self/fd");
    Status status;
    {
      const Faults faults({&injector});
      status = work();
    }
    EXPECT_EQ(entryCount("/proc/self/fd"), descriptors);
    EXPECT_EQ(fileCount(), 0);
    return status;
  }

  void expectBadAlloc(Call call, const std::function<Status()>& work) {
    ThrowAtCall injector(only(call));
    EXPECT_THROW(static_cast<void>(statusWith(injector, work)), std::bad_alloc);
    EXPECT_EQ(fileCount(), 0);
  }

  void expectChecksumError(std::uint64_t place, const std::function<Status()>& work) {
    DamageBeforeRead damage(place);
    const Status status = statusWith(damage, work);
    EXPECT_EQ(status.code(), StatusCode::kIoError);
    EXPECT_THAT(status.message(), testing::HasSubstr("checksum"));
    EXPECT_THAT(status.message(), testing::HasSubstr(directory_.string()));
  }

  void expectFullDiskError(const std::function<Status()>& work) {
    FullDisk full(std::uint64_t{1} << 20);
    const Status status = statusWith(full, work);
    EXPECT_EQ(status.code(), StatusCode::kIoError);
    EXPECT_THAT(status.message(), testing::HasSubstr("--temp"));
  }
};

}  // namespace surfeit
