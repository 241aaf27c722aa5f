// Memory of a gatherer.
#pragma once

#include <cstdint>

#include "gather/rules/gather_rules.h"

namespace surfeit {

// Bytes that a gatherer of these rules takes, beside pages: its tables, stack and allocator. A cut
// larger than it has room for from the start is foreseen by estimate: some layers of surfaces, seen
// in pieces of about the max solid angle, and no more than there are surfels. With a max solid
// angle of 0 it is the whole scene.
std::uint64_t gathererBytes(const GatherRules& rules, std::uint64_t surfels);

}  // namespace surfeit
