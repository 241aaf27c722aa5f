#include "tools/gather_options.h"

#include <string>
#include <utility>
#include <vector>

#include "surfeit/group_names.h"
#include "surfeit/scene.h"
#include "surfeit/surfel.h"
#include "tools/channel_options.h"
#include "tools/command.h"
#include "tools/number_checks.h"
#include "tools/number_list.h"

namespace surfeit {
namespace {

constexpr const char* kPagingGroup = "Paging";

}  // namespace

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
          "Sets the options below that are not given, except --bias, --max-dist and --sides")
      ->type_name("draft|standard|final")
      ->default_str("standard")
      ->group(kGroup);
  command
      .add_option("--max-solid-angle,--maxsolidangle", quality.max_solid_angle,
                  "Largest node drawn as a whole, in steradians; 0 opens every node")
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
      .add_option("--max-dist,--maxdist", quality.max_distance,
                  "Surfels farther away do not count, in scene units")
      ->check(kPositiveNumber)
      ->group(kGroup);
  addChoice<GatherSides>(
      command, "--sides", quality.sides, "Sides of surfels that cover",
      {{"front", GatherSides::kFront}, {"both", GatherSides::kBoth}, {"back", GatherSides::kBack}})
      ->group(kGroup);
}

namespace {

// A list of numbers does not need the scene. One that cannot be read is the command's to refuse.
Result<std::uint64_t> chosenGroups(const std::string& text, const std::string& scene) {
  Result<std::uint64_t> numbers = parseGroups(text);
  const bool has_names = text.find_first_not_of("0123456789,-+. ") != text.npos;
  if (numbers.ok() || !has_names) return numbers;
  const Result<std::vector<GroupName>> names = readGroupNames(scene);
  if (!names.ok()) return kAllGroups;
  return parseGroupNames(text, *names);
}

}  // namespace

void addSubsetOption(CLI::App& command, std::uint64_t& groups, const std::string& scene) {
  command
      .add_option_function<std::string>(
          "--subset",
          [&groups, &scene](const std::string& found) {
            const Result<std::uint64_t> chosen = chosenGroups(found, scene);
            if (!chosen.ok()) throw CLI::ValidationError("--subset", chosen.status().message());
            groups = *chosen;
          },
          "Object groups that send light and cover, such as 0,2-5 or lamp,tree (index --group); "
          "other surfels are ignored")
      ->type_name("GROUPS")
      ->default_str("all");
}

namespace {

// "key=2,fill,3=.5": of groups, by number or name, that have no value of their own that of the
// next.
std::vector<GroupGain> parseGains(const std::string& text, const std::string& scene) {
  const auto refuse = [](const std::string& why) { return CLI::ValidationError("--gain", why); };
  std::vector<GroupGain> gains;
  std::string groups;
  for (const std::string& part : CLI::detail::split(text, ',')) {
    const std::size_t equals = part.rfind('=');
    groups += (groups.empty() ? "" : ",") + part.substr(0, equals);
    if (equals == part.npos) continue;
    const float gain =
        float(parseNumberList<1>("--gain", part.substr(equals + 1), "NAME=GAIN, such as key=2")[0]);
    const Result<std::uint64_t> chosen = chosenGroups(groups, scene);
    if (!chosen.ok()) throw refuse(chosen.status().message());
    for (std::uint32_t group = 0; group < kMaxGroups; ++group) {
      if ((*chosen & groupBit(group)) != 0) gains.push_back({group, gain});
    }
    groups.clear();
  }
  if (gains.empty() || !groups.empty()) {
    throw refuse("found \"" + text + "\", expected NAME=GAIN,..., such as key=2,fill=.5");
  }
  return gains;
}

}  // namespace

void addGainOption(CLI::App& command, std::vector<GroupGain>& gains, const std::string& scene) {
  command
      .add_option_function<std::string>(
          "--gain", [&gains, &scene](const std::string& text) { gains = parseGains(text, scene); },
          "Factors of the light that object groups send, direct light included, by name or number: "
          "key=2,fill=.5")
      ->type_name("NAME=GAIN,...");
}

void addCacheOptions(CLI::App& command, double& cache_split, bool& direct_io) {
  command
      .add_option("--cache-split", cache_split,
                  "Part of the cache memory for nodes, 0 to 1 (default: found by measurement)")
      ->check(CLI::Range(0.0, 1.0))
      ->default_str("")
      ->group(kPagingGroup);
  command.add_flag("--direct-io", direct_io, "Read the scene past the page cache of the system")
      ->group(kPagingGroup);
}

namespace {

void addPagingOptions(CLI::App& command, GatherOptions& options) {
  addChoice<ReceiverOrder>(command, "--order", options.order,
                           "Order in which receivers are gathered",
                           {{"hilbert", ReceiverOrder::kHilbert},
                            {"morton", ReceiverOrder::kMorton},
                            {"input", ReceiverOrder::kInput}})
      ->group(kPagingGroup);
  addCacheOptions(command, options.cache_split, options.direct_io);
  command
      .add_flag("--prefetch,!--no-prefetch", options.prefetch,
                "Read ahead in this order when reading is slow (default: on)")
      ->group(kPagingGroup);
  addTemporaryOption(command, options.temporary_directory)->group(kPagingGroup);
}

}  // namespace

void addStageOptions(CLI::App& command, GatherOptions& options) {
  command
      .add_option(
          "--stage", options.stage_directory,
          "Keep the pages of the scene that are read in this directory of the node, and read "
          "them there when they are read again, by any task; \"$NAME/...\" begins with a "
          "variable of the environment")
      ->type_name("DIR")
      ->group(kPagingGroup);
  const auto parse = [&options](const std::string& text) {
    const Result<std::uint64_t> bytes = parseMemory(text);
    if (!bytes.ok() || text.ends_with('%')) {
      throw CLI::ValidationError("--stage-limit",
                                 "found \"" + text + "\", expected a size such as 20G");
    }
    options.stage_limit_bytes = *bytes;
  };
  command
      .add_option_function<std::string>(
          "--stage-limit", parse,
          "Most bytes of all such copies in that directory (default: nine tenths of the disk)")
      ->type_name("SIZE")
      ->group(kPagingGroup);
}

Status expandStage(GatherOptions& options) {
  std::string& directory = options.stage_directory;
  if (directory.empty() && options.stage_limit_bytes > 0) {
    return Status::invalidArgument("--stage-limit is of --stage, expected both");
  }
  if (!directory.starts_with('$')) return {};
  const std::size_t end = std::min(directory.find('/'), directory.size());
  const char* const value = std::getenv(directory.substr(1, end - 1).c_str());
  if (value == nullptr || *value == '\0') {
    return Status::invalidArgument(fmt::format(
        "--stage: found \"{}\", expected a variable of the environment that is set", directory));
  }
  directory = value + directory.substr(end);
  return {};
}

void addModeOption(CLI::App& command, GatherMode& mode) {
  addChoice<GatherMode>(command, "--mode", mode, "What is gathered",
                        {{"occlusion", GatherMode::kOcclusion},
                         {"bleeding", GatherMode::kBleeding},
                         {"glossy", GatherMode::kGlossy}});
}

void addGatherOptions(CLI::App& command, GatherOptions& options) {
  addModeOption(command, options.mode);
  addChannelOptions(command, options.channels, options.part, options.filter);
  addColorRangeOption(command, options.color_range);
  addQualityOptions(command, options.quality);
  addPagingOptions(command, options);
}

const char* modeName(GatherMode mode) {
  switch (mode) {
    case GatherMode::kBleeding:
      return "bleeding";
    case GatherMode::kGlossy:
      return "glossy";
    case GatherMode::kOcclusion:
      break;
  }
  return "occlusion";
}

}  // namespace surfeit
