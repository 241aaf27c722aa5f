#include "tools/gather_options.h"

#include <string>
#include <utility>
#include <vector>

namespace surfeit {
namespace {

// An option that takes one of some words, of which the first is the default.
template <typename Value>
CLI::Option* addChoice(CLI::App& command, const std::string& name, Value& target,
                       const std::string& help,
                       const std::vector<std::pair<std::string, Value>>& choices) {
  std::string words;
  for (const auto& [word, value] : choices) words += (words.empty() ? "" : "|") + word;
  const auto choose = [=, &target](const std::string& found) {
    for (const auto& [word, value] : choices) {
      if (found != word) continue;
      target = value;
      return;
    }
    throw CLI::ValidationError(name, found + ", expected " + words);
  };
  return command.add_option_function<std::string>(name, choose, help)
      ->type_name(words)
      ->default_str(choices.front().first);
}

void addQualityOptions(CLI::App& command, GatherQuality& quality) {
  constexpr const char* kGroup = "Quality";
  // First, so that options that are given themselves come after and win
  const std::vector<std::pair<std::string, QualityPreset>> presets = {
      {"draft", QualityPreset::kDraft},
      {"standard", QualityPreset::kStandard},
      {"final", QualityPreset::kFinal}};
  command
      .add_option_function<std::string>(
          "--quality",
          [presets, &quality](const std::string& found) {
            for (const auto& [word, preset] : presets) {
              if (found == word) return setQuality(preset, quality);
            }
            throw CLI::ValidationError("--quality", found + ", expected draft|standard|final");
          },
          "Sets the options below that are not given, but for --bias, --max-dist and --sides")
      ->type_name("draft|standard|final")
      ->default_str("standard")
      ->group(kGroup);
  command
      .add_option("--max-solid-angle,--maxsolidangle", quality.max_solid_angle,
                  "Largest cluster drawn as one, in steradians; 0 opens all")
      ->check(CLI::Range(0.0, 6.3))
      ->capture_default_str()
      ->group(kGroup);
  command
      .add_option("--raster-resolution,--rasterresolution", quality.raster_resolution,
                  "Pixels along a cube face, even, 2 to 64")
      ->check(CLI::Range(2, 64))
      ->capture_default_str()
      ->group(kGroup);
  command.add_option("--bias", quality.bias, "Start of rays above the receiver, in surfel radii")
      ->check(CLI::Range(0.0, 10.0))
      ->capture_default_str()
      ->group(kGroup);
  command
      .add_option("--near-field", quality.near_field_radii,
                  "Surfels closer than this many radii are ray traced")
      ->check(CLI::Range(0.0, 100.0))
      ->capture_default_str()
      ->group(kGroup);
  command
      .add_option("--far-parallax", quality.far_field_parallax,
                  "Neighbours share a far field where that moves it by less than this part of a "
                  "pixel; 0: none do")
      ->check(CLI::Range(0.0, 10.0))
      ->capture_default_str()
      ->group(kGroup);
  command
      .add_option("--max-dist,--maxdist", quality.max_distance,
                  "Surfels farther away do not count, in scene units")
      ->check(CLI::PositiveNumber)
      ->group(kGroup);
  addChoice<GatherSides>(command, "--sides", quality.sides, "Sides of surfels that cover",
                         {{"front", GatherSides::kFront}, {"both", GatherSides::kBoth}})
      ->group(kGroup);
}

void addPagingOptions(CLI::App& command, GatherOptions& options) {
  constexpr const char* kGroup = "Paging";
  addChoice<ReceiverOrder>(command, "--order", options.order,
                           "Order in which receivers are gathered",
                           {{"hilbert", ReceiverOrder::kHilbert},
                            {"morton", ReceiverOrder::kMorton},
                            {"input", ReceiverOrder::kInput}})
      ->group(kGroup);
  command
      .add_option("--cache-split", options.cache_split,
                  "Share of the cache memory for nodes, 0 to 1; else found by measurement")
      ->check(CLI::Range(0.0, 1.0))
      ->default_str("")
      ->group(kGroup);
  command
      .add_flag("--direct-io", options.direct_io,
                "Read the scene past the page cache of the system")
      ->group(kGroup);
  command
      .add_flag("--prefetch,!--no-prefetch", options.prefetch,
                "Read ahead along the order when reading is slow (default: on)")
      ->group(kGroup);
  command
      .add_option("--temp", options.temporary_directory,
                  "Directory of temporary files, for what does not fit the memory")
      ->group(kGroup);
}

}  // namespace

void addGatherOptions(CLI::App& command, GatherOptions& options) {
  addChoice<GatherMode>(
      command, "--mode", options.mode, "What is gathered",
      {{"occlusion", GatherMode::kOcclusion}, {"bleeding", GatherMode::kBleeding}});
  command.add_flag("--strict", options.strict,
                   "Refuse invalid receivers instead of writing NaN for them");
  addQualityOptions(command, options.quality);
  addPagingOptions(command, options);
}

const char* modeName(GatherMode mode) {
  return mode == GatherMode::kBleeding ? "bleeding" : "occlusion";
}

}  // namespace surfeit
