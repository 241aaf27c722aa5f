// Built slabs as bytes, on their way from the machine that built them to the one that stitches.
// They live as long as a job of one version of the program; docs/format.md has nothing of them.
#pragma once

#include <cstddef>
#include <vector>

#include "octree/build/slab_builder.h"
#include "storage/file.h"
#include "surfeit/status.h"

namespace surfeit {

// The bytes of a slab, replaced.
void encodeBuiltSlab(const BuiltSlab& slab, std::vector<std::byte>& bytes);

// Replaces `slab`. The bytes are those of encodeBuiltSlab: a checksum has said so. kCorruption when
// their parts do not fill them.
Status decodeBuiltSlab(Bytes bytes, BuiltSlab& slab);

}  // namespace surfeit
