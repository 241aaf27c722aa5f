// Checks of what a caller asks of a gather.
#pragma once

#include "surfeit/gather.h"
#include "surfeit/status.h"

namespace surfeit {

// kInvalidArgument, naming the setting, what was found and what is expected.
Status checkGatherSettings(const GatherSettings& settings, bool has_environment);

}  // namespace surfeit
