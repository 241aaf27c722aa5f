// surfeit tune: how much memory a gather needs.
#include <fmt/format.h>

#include <cmath>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "surfeit/line_plot.h"
#include "surfeit/output.h"
#include "surfeit/tune.h"
#include "tools/command.h"
#include "tools/gather_options.h"
#include "tools/light_options.h"
#include "tools/number_checks.h"

namespace surfeit {
namespace {

struct TuneArguments {
  std::string scene, receivers, plot;
  bool json = false;
  TuneOptions options;
};

std::uint64_t wholeBytes(double bytes) { return static_cast<std::uint64_t>(std::llround(bytes)); }

// As --memory takes it; rows of advice are whole MiB.
std::string memoryOption(std::uint64_t bytes) {
  return fmt::format("{}M", (bytes + (1 << 20) - 1) >> 20);
}

nlohmann::json cacheJson(const TuneCache& cache) {
  return {{"frame_bytes", cache.frame_bytes},
          {"requests", std::llround(cache.requests)},
          {"loads", std::llround(cache.loads)},
          {"hit_rate", cache.hitRate()},
          {"bytes_read", wholeBytes(cache.bytes_read)}};
}

nlohmann::json outcomeJson(const TuneOutcome& outcome) {
  return {{"node_cache", cacheJson(outcome.node_cache)},
          {"surfel_cache", cacheJson(outcome.surfel_cache)},
          {"bytes_read", wholeBytes(outcome.bytesRead())},
          {"seconds", outcome.seconds}};
}

nlohmann::json rowJson(const TuneRow& row) {
  nlohmann::json json = {{"memory_bytes", row.memory_bytes},
                         {"cache_bytes", row.cache_bytes},
                         {"predicted", outcomeJson(row.predicted)}};
  if (row.measured) json["measured"] = outcomeJson(*row.measured);
  return json;
}

nlohmann::json reportJson(const TuneReport& report) {
  nlohmann::json rows = nlohmann::json::array(), curve = nlohmann::json::array();
  for (const TuneRow& row : report.rows) rows.push_back(rowJson(row));
  for (const TuneRow& row : report.curve) curve.push_back(rowJson(row));
  nlohmann::json json = {{"command", "tune"},
                         {"receivers", report.receivers},
                         {"invalid_receivers", report.invalid_receivers},
                         {"sampled_receivers", report.sampled_receivers},
                         {"sample_seconds", report.sample_seconds},
                         {"memory_bytes", report.memory_bytes},
                         {"decoded_cache_bytes", report.decoded_cache_bytes},
                         {"receiver_seconds", report.receiver_seconds},
                         {"node_load_seconds", report.node_load_seconds},
                         {"surfel_load_seconds", report.surfel_load_seconds},
                         {"rows", std::move(rows)},
                         {"curve", std::move(curve)},
                         {"knee", rowJson(report.knee)},
                         {"recommended", rowJson(report.recommended)}};
  if (report.hitRateError()) json["hit_rate_error"] = *report.hitRateError();
  return json;
}

std::string outcomeCells(const TuneOutcome& outcome) {
  return fmt::format("{:>11.4f}{:>11.4f}{:>12}{:>10.1f}", 100 * outcome.node_cache.hitRate(),
                     100 * outcome.surfel_cache.hitRate(),
                     formatBytes(wholeBytes(outcome.bytesRead())), outcome.seconds);
}

std::string rowLines(const TuneReport& report, const TuneRow& row, const char* name) {
  const double part = 100 * double(row.cache_bytes) / double(report.decoded_cache_bytes);
  std::string lines = fmt::format("\n  {:12}{:>9}{:>9.2f}%{}", name, memoryOption(row.memory_bytes),
                                  part, outcomeCells(row.predicted));
  if (row.measured) {
    lines += fmt::format("\n  {:>31}{}", "measured", outcomeCells(*row.measured));
  }
  return lines;
}

std::string table(const TuneReport& report) {
  std::string text = fmt::format("  {:12}{:>9}{:>10}{:>11}{:>11}{:>12}{:>10}", "", "--memory",
                                 "caches", "nodes %", "surfels %", "read", "seconds");
  for (std::size_t i = 0; i < report.rows.size(); ++i) {
    text += rowLines(report, report.rows[i], i == 0 ? "least" : "");
  }
  text += rowLines(report, report.knee, "knee");
  text += rowLines(report, report.recommended, "recommended");
  return text;
}

std::string advice(const TuneArguments& arguments, const TuneReport& report) {
  return fmt::format(
      "surfeit gather {} {} --memory {}: the least with a predicted time within {:.0f} % of that "
      "with all in memory",
      arguments.scene, arguments.receivers, memoryOption(report.recommended.memory_bytes),
      100 * kTuneTimeMargin);
}

// Predicted values as a line, and measured ones as dots.
template <typename Value>
void addSeries(LinePlot& plot, const TuneReport& report, const std::string& label, Value&& value) {
  PlotSeries predicted{.label = label, .points = {}, .has_line = true};
  PlotSeries measured{.label = label + ", measured", .points = {}, .has_line = false};
  for (const TuneRow& row : report.curve) {
    predicted.points.push_back({double(row.cache_bytes), value(row.predicted)});
  }
  for (const TuneRow& row : report.rows) {
    if (row.measured) {
      measured.points.push_back({double(row.cache_bytes), value(*row.measured)});
    }
  }
  plot.series.push_back(std::move(predicted));
  if (!measured.points.empty()) plot.series.push_back(std::move(measured));
}

Status writePlot(const TuneArguments& arguments, const TuneReport& report) {
  std::vector<PlotMarker> markers = {{"knee", double(report.knee.cache_bytes)},
                                     {"recommended", double(report.recommended.cache_bytes)}};
  if (markers[0].bytes > markers[1].bytes) std::swap(markers[0], markers[1]);
  const auto plot = [&](const char* title, const char* label, const char* unit, bool is_log) {
    return LinePlot{.title = title,
                    .bytes_label = "memory of both caches",
                    .value_label = label,
                    .value_unit = unit,
                    .is_logarithmic = is_log,
                    .series = {},
                    .markers = markers};
  };
  std::vector<LinePlot> plots = {plot("Misses", "of requests", " %", true),
                                 plot("Read", "GiB", "", true), plot("Time", "seconds", "", false)};
  const auto percent = [](const TuneCache& cache) { return 100 * (1 - cache.hitRate()); };
  addSeries(plots[0], report, "nodes",
            [&](const TuneOutcome& outcome) { return percent(outcome.node_cache); });
  addSeries(plots[0], report, "surfels",
            [&](const TuneOutcome& outcome) { return percent(outcome.surfel_cache); });
  addSeries(plots[1], report, "read",
            [](const TuneOutcome& outcome) { return outcome.bytesRead() / (1 << 30); });
  addSeries(plots[2], report, "time", [](const TuneOutcome& outcome) { return outcome.seconds; });
  const std::string svg =
      encodeSvg(fmt::format("{} with {}", arguments.scene, arguments.receivers), plots);
  return writeOutput(arguments.plot, svg);
}

Status runTune(TuneArguments& arguments, CommandContext& context) {
  GatherOptions& gather = arguments.options.gather;
  gather.threads = context.threads();
  gather.strict = context.common.strict;
  gather.memory_bytes = context.common.memory_bytes;
  SURFEIT_ASSIGN_OR_RETURN(
      const TuneReport report,
      tuneGather(arguments.scene, arguments.receivers, arguments.options, context.progress()));
  std::string error_line;
  if (report.hitRateError()) {
    error_line = fmt::format(
        "\nhit rates are off by {:.4f} percentage points in the mean, but for the least budget",
        *report.hitRateError());
  }
  context.answer(fmt::format(
      "{}: {} of {} receivers sampled in {:.1f} s; {:.1f} us per receiver with {} threads, {:.0f} "
      "us to load a node page, {:.0f} us a surfel page\n{}{}\n{}",
      arguments.receivers, formatCount(report.sampled_receivers), formatCount(report.receivers),
      report.sample_seconds, 1e6 * report.receiver_seconds, report.threads,
      1e6 * report.node_load_seconds, 1e6 * report.surfel_load_seconds, table(report), error_line,
      advice(arguments, report)));
  if (!arguments.plot.empty()) SURFEIT_RETURN_IF_ERROR(writePlot(arguments, report));
  nlohmann::json fields = reportJson(report);
  if (arguments.json) context.answer(jsonText(fields));
  return context.writeStats(std::move(fields));
}

}  // namespace

void addTuneCommand(CLI::App& app, CommandContext& context) {
  CLI::App* command = app.add_subcommand("tune", "Find out how much memory a gather needs");
  const auto arguments = std::make_shared<TuneArguments>();
  TuneOptions& options = arguments->options;
  command->add_option("SCENE", arguments->scene, "Scene file (.sft)")->required();
  command
      ->add_option("RECEIVERS", arguments->receivers,
                   "Cloud with x y z and nx ny nz, passes (.exr) or volumes (.vdb); docs/files.md")
      ->required();
  command
      ->add_option("--sample", options.sample_receivers,
                   "Receivers whose look-ups are followed; 0: all")
      ->check(kNonNegativeNumber)
      ->capture_default_str();
  command->add_flag(
      "--check", options.check,
      "Run the gather in every budget of the table, without writing results, to compare");
  command->add_option("--plot", arguments->plot, "Plot misses, bytes read and time (SVG)");
  command->add_flag("--json", arguments->json, "Print the report as JSON on stdout");
  addGatherOptions(*command, options.gather);
  addLightOptions(*command, options.gather);
  addSubsetOption(*command, options.gather.groups, arguments->scene);
  addGainOption(*command, options.gather.gains, arguments->scene);
  context.addCommonOptions(*command);
  command->footer(
      "Follows the look-ups of a sample of the receivers, and predicts hit rates, bytes read and\n"
      "time of a gather, in budgets from the least that works to the whole scene in memory.\n"
      "`knee`: beyond it more memory hardly saves a read. `recommended`: the smallest budget "
      "within\n"
      "5 % of the best time. Pages may come from the page cache of the system; --direct-io times\n"
      "the device itself. --memory bounds the tuning itself.\n"
      "Examples:\n"
      "  surfeit tune city.sft street.ply\n"
      "  surfeit tune city.sft street.ply --mode bleeding --sample 1000000 --plot tune.svg\n"
      "  surfeit tune city.sft street.ply --check --json > tune.json");
  command->callback(
      [arguments, &context] { context.run([&] { return runTune(*arguments, context); }); });
}

}  // namespace surfeit
