// A whole cloud read once, batch by batch.
#pragma once

#include <cstddef>
#include <functional>
#include <span>

#include "surfeit/progress.h"
#include "surfeit/status.h"
#include "view/cloud_rows.h"

namespace surfeit {

// Visits all rows from the first on, as a phase of the progress. kInterrupted when cancelled.
Status streamRows(CloudRows& rows, const char* phase, Progress& progress,
                  const std::function<void(std::span<const std::byte>)>& visit);

}  // namespace surfeit
