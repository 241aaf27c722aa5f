// surfeit ptfilter: command lines of RenderMan's ptfilter, as index and gather, or as radiance.
#include <fmt/format.h>
#include <sys/stat.h>

#include <array>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <functional>
#include <memory>
#include <string>
#include <system_error>
#include <vector>

#include "surfeit/bake.h"
#include "surfeit/bounce.h"
#include "surfeit/convert.h"
#include "surfeit/index.h"
#include "surfeit/output.h"
#include "surfeit/process.h"
#include "surfeit/radiance.h"
#include "tools/channel_options.h"
#include "tools/command.h"
#include "tools/gather_options.h"
#include "tools/number_checks.h"

namespace surfeit {
namespace {

constexpr const char* kUnused = "Without a meaning here";

// A word that changes nothing, and the reason.
struct UnusedWord {
  const char* name;
  const char* reason;
  const char* usual;  // the value that asks for what happens anyway, or ""
};
constexpr std::array kUnusedWords = {
    UnusedWord{"clamp", "no pixel counts more than once, so nothing is ever to be clamped", "1"},
    UnusedWord{"sortbleeding", "contributions are always sorted by distance", "1"},
    UnusedWord{"samplebase", "receivers are not jittered: nodes and disks are smooth already", "0"},
    UnusedWord{"bias",
               "a length there; here rays start .15 radii of each surfel above the receiver", ""},
    UnusedWord{"samples", "directions are the pixels of the raster cube (-rasterresolution)", ""},
    UnusedWord{"minsamples", "directions are the pixels of the raster cube", ""},
    UnusedWord{"seed", "nothing is random", ""},
    UnusedWord{"maxerror", "-maxvariation decides where results are interpolated", ""},
    UnusedWord{"maxpixeldist", "-maxvariation decides where results are interpolated", ""},
    UnusedWord{"hitmode", "surfels have the colors and the cover that the cloud gives them", ""},
};

struct PtfilterArguments {
  std::vector<std::string> inputs;
  std::string output, filter;
  bool is_photon_map = false;
  int bounces = 1;
  std::string channels, temporary_directory;
  int raster_resolution = 0;
  GatherOptions gather;
  RadianceOptions radiance;
  std::vector<std::pair<const UnusedWord*, std::string>> unused;
};

// A file beside other temporary ones, removed at the end. Its name follows from the output's, so
// that the next run takes away what a killed one left.
class ScratchFile {
 public:
  ScratchFile(const PtfilterArguments& arguments, const std::string& ending) {
    std::string directory = arguments.temporary_directory;
    for (const char* const variable : {"SLURM_TMPDIR", "TMPDIR"}) {
      const char* const value = std::getenv(variable);
      if (directory.empty() && value != nullptr) directory = value;
    }
    std::error_code ignored;
    const std::filesystem::path output = std::filesystem::absolute(arguments.output, ignored);
    if (directory.empty()) directory = output.parent_path().string();
    const std::size_t hash = std::hash<std::string>()(output.string());
    path_ = fmt::format("{}/surfeit-ptfilter-{:016x}{}", directory, hash, ending);
  }
  ScratchFile(const ScratchFile&) = delete;
  ScratchFile& operator=(const ScratchFile&) = delete;
  ~ScratchFile() { std::remove(path_.c_str()); }

  const std::string& path() const { return path_; }

 private:
  std::string path_;
};

// What the words mean that have no meaning here.
void tellUnused(const PtfilterArguments& arguments, Progress& progress) {
  for (const auto& [word, value] : arguments.unused) {
    const std::string text = fmt::format("-{} {}: {}", word->name, value, word->reason);
    if (value == word->usual) {
      progress.inform(text);
    } else {
      progress.note(text + ": the word is ignored");
    }
  }
}

Status takeRasterResolution(PtfilterArguments& arguments, Progress& progress) {
  if (arguments.raster_resolution == 0) return {};
  const int even = arguments.raster_resolution + arguments.raster_resolution % 2;
  if (even != arguments.raster_resolution) {
    progress.note(fmt::format("-rasterresolution {}: {} is taken, resolutions are even",
                              arguments.raster_resolution, even));
  }
  arguments.gather.quality.raster_resolution = even;
  return {};
}

void takeJob(const PtfilterArguments& arguments, const CommandContext& context, JobOptions& job) {
  job.threads = context.common.threads;
  job.memory_bytes = context.common.memory_bytes;
  job.strict = context.common.strict;
  job.temporary_directory = arguments.temporary_directory;
}

Status filterPhotons(PtfilterArguments& arguments, CommandContext& context) {
  RadianceOptions& options = arguments.radiance;
  takeJob(arguments, context, options);
  options.channels = arguments.channels;
  SURFEIT_ASSIGN_OR_RETURN(
      const RadianceStats stats,
      radianceCloud(arguments.inputs, arguments.output, options, context.progress()));
  context.say(fmt::format("{}: {} surfels from {} photons, in {:.1f} s", arguments.output,
                          formatCount(stats.surfels), formatCount(stats.photons),
                          context.wallSeconds()));
  return context.writeStats({{"command", "ptfilter"},
                             {"filter", "photonmap"},
                             {"photons", stats.photons},
                             {"surfels", stats.surfels}});
}

// surfeit index, into `scene`; with several bounces surfeit bounce, too, into `bounced`.
Status makeScene(const PtfilterArguments& arguments, CommandContext& context,
                 const std::string& scene, const std::string& bounced) {
  IndexOptions indexing;
  takeJob(arguments, context, indexing);
  indexing.channels = arguments.channels;
  SURFEIT_RETURN_IF_ERROR(
      indexClouds(arguments.inputs, scene, indexing, context.progress()).status());
  if (arguments.bounces == 1) return {};
  BounceOptions options;
  takeJob(arguments, context, options);
  options.threads = context.threads();
  options.bounces = arguments.bounces - 1;
  options.quality = arguments.gather.quality;
  return bounceScene(scene, bounced, options, context.progress()).status();
}

// One cloud of all receivers: surfeit convert.
Status mergeReceivers(const PtfilterArguments& arguments, CommandContext& context,
                      const std::string& merged) {
  ConvertOptions options;
  takeJob(arguments, context, options);
  options.channels = arguments.channels;
  return convertClouds(arguments.inputs, merged, options, context.progress()).status();
}

Status filterSurfels(PtfilterArguments& arguments, CommandContext& context) {
  SURFEIT_RETURN_IF_ERROR(takeRasterResolution(arguments, context.progress()));
  const ScratchFile scene(arguments, ".sft"), bounced(arguments, "-bounced.sft");
  const ScratchFile merged(arguments, ".ply");
  SURFEIT_RETURN_IF_ERROR(makeScene(arguments, context, scene.path(), bounced.path()));
  const bool is_merged = arguments.inputs.size() > 1;
  if (is_merged) SURFEIT_RETURN_IF_ERROR(mergeReceivers(arguments, context, merged.path()));
  GatherOptions& options = arguments.gather;
  takeJob(arguments, context, options);
  options.threads = context.threads();
  options.mode = arguments.filter == "occlusion" ? GatherMode::kOcclusion : GatherMode::kBleeding;
  if (!is_merged) options.channels = arguments.channels;
  SURFEIT_ASSIGN_OR_RETURN(const GatherStats stats,
                           gatherCloud(arguments.bounces > 1 ? bounced.path() : scene.path(),
                                       is_merged ? merged.path() : arguments.inputs.front(),
                                       arguments.output, options, context.progress()));
  context.say(fmt::format("{}: {} at {} receivers, in {:.1f} s, peak memory {}", arguments.output,
                          describeOutputs(stats.outputs), formatCount(stats.receivers),
                          context.wallSeconds(), formatBytes(peakResidentBytes())));
  return context.writeStats({{"command", "ptfilter"},
                             {"filter", arguments.filter},
                             {"receivers", stats.receivers},
                             {"invalid_receivers", stats.invalid_receivers},
                             {"interpolated_receivers", stats.interpolated_receivers}});
}

Status runPtfilter(PtfilterArguments& arguments, CommandContext& context) {
  if (arguments.is_photon_map && !arguments.filter.empty() && arguments.filter != "photonmap") {
    return Status::invalidArgument(
        fmt::format("-photonmap and -filter {}: expected one of them", arguments.filter));
  }
  if (arguments.is_photon_map) arguments.filter = "photonmap";
  if (arguments.filter.empty()) {
    return Status::invalidArgument("-filter: expected occlusion, colorbleeding or photonmap");
  }
  if (arguments.bounces > 1 && arguments.filter != "colorbleeding") {
    return Status::invalidArgument(
        fmt::format("-bounces {}: expected -filter colorbleeding, found {}", arguments.bounces,
                    arguments.filter));
  }
  tellUnused(arguments, context.progress());
  return arguments.filter == "photonmap" ? filterPhotons(arguments, context)
                                         : filterSurfels(arguments, context);
}

void addWeightWords(CLI::App& command, GatherWeights& weights) {
  using Distribution = GatherWeights::Distribution;
  using FalloffMode = GatherWeights::FalloffMode;
  command
      .add_option("--coneangle", weights.cone_angle,
                  "Half the opening angle of the cone that counts, radians")
      ->check(CLI::Range(0.0, 1.571))
      ->default_str("pi / 2");
  command.add_option("--falloff", weights.falloff, "Occlusion fades with distance at this rate")
      ->check(kNonNegativeNumber)
      ->capture_default_str();
  addChoice<FalloffMode>(command, "--falloffmode", weights.falloff_mode,
                         "0: exp(-falloff * distance); 1: (1 - distance / maxdist) ^ falloff",
                         {{"0", FalloffMode::kExponential}, {"1", FalloffMode::kPolynomial}});
  addChoice<Distribution>(command, "--distribution", weights.distribution, "Weights of directions",
                          {{"cosine", Distribution::kCosine}, {"uniform", Distribution::kUniform}});
}

void addGatherWords(CLI::App& command, PtfilterArguments& arguments) {
  GatherOptions& options = arguments.gather;
  options.quality.sides = GatherSides::kBoth;
  command
      .add_option("--maxsolidangle", options.quality.max_solid_angle,
                  "Largest cluster that counts as a whole, in steradians (gather "
                  "--max-solid-angle)")
      ->check(CLI::Range(0.0, 6.3))
      ->capture_default_str();
  command
      .add_option("--rasterresolution,--microbufres", arguments.raster_resolution,
                  "Pixels along a face of the raster cube (gather --raster-resolution)")
      ->check(CLI::Range(2, 64))
      ->default_str("16");
  command
      .add_option("--maxdist", options.quality.max_distance, "Surfels farther away do not count")
      ->check(kPositiveNumber);
  addChoice<GatherSides>(
      command, "--hitsides", options.quality.sides, "Sides of surfels that cover (gather --sides)",
      {{"both", GatherSides::kBoth}, {"front", GatherSides::kFront}, {"back", GatherSides::kBack}});
  addWeightWords(command, options.weights);
  command
      .add_option("--maxvariation", options.quality.max_variation,
                  "Interpolate, off by at most this at 99 % of the receivers; 0: nowhere")
      ->check(CLI::Range(0.0, 1.0))
      ->capture_default_str();
  command.add_option("--envmap", options.environment.path,
                     "Picture of the surroundings, .exr or .hdr (gather --environment)");
  command
      .add_option("--bounces", arguments.bounces,
                  "Bounces of light in all, with -filter colorbleeding (surfeit bounce)")
      ->check(CLI::Range(1, 101))
      ->capture_default_str();
}

void addUnusedWords(CLI::App& command, PtfilterArguments& arguments) {
  for (const UnusedWord& word : kUnusedWords) {
    command
        .add_option_function<std::string>(
            std::string("--") + word.name,
            [&arguments, &word](const std::string& value) {
              arguments.unused.emplace_back(&word, value);
            },
            word.reason)
        ->type_name("VALUE")
        ->group(kUnused);
  }
}

}  // namespace

void addPtfilterCommand(CLI::App& app, CommandContext& context) {
  CLI::App* command = app.add_subcommand(
      "ptfilter", "Command lines of RenderMan's ptfilter: index and gather, or radiance, in one");
  const auto arguments = std::make_shared<PtfilterArguments>();
  command->add_option("CLOUD", arguments->inputs, "Point clouds; several are merged")->required();
  addCloudOutputOption(*command, arguments->output, "The last word, or behind -o: cloud");
  command->add_option("--filter", arguments->filter, "What is computed")
      ->check(CLI::IsMember({"occlusion", "colorbleeding", "photonmap"}));
  command->add_flag("--photonmap", arguments->is_photon_map, "The same as -filter photonmap");
  addGatherWords(*command, *arguments);
  command
      ->add_option("--nphotons", arguments->radiance.photons_per_estimate,
                   "Photons per estimate, with -filter photonmap")
      ->check(CLI::Range(1, 10000))
      ->capture_default_str();
  command->add_option("--channels", arguments->channels, "New names for channels: FROM=TO,FROM=TO")
      ->type_name("FROM=TO");
  addTemporaryOption(*command, arguments->temporary_directory);
  addUnusedWords(*command, *arguments);
  context.addCommonOptions(*command);
  command->footer(
      "Options have one dash or two, and the output is the last word. Points are lit by all "
      "points\n"
      "of the inputs; the scene between is a temporary file. `surfeit gather` has more options, "
      "and\n"
      "keeps the scene for other receivers. docs/renderman.md has the words.\n"
      "Examples:\n"
      "  surfeit ptfilter -filter occlusion -maxsolidangle 0.05 -maxdist 10 area.ptc ao.ptc\n"
      "  surfeit ptfilter -filter colorbleeding -clamp 1 -sortbleeding 1 -maxsolidangle 0.05 \\\n"
      "      radiosity.ptc bleeding.ptc\n"
      "  surfeit ptfilter -photonmap -nphotons 100 cornell.gpm.ptc radiosity.ptc");
  command->callback(
      [arguments, &context] { context.run([&] { return runPtfilter(*arguments, context); }); });
}

}  // namespace surfeit
