// What setProcessCancelled (surfeit/process.h) says, for those that read inputs.
#pragma once

namespace surfeit {

// Safe from any thread.
bool isProcessCancelled();

}  // namespace surfeit
