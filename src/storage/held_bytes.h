// What jobs hold in memory because it fits, and would else write to temporary files: a forecast
// does a job with few records, and asks what of it would not fit with all of them.
#pragma once

#include <cstdint>
#include <utility>
#include <vector>

namespace surfeit {

// Bytes that were held, and the room there was for them. Costs nothing while no log is there. Safe
// from any thread.
void noteHeldBytes(std::uint64_t bytes, std::uint64_t room);

// What is noted in this process while the log lives; that of other jobs meanwhile, too.
class HeldBytesLog {
 public:
  HeldBytesLog();
  HeldBytesLog(const HeldBytesLog&) = delete;
  HeldBytesLog& operator=(const HeldBytesLog&) = delete;
  ~HeldBytesLog();

  // Bytes that go to files when all is so many times as much.
  std::uint64_t spilledOf(double times) const;

 private:
  friend void noteHeldBytes(std::uint64_t bytes, std::uint64_t room);
  std::vector<std::pair<std::uint64_t, std::uint64_t>> held_;
};

}  // namespace surfeit
