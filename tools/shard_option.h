// --shard I/N.
#pragma once

#include <string>

#include "surfeit/shards.h"

namespace surfeit {

// The I-th of N. CLI::ValidationError for anything else.
ShardRange parseShard(const std::string& text);

}  // namespace surfeit
