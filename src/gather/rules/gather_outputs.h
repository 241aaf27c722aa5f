// The outputs of a gather by name: how options and properties of clouds call them, and where they
// stand in a GatherResult.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "gather/rules/receiver.h"
#include "surfeit/gather.h"

namespace surfeit {

// An output's floats in a GatherResult.
struct OutputColumns {
  GatherOutput output;
  std::string_view word;     // of the option
  std::size_t first, count;  // floats of GatherResult
};
std::span<const OutputColumns> outputColumns();

// The outputs that are asked for; where that is left open, what the mode usually gives, and light
// of the environment where there is one.
std::uint32_t settledOutputs(const GatherSettings& settings, bool has_environment);

// Floats that a set of outputs takes when packed, and their names as properties, in that order.
std::size_t resultFloats(std::uint32_t outputs);
std::vector<std::string> resultNames(std::uint32_t outputs, GatherMode mode);

// Between results and packed rows of resultFloats(); what is not of the outputs becomes zero.
void packResult(const GatherResult& result, std::uint32_t outputs, float* row);
GatherResult unpackResult(const float* row, std::uint32_t outputs);

}  // namespace surfeit
