// The system calls of io, in one place, so that a test can make any of them fail. Each behaves and
// sets errno as the system's own, except that a call which a signal interrupted (EINTR) is made
// again. Safe from any thread.
#pragma once

#include <sys/stat.h>
#include <sys/statvfs.h>
#include <sys/types.h>

#include <cstddef>
#include <cstdint>

namespace surfeit::system_calls {

enum class Call : std::uint8_t {
  kOpen,
  kPread,
  kPwrite,
  kFsync,
  kFtruncate,
  kFallocate,
  kFstat,
  kFlock,
  kLinkat,
  kRename,
  kUnlink,
  kStatvfs,
};

// What is about to be called. Members that a call does not have are as they are here.
struct CallInfo {
  Call call;
  int descriptor = -1;
  const char* path = nullptr;
  const char* new_path = nullptr;  // of kLinkat and kRename
  int flags = 0;                   // of kOpen and kFlock
  std::size_t bytes = 0;           // of kPread and kPwrite
  std::uint64_t offset = 0;        // of kPread, kPwrite, kFtruncate and kFallocate
  void* data = nullptr;            // of kPread: where the bytes come
};

// Called around every system call, from the thread that makes it.
class FaultInjector {
 public:
  virtual ~FaultInjector() = default;
  // The errno with which the call fails instead of being made, or 0. May lower info.bytes, to 1 at
  // least: then the call transfers no more than that.
  virtual int before(CallInfo& info) = 0;
  // error: the errno of the call, or 0 when it succeeded.
  virtual void after(const CallInfo& info, int error);
};

// For tests: from now on calls go by way of `injector`; nullptr, as in production, ends that and
// costs one load per call. Returns the one before. No call may be under way.
FaultInjector* installFaultInjector(FaultInjector* injector);

int open(const char* path, int flags, mode_t mode = 0);
// Tried again after EIO as often as setReadRetries (surfeit/process.h) says.
ssize_t pread(int descriptor, void* bytes, std::size_t size, std::uint64_t offset);
ssize_t pwrite(int descriptor, const void* bytes, std::size_t size, std::uint64_t offset);
int fsync(int descriptor);
int ftruncate(int descriptor, std::uint64_t size);
// Gives the space of a range back to the file system; the range reads as zeros.
int punchHole(int descriptor, std::uint64_t offset, std::uint64_t size);
int fstat(int descriptor, struct ::stat* info);
int flock(int descriptor, int operation);
// Gives the file of `descriptor`, which has no name, the name `path`.
int linkDescriptor(int descriptor, const char* path);
int rename(const char* path, const char* new_path);
int unlink(const char* path);
int statvfs(const char* path, struct ::statvfs* info);
int fstatvfs(int descriptor, struct ::statvfs* info);

}  // namespace surfeit::system_calls
