// Memory of a gatherer.
#pragma once

#include <cstddef>
#include <cstdint>

#include "gather/rules/gather_rules.h"

namespace surfeit {

// Bytes of a cut beyond what a raster has room for from the start, by estimate: some layers of
// surfaces, seen in pieces of about the max solid angle, and no more than there are surfels. With a
// max solid angle of 0 it is the whole scene. Each piece is a patch and so many bytes beside it.
std::uint64_t largeCutBytes(const GatherRules& rules, std::uint64_t surfels,
                            std::size_t bytes_beside_patch);

// Bytes that a gatherer of these rules takes, beside pages: its tables, a large cut, stack and
// allocator.
std::uint64_t gathererBytes(const GatherRules& rules, std::uint64_t surfels);

}  // namespace surfeit
