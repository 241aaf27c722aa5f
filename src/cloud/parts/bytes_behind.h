// Bytes that stand behind all that a file says it holds.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>

#include "storage/byte_input.h"
#include "surfeit/status.h"

namespace surfeit {

// What is told of so many bytes behind the last of `things` ("particle"); empty for none.
std::string noteOfBytesBehind(std::uint64_t bytes, std::string_view thing);

// How many bytes of a compressed file decode to are known at its end alone, after all notes: bytes
// behind `end` are refused, kCorruption. Plain files pass.
Status checkNothingBehind(ByteInput& input, std::uint64_t end, std::string_view thing);

}  // namespace surfeit
