// LZF, by which PCL compresses clouds: literal bytes and copies of what came up to 8 KiB before.
// liblzf decodes from memory to memory only, which a cloud need not fit.
#pragma once

#include <cstdint>

#include "storage/byte_input.h"
#include "storage/file.h"
#include "surfeit/status.h"

namespace surfeit {

// Decodes the bytes [offset, offset + size) of `input` to the end of `output`. Safe on arbitrary
// bytes; takes 0.5 MiB. kCorruption unless they are `expected` bytes afterwards.
Status decodeLzf(ByteInput& input, std::uint64_t offset, std::uint64_t size, std::uint64_t expected,
                 TemporaryFile& output);

}  // namespace surfeit
