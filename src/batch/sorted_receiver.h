// Receivers as they are sorted: along the curve, by an ExternalSorter.
#pragma once

#include <cstdint>

#include "core/curve_key.h"
#include "gather/rules/receiver.h"
#include "storage/external_sorter.h"

namespace surfeit {

// A receiver, its place on the curve, and its index in the input, which no other one has.
struct SortedReceiver {
  CurveKey key = 0;
  std::uint64_t index = 0;
  LocalReceiver receiver;
  std::uint32_t reserved = 0;  // no padding: receivers are written as bytes
};
static_assert(sizeof(SortedReceiver) == 56);

}  // namespace surfeit
