// surfeit convert: clouds of one format as clouds of another.
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "surfeit/convert.h"
#include "surfeit/length_unit.h"
#include "surfeit/process.h"
#include "tools/camera_options.h"
#include "tools/channel_options.h"
#include "tools/command.h"
#include "tools/dry_run.h"
#include "tools/matrix_option.h"
#include "tools/number_list.h"
#include "tools/up_option.h"

namespace surfeit {
namespace {

using Matrix = std::array<double, 12>;  // as ConvertOptions::transform

struct ConvertArguments {
  std::vector<std::string> inputs;
  std::string output;
  double scale = 1;  // of --units
  ConvertOptions options;
  DensityArguments cameras;  // of the options' density
  bool is_dry_run = false;
};

// Metres of a unit, by name or as a number; 0 for what is none.
double metresOf(std::string_view text) {
  if (const LengthUnit* const unit = findLengthUnit(text)) return unit->metres;
  double number = 0;
  const char* const text_end = text.data() + text.size();
  const auto [end, error] = std::from_chars(text.data(), text_end, number);
  const bool ok = error == std::errc() && end == text_end && std::isfinite(number) && number > 0;
  return ok ? number : 0;
}

// "ft:m"
double parseUnits(const std::string& text) {
  const std::size_t colon = text.find(':');
  if (colon != std::string::npos) {
    const double from = metresOf(std::string_view(text).substr(0, colon));
    const double to = metresOf(std::string_view(text).substr(colon + 1));
    if (from > 0 && to > 0) return from / to;
  }
  throw CLI::ValidationError(
      "--units", fmt::format("found \"{}\", expected FROM:TO, each m, cm, mm, km, in, ft, us-ft or "
                             "the metres of a unit, such as ft:m or 0.5:m",
                             text));
}

// The map that does `b`, then `a`.
Matrix product(const Matrix& a, const Matrix& b) {
  Matrix ab;
  for (std::size_t row = 0; row < 3; ++row) {
    for (std::size_t column = 0; column < 4; ++column) {
      double sum = column == 3 ? a[4 * row + 3] : 0;
      for (std::size_t k = 0; k < 3; ++k) sum += a[4 * row + k] * b[4 * k + column];
      ab[4 * row + column] = sum;
    }
  }
  return ab;
}

Status runConvert(ConvertArguments& arguments, CommandContext& context) {
  ConvertOptions options = arguments.options;
  const double scale = arguments.scale;
  const Matrix scaling{scale, 0, 0, 0, 0, scale, 0, 0, 0, 0, scale, 0};
  options.transform = product(options.transform, scaling);
  options.memory_bytes = context.common.memory_bytes;
  SURFEIT_ASSIGN_OR_RETURN(options.density, arguments.cameras.cameraDensity());
  if (arguments.is_dry_run) {
    SURFEIT_ASSIGN_OR_RETURN(
        const SampleForecast forecast,
        forecastOf(arguments.inputs, arguments.output, options, convertClouds, context));
    return sayForecast("convert", "records", arguments.output, forecast, context);
  }
  SURFEIT_ASSIGN_OR_RETURN(
      const ConvertStats stats,
      convertClouds(arguments.inputs, arguments.output, options, context.progress()));
  const double seconds = std::max(context.wallSeconds(), 1e-9);
  context.say(fmt::format(
      "{}: {} of {} records, {} properties, {}\n"
      "{:.1f} s, {:.2f} M records/s, {:.0f} MB/s read, {:.0f} MB/s written, peak memory {}",
      arguments.output, formatCount(stats.written_records), formatCount(stats.records),
      stats.properties.size(), formatBytes(stats.output_bytes), seconds,
      double(stats.records) / seconds / 1e6, double(stats.input_bytes) / seconds / 1e6,
      double(stats.output_bytes) / seconds / 1e6, formatBytes(peakResidentBytes())));
  return context.writeStats({{"command", "convert"},
                             {"inputs", arguments.inputs},
                             {"output", arguments.output},
                             {"records", stats.records},
                             {"skipped_records", stats.skipped_records},
                             {"cropped_records", stats.cropped_records},
                             {"thinned_records", stats.thinned_records},
                             {"placeless_records", stats.placeless_records},
                             {"written_records", stats.written_records},
                             {"properties", stats.properties},
                             {"input_bytes", stats.input_bytes},
                             {"output_bytes", stats.output_bytes},
                             {"records_per_second", double(stats.records) / seconds}});
}

// Options that say where records go.
void addPlaceOptions(CLI::App& command, ConvertArguments& arguments) {
  constexpr const char* kGroup = "Places, in this order";
  command
      .add_option_function<std::string>(
          "--units", [&](const std::string& text) { arguments.scale = parseUnits(text); },
          "Scales from one unit to another: m, cm, mm, km, in, ft, us-ft or a number of metres")
      ->type_name("FROM:TO")
      ->group(kGroup);
  addUpOption(
      command, arguments.options.up,
      "Turns the cloud so that this axis is up: from the axis that it states, else from the "
      "other of y and z",
      "unchanged")
      ->group(kGroup);
  command
      .add_option_function<std::string>(
          "--transform",
          [&](const std::string& text) {
            arguments.options.transform = parseMatrix("--transform", text);
          },
          "Affine matrix, row by row; it acts on column vectors: translations end the rows")
      ->type_name("\"16 numbers\"|FILE")
      ->group(kGroup);
  command
      .add_option_function<std::string>(
          "--crop",
          [&](const std::string& text) {
            const auto n = parseNumberList<6>("--crop", text, "six numbers, x0,y0,z0,x1,y1,z1");
            arguments.options.crop = CropBox{{n[0], n[1], n[2]}, {n[3], n[4], n[5]}};
          },
          "Only positions from X0,Y0,Z0 to below X1,Y1,Z1")
      ->type_name("X0,Y0,Z0,X1,Y1,Z1")
      ->group(kGroup);
}

// Options that say what of the records is written.
void addChoiceOptions(CLI::App& command, ConvertArguments& arguments) {
  ConvertOptions& options = arguments.options;
  addChannelOptions(command, options.channels, options.part, options.filter);
  addColorRangeOption(command, options.color_range);
  command
      .add_option("--set", options.assignments,
                  "Channel arithmetic, once or more: \"radiosity *= 0.5 where group == 3\" "
                  "(= *= /= += -=; + - * / min max abs sqrt pow, comparisons)")
      ->allow_extra_args(false)
      ->type_name("ASSIGNMENT");
  CLI::Option* const every =
      command.add_option("--every", options.every, "Only records 0, N, 2N, ... of each input")
          ->type_name("N")
          ->check(CLI::Range(std::uint64_t{1}, std::uint64_t{1} << 53).description(""));
  command
      .add_option("--spacing", options.spacing,
                  "Only one record per cell of a grid of edge D: the nearest to the middle, which "
                  "stands for all records of the cell")
      ->type_name("D")
      ->excludes(every);
  CLI::Option* const spacing = command.get_option("--spacing");
  for (CLI::Option* const camera : addDensityOptions(command, arguments.cameras)) {
    camera->excludes(every)->excludes(spacing);
  }
  addTemporaryOption(command, options.temporary_directory);
  CLI::Option* const keep =
      command.add_option("--keep", options.keep, "Only these channels, and the position")
          ->type_name("NAME,...")
          ->delimiter(',')
          ->allow_extra_args(false);
  command.add_option("--drop", options.drop, "All channels but these")
      ->type_name("NAME,...")
      ->delimiter(',')
      ->allow_extra_args(false)
      ->excludes(keep);
  command
      .add_option("--like", options.like,
                  "A file whose picture windows (.exr), grid (.vdb), camera (.ptc) or header "
                  "(.las) the output gets "
                  "(default: a single input that is not moved)")
      ->type_name("FILE");
}

}  // namespace

void addConvertCommand(CLI::App& app, CommandContext& context) {
  CLI::App* command = app.add_subcommand(
      "convert", "Convert clouds from one format to another; merge, move, crop and thin them");
  const auto arguments = std::make_shared<ConvertArguments>();
  command->add_option("CLOUD", arguments->inputs, "Clouds of any format (docs/files.md)")
      ->required();
  addCloudOutputOption(*command, arguments->output, "Cloud to write", true);
  addChoiceOptions(*command, *arguments);
  addPlaceOptions(*command, *arguments);
  addDryRunOption(*command, arguments->is_dry_run);
  context.addCommonOptions(*command, {.threads = false, .works_in_place = true});
  context.addFrameOptions(*command);
  command->footer(
      "Several clouds become one with the properties of all; a property that a cloud lacks is 0.\n"
      "Clouds of any size take some MiB of memory. Only .vdb, which is held until it is written,\n"
      "and --spacing and --camera, which sort, take more, within --memory (default 2G).\n"
      "Examples:\n"
      "  surfeit convert scan.las -o scan.ply --units ft:m --up y\n"
      "  surfeit convert a.ptc b.ptc -o both.ply.zst\n"
      "  surfeit convert city.ply -o block.vdb --crop 0,0,0,100,100,50 --drop normal\n"
      "  surfeit convert tile1.las tile2.las -o even.ply --spacing 0.05\n"
      "  surfeit convert scan.ply -o shot.ply --camera \"0 1.7 9  0 1 0  50\" --pixels 1.5\n"
      "  surfeit convert in.ptc -o out.ptc --set \"radiosity *= 0.5 where group == 3\"\n"
      "  surfeit convert baked.bgeo -o thin.csv --every 100 --channels bake=radiosity");
  command->callback(
      [arguments, &context] { context.run([&] { return runConvert(*arguments, context); }); });
}

}  // namespace surfeit
