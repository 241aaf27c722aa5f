#include "tools/channel_options.h"

#include <fmt/format.h>

#include <map>
#include <string>

#include "surfeit/job.h"

namespace surfeit {

void addColorRangeOption(CLI::App& command, ColorRange& color_range) {
  static const std::map<std::string, ColorRange> kRanges = {
      {"auto", ColorRange::kAuto}, {"8", ColorRange::k8},   {"10", ColorRange::k10},
      {"12", ColorRange::k12},     {"16", ColorRange::k16}, {"unit", ColorRange::kUnit}};
  command
      .add_option_function<std::string>(
          "--color-range",
          [&color_range](const std::string& name) { color_range = kRanges.at(name); },
          "Meaning of colors that are not bytes: 8, 10, 12 or 16 bits of sRGB, unit (reals are "
          "scene-linear), or auto: decided by a sample of the cloud (docs/files.md)")
      ->type_name("8|10|12|16|unit|auto")
      ->check(CLI::IsMember({"8", "10", "12", "16", "unit", "auto"}).description(""))
      ->default_str("auto");
}

void addChannelOptions(CLI::App& command, std::string& channels, std::string& part,
                       std::string& filter) {
  const auto append = [&channels](const std::string& more) {
    channels += (channels.empty() ? "" : ",") + more;
  };
  command
      .add_option_function<std::string>(
          "--channels", append,
          "New names for channels of the clouds: FROM=TO,FROM=TO; FROM=- drops a channel; in text, "
          "FROM may be the number of a column")
      ->type_name("FROM=TO,...");
  command
      .add_option_function<std::string>(
          "--text",
          [append](const std::string& reading) {
            append(fmt::format("{}={}", kTextChannel, reading));
          },
          "Meaning of commas in text (default: found from the lines)")
      ->check(CLI::IsMember({std::string(kDecimalComma), std::string(kDecimalPoint)}))
      ->type_name("decimal-comma|decimal-point");
  command
      .add_option("--part", part,
                  "The grid (.vdb), layer (.exr) or element (PLY) to read, in files with several "
                  "(default: the first that holds a cloud)")
      ->type_name("NAME");
  addFilterOption(command, filter);
}

void addFilterOption(CLI::App& command, std::string& filter) {
  command
      .add_option("--filter", filter,
                  "Read only points for which this holds: \"classification == 2 and return == 1\"; "
                  "true: all points (by default withheld points and noise are left out)")
      ->type_name("CONDITION");
}

void addCloudOutputOption(CLI::App& command, std::string& output, const std::string& what,
                          bool has_pictures) {
  command
      .add_option(
          "-o,--output", output,
          what +
              "; the extension tells the format: .ply, .ptc, .las, .prt, .bgeo, .pdb, .xyz, "
              ".csv, .txt or .asc, each may be followed by .gz or .zst, or .vdb" +
              (has_pictures ? ", .exr for pixels of pictures" : ""))
      ->required()
      ->type_name("CLOUD");
}

}  // namespace surfeit
