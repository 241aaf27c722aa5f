// What a path to be written to stands for: a file, through symbolic links, or a stream (standard
// output, a device, a FIFO).
#pragma once

#include <sys/types.h>

#include <cstdint>
#include <optional>
#include <string>

#include "surfeit/status.h"

namespace surfeit {

struct OutputTarget {
  // Of the file to be replaced or made, behind all links; of a stream as it was given.
  std::string path;
  bool is_stream = false;      // written to as it is, never replaced
  std::optional<mode_t> mode;  // permissions of the file that is there, which stay
};

// "-", and "-.EXTENSION" where the name tells a format, are standard output. kInvalidArgument for a
// directory; kIoError where the directory is missing or not to be written to, or a device, FIFO or
// socket may not be.
Result<OutputTarget> resolveOutput(const std::string& path);

// kInvalidArgument when the output is the file of an input, by its name, by a link or by another
// name: "OUTPUT: the result would replace the WHAT". A stream replaces nothing.
Status checkReplacesNot(const std::string& output, const std::string& input, const char* what);

// kIoError when the file system of an output has less room; none is needed for a stream.
Status checkOutputRoom(const std::string& path, std::uint64_t least_bytes);

// Writes the first `size` bytes of the open file `from` to a stream.
Status writeToStream(const OutputTarget& target, int from, std::uint64_t size);

// The directory of temporary files that belong to no output: that of the job (SLURM_TMPDIR,
// TMPDIR), else /tmp.
std::string spoolDirectory();

// The directory of temporary files on the way to an output: `given` (--temp), else that of the job,
// else beside the output, else, where that is a stream, spoolDirectory().
std::string temporaryDirectory(const std::string& given, const std::string& output);

// The directory in which an output becomes complete, to be named there.
std::string outputDirectory(const std::string& output);

}  // namespace surfeit
