#include "tools/channel_options.h"

namespace surfeit {

void addChannelOptions(CLI::App& command, std::string& channels, std::string& part) {
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
}

void addCloudOutputOption(CLI::App& command, std::string& output, const std::string& what,
                          bool has_pictures) {
  command
      .add_option("-o,--output", output,
                  what +
                      "; the extension tells the format: .ply, .ptc, .prt, .bgeo, .pdb, .xyz, "
                      ".csv, .txt or .asc, with .gz or .zst behind it, or .vdb" +
                      (has_pictures ? ", .exr for pixels of pictures" : ""))
      ->required()
      ->type_name("CLOUD");
}

}  // namespace surfeit
