// What is to be told where clouds that become one scene have different channels.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "surfeit/surfel.h"

namespace surfeit {

// An input of the indexer.
struct MixedCloud {
  std::string path;
  CloudChannels channels;
  std::uint64_t records = 0;
};

// One note each for clouds without radiosity, without albedo, or without both (no colors), where
// another cloud has it: their surfels are dark there. Colors count as both.
std::vector<std::string> notesOfDarkClouds(std::span<const MixedCloud> clouds);

}  // namespace surfeit
