// Page numbers, which everything in this layer goes by.
#pragma once

#include <cstdint>

namespace surfeit {

// Pages of a file are numbered from 0 without gaps, so tables are indexed by page number.
using PageNumber = std::uint32_t;

}  // namespace surfeit
