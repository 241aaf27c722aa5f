// Whether a file was written to while it was being read.
#pragma once

#include <cstdint>
#include <string>

#include "surfeit/status.h"

namespace surfeit {

// Which file a path names, and what changes when it is written to. Plain data.
struct FileStamp {
  std::uint64_t device = 0, inode = 0;
  std::uint64_t size_bytes = 0;
  std::int64_t written_ns = 0;  // time of the last write, since 1970

  // kIoError when the path cannot be asked.
  static Result<FileStamp> of(const std::string& path);
};

// kCorruption when the file that the path named at `before` has been written to since. A path that
// names another file by now, or none, is no failure: whoever has the old one open still reads it.
Status checkUnchanged(const std::string& path, const FileStamp& before);

}  // namespace surfeit
