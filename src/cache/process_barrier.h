// A memory barrier in every running thread of the process, issued by one of them.
//
// Two threads that each announce something and then look for what the other announces must not both
// miss it: each needs a full barrier between its store and its load. Where one side runs millions
// of times for every time of the other, the rare side can issue both barriers (asymmetric fences,
// C++ paper P1202): the frequent side then only keeps the compiler from reordering, and costs
// nothing.
#pragma once

#include <linux/membarrier.h>
#include <sys/syscall.h>
#include <unistd.h>

#include "core/assert.h"

namespace surfeit {

// Whether this process may use processBarrier; once it may, it always may. Old kernels and some
// sandboxes have none. Must come before the first processBarrier. Safe from any thread.
inline bool registerProcessBarrier() {
  return syscall(SYS_membarrier, MEMBARRIER_CMD_REGISTER_PRIVATE_EXPEDITED, 0, 0) == 0;
}

// Returns when every thread of the process that was running has passed a full memory barrier; those
// that were not running pass one before they do. Takes 40 ns alone, 0.3 us beside one busy thread.
// Safe from any thread.
inline void processBarrier() {
  SURFEIT_CHECK(syscall(SYS_membarrier, MEMBARRIER_CMD_PRIVATE_EXPEDITED, 0, 0) == 0);
}

}  // namespace surfeit
