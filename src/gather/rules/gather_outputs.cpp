#include "gather/rules/gather_outputs.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <bit>

#include "gather/rules/gather_rules.h"

namespace surfeit {
namespace {

constexpr std::array<OutputColumns, 7> kColumns = {{
    {kOutputOcclusion, "occlusion", 0, 1},
    {kOutputIrradiance, "irradiance", 1, 3},
    {kOutputBentNormal, "bent_normal", 4, 3},
    {kOutputIlluminationDirection, "illumination_direction", 7, 3},
    {kOutputEnvironment, "environment", 10, 3},
    {kOutputFluence, "fluence", 13, 3},
    {kOutputRadianceSh, "radiance_sh", 16, 3 * kShCount},
}};

using ResultArray = std::array<float, kResultFloats>;

}  // namespace

std::span<const OutputColumns> outputColumns() { return kColumns; }

std::string describeOutputs(std::uint32_t outputs) {
  std::string words;
  for (const OutputColumns& columns : kColumns) {
    if ((outputs & columns.output) == 0) continue;
    words += (words.empty() ? "" : ",") + std::string(columns.word);
  }
  return words;
}

Result<std::uint32_t> parseOutputs(std::string_view words) {
  std::uint32_t outputs = 0;
  while (!words.empty()) {
    const std::string_view word = words.substr(0, words.find(','));
    words.remove_prefix(std::min(words.size(), word.size() + 1));
    const auto found =
        std::find_if(kColumns.begin(), kColumns.end(),
                     [word](const OutputColumns& columns) { return columns.word == word; });
    if (found == kColumns.end()) {
      return Status::invalidArgument(
          fmt::format("found \"{}\", expected some of {}", word, describeOutputs(kAllOutputs)));
    }
    outputs |= found->output;
  }
  return outputs;
}

std::uint32_t settledOutputs(const GatherSettings& settings, bool has_environment) {
  if (settings.outputs != 0) return settings.outputs;
  return usualOutputs(settings.mode) | (has_environment ? kOutputEnvironment : 0u);
}

std::size_t resultFloats(std::uint32_t outputs) {
  std::size_t sum = 0;
  for (const OutputColumns& columns : kColumns) {
    if ((outputs & columns.output) != 0) sum += columns.count;
  }
  return sum;
}

std::vector<std::string> resultNames(std::uint32_t outputs, GatherMode mode) {
  constexpr std::string_view kColors = "rgb", kAxes = "xyz";
  std::vector<std::string> names;
  for (const OutputColumns& columns : kColumns) {
    if ((outputs & columns.output) == 0) continue;
    if (columns.count == 1) names.emplace_back(columns.word);
    if (columns.count == 3) {
      const bool is_direction =
          columns.output == kOutputBentNormal || columns.output == kOutputIlluminationDirection;
      const bool is_reflection = columns.output == kOutputIrradiance && mode == GatherMode::kGlossy;
      for (const char letter : is_direction ? kAxes : kColors) {
        names.push_back(fmt::format("{}_{}", is_reflection ? "reflection" : columns.word, letter));
      }
    }
    if (columns.count > 3) {
      for (int i = 0; i < kShCount; ++i) {
        for (const char letter : kColors) names.push_back(fmt::format("sh{}_{}", i, letter));
      }
    }
  }
  return names;
}

void packResult(const GatherResult& result, std::uint32_t outputs, float* row) {
  const auto values = std::bit_cast<ResultArray>(result);
  for (const OutputColumns& columns : kColumns) {
    if ((outputs & columns.output) == 0) continue;
    for (std::size_t i = 0; i < columns.count; ++i) *row++ = values[columns.first + i];
  }
}

GatherResult unpackResult(const float* row, std::uint32_t outputs) {
  ResultArray values{};
  for (const OutputColumns& columns : kColumns) {
    if ((outputs & columns.output) == 0) continue;
    for (std::size_t i = 0; i < columns.count; ++i) values[columns.first + i] = *row++;
  }
  return std::bit_cast<GatherResult>(values);
}

}  // namespace surfeit
