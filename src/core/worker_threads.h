// Threads that all do the same work until it is done or one of them fails.
#pragma once

#include <functional>

#include "core/first_failure.h"
#include "surfeit/status.h"

namespace surfeit {

// What the work answers, or a failure that tells what it threw: past the border of a thread, that
// would end the process. `doing` is what follows "cannot", as in "gather".
Status catchAll(const char* doing, const std::function<Status()>& work) noexcept;

// Calls `work` on so many threads, this one among them, and returns when all have ended. What fails
// or is thrown is noted, which is what the others look at; returns the first failure.
Status runOnThreads(int threads, FirstFailure& failure, const char* doing,
                    const std::function<Status()>& work);

}  // namespace surfeit
