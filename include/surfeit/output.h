// Files that are written, as all jobs write them. For what a program writes beside the results of
// jobs, and to find out beforehand what a path stands for. Safe from any thread.
#pragma once

#include <string>
#include <string_view>

#include "surfeit/api.h"
#include "surfeit/status.h"

namespace surfeit {

struct OutputPlace {
  // Of the file to be replaced or made, behind all symbolic links; of a stream as it was given.
  std::string path;
  bool is_stream = false;  // standard output, a device, FIFO or socket: written to, never replaced
};

// What a path stands for; "-", and "-.EXTENSION" where the name tells a format, are standard
// output. Errors: kInvalidArgument for a directory; kIoError where the directory is missing or not
// to be written to, or a stream may not be.
SURFEIT_API Result<OutputPlace> findOutput(const std::string& path);

// Writes a whole file, which appears when complete and keeps the permissions of the one that it
// replaces. Errors: kInvalidArgument for a directory, kIoError.
SURFEIT_API Status writeOutput(const std::string& path, std::string_view bytes);

}  // namespace surfeit
