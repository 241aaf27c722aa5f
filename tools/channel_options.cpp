#include "tools/channel_options.h"

namespace surfeit {

void addChannelOptions(CLI::App& command, std::string& channels, std::string& part,
                       std::string& filter) {
  command
      .add_option(
          "--channels", channels,
          "Channels of the clouds to be called otherwise: FROM=TO,FROM=TO; FROM=- drops one")
      ->type_name("FROM=TO,...");
  command
      .add_option("--part", part,
                  "Of files with several: the grid (.vdb), layer (.exr) or element (PLY) to read "
                  "(default: the first that holds a cloud)")
      ->type_name("NAME");
  addFilterOption(command, filter);
}

void addFilterOption(CLI::App& command, std::string& filter) {
  command
      .add_option("--filter", filter,
                  "Only points for which this holds: \"classification == 2 and return == 1\"; "
                  "true: all, also those withheld and noise, which are left out by default")
      ->type_name("CONDITION");
}

void addCloudOutputOption(CLI::App& command, std::string& output, const std::string& what,
                          bool has_pictures) {
  command
      .add_option(
          "-o,--output", output,
          what +
              "; the extension tells the format: .ply, .ptc, .las, .prt, .bgeo, .pdb, .xyz, "
              ".csv, .txt or .asc, with .gz or .zst behind it, or .vdb" +
              (has_pictures ? ", .exr for pixels of pictures" : ""))
      ->required()
      ->type_name("CLOUD");
}

}  // namespace surfeit
