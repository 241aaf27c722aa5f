// An emulation of a slow shared file system, for bench/stage.sh: a library that LD_PRELOAD puts in
// front of pread. Reads of files whose paths begin with SLOW_SHARE take SLOW_SHARE_MS milliseconds
// each, and as long as SLOW_SHARE_MBS megabytes a second let them, one read after the other. It has
// no cache, as a scene that is much larger than the memory for it has none; and it knows nothing of
// writes, locks and other machines. Prints what was read when the process ends.
//
//   c++ -O2 -shared -fPIC bench/slow_share.cpp -o slow_share.so -ldl
#include <dlfcn.h>
#include <sys/types.h>
#include <unistd.h>

#include <atomic>
#include <chrono>
#include <climits>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <mutex>
#include <thread>

namespace {

using Clock = std::chrono::steady_clock;

std::atomic<unsigned long long> reads, bytes;

bool isShared(int descriptor) {
  static const char* const prefix = getenv("SLOW_SHARE");
  if (prefix == nullptr) return false;
  char link[64], path[PATH_MAX];
  snprintf(link, sizeof link, "/proc/self/fd/%d", descriptor);
  const ssize_t size = readlink(link, path, sizeof path - 1);
  if (size <= 0) return false;
  path[size] = 0;
  return strncmp(path, prefix, strlen(prefix)) == 0;
}

double number(const char* name) {
  const char* const text = getenv(name);
  return text == nullptr ? 0 : atof(text);
}

void wait(size_t size) {
  static const double milliseconds = number("SLOW_SHARE_MS"), rate = number("SLOW_SHARE_MBS");
  static std::mutex mutex;
  static Clock::time_point free = Clock::now();
  ++reads, bytes += size;
  Clock::time_point end = Clock::now();
  if (rate > 0) {
    const std::lock_guard lock(mutex);
    const double seconds = double(size) / (rate * 1e6);
    free = std::max(free, end) + std::chrono::nanoseconds((long long)(seconds * 1e9));
    end = free;
  }
  std::this_thread::sleep_until(end + std::chrono::nanoseconds((long long)(milliseconds * 1e6)));
}

struct Report {
  ~Report() {
    const char* const path = getenv("SLOW_SHARE_REPORT");
    if (path == nullptr || reads == 0) return;
    if (FILE* const file = fopen(path, "a")) {
      fprintf(file, "%llu %llu\n", reads.load(), bytes.load());
      fclose(file);
    }
  }
} report;

}  // namespace

extern "C" ssize_t pread64(int descriptor, void* data, size_t size, off64_t offset) {
  using Read = ssize_t (*)(int, void*, size_t, off64_t);
  static const Read read = (Read)dlsym(RTLD_NEXT, "pread64");
  const ssize_t got = read(descriptor, data, size, offset);
  if (got > 0 && isShared(descriptor)) wait(size_t(got));
  return got;
}

extern "C" ssize_t pread(int descriptor, void* data, size_t size, off_t offset) {
  return pread64(descriptor, data, size, offset);
}
