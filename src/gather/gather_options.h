// Checks of what a caller asks for.
#pragma once

#include "surfeit/gather.h"
#include "surfeit/status.h"

namespace surfeit {

// kInvalidArgument, naming the option, what was found and what is expected.
Status checkGatherOptions(const GatherOptions& options);

}  // namespace surfeit
