// The threads of a crew: all do the same work until it is done or one of them fails.
#pragma once

#include <functional>

#include "core/first_failure.h"
#include "surfeit/status.h"

namespace surfeit {

// Calls `work` on so many threads, this one among them, and returns when all have ended. What fails
// or is thrown is noted, which is what the others look at; returns the first failure.
Status runOnThreads(int threads, FirstFailure& failure, const std::function<Status()>& work);

}  // namespace surfeit
