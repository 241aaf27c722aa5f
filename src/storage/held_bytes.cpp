#include "storage/held_bytes.h"

#include <algorithm>
#include <atomic>
#include <mutex>

namespace surfeit {
namespace {

std::atomic<int> log_count{0};
std::mutex mutex;

std::vector<HeldBytesLog*>& logs() {
  static std::vector<HeldBytesLog*> all;
  return all;
}

}  // namespace

void noteHeldBytes(std::uint64_t bytes, std::uint64_t room) {
  if (log_count == 0) return;
  const std::lock_guard lock(mutex);
  for (HeldBytesLog* log : logs()) log->held_.emplace_back(bytes, room);
}

HeldBytesLog::HeldBytesLog() {
  const std::lock_guard lock(mutex);
  logs().push_back(this);
  ++log_count;
}

HeldBytesLog::~HeldBytesLog() {
  const std::lock_guard lock(mutex);
  logs().erase(std::find(logs().begin(), logs().end(), this));
  --log_count;
}

std::uint64_t HeldBytesLog::spilledOf(double times) const {
  const std::lock_guard lock(mutex);
  double spilled = 0;
  for (const auto& [bytes, room] : held_) {
    const double all = times * double(bytes);
    if (all > double(room)) spilled += all;
  }
  return std::uint64_t(spilled);
}

}  // namespace surfeit
