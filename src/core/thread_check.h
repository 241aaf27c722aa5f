// TBB ends the program when the system refuses it a thread. So we ask first.
#pragma once

namespace surfeit {

// Throws std::runtime_error when the process may not have so many threads at once, the calling one
// among them. Starts them, the first time that so many are asked for. Safe from any thread.
void requireThreads(int threads);

}  // namespace surfeit
