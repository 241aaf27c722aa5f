// Options about files of clouds: --channels, --part and --filter, which say what of a cloud's file
// is read, and under which names; -o, the cloud that is written.
#pragma once

#include <CLI/CLI.hpp>
#include <string>

#include "surfeit/color_range.h"

namespace surfeit {

// --color-range: how colors are read whose numbers do not say what they mean.
void addColorRangeOption(CLI::App& command, ColorRange& color_range);

// --channels, --part, --filter, and --text, which goes into `channels` (kTextChannel of
// surfeit/job.h). The library parses `channels`: a text that is no list of FROM=TO is a usage error
// of its own.
void addChannelOptions(CLI::App& command, std::string& channels, std::string& part,
                       std::string& filter);
// Only --filter.
void addFilterOption(CLI::App& command, std::string& filter);

// `what` begins the description: "Cloud to write". Any format that is written will do, pictures
// where what is written may be their pixels.
void addCloudOutputOption(CLI::App& command, std::string& output, const std::string& what,
                          bool has_pictures = false);

}  // namespace surfeit
