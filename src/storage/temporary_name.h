// The names of files that are not finished: beside PATH, "PATH.surfeit-XXXXXX.tmp". Whoever writes
// such a file holds a lock on it (flock), which the system releases when the writer ends in any
// way. So a temporary file that nobody has locked is the leftover of a process that was killed, and
// may go.
//
// Where locks are not supported, leftovers stay. Where they are local to a machine (some network
// file systems), a writer on another machine may lose its file, and says so when it finishes.
#pragma once

#include <string>

#include "storage/positional_file.h"
#include "surfeit/status.h"

namespace surfeit {

// A temporary file that has a name, locked.
struct NamedFile {
  FileDescriptor descriptor;
  std::string path;
};

// Creates an empty temporary file beside `path`, for reading and writing. `name` begins the message
// when that fails.
Result<NamedFile> createTemporary(const std::string& path, const std::string& name);

// Locks the file of `descriptor`, which has no name, and gives it that of a temporary file beside
// `path`. Returns the name.
Result<std::string> nameTemporary(int descriptor, const std::string& path);

// Removes the temporary files of `path` that nobody writes any more. What cannot be removed stays.
void removeStaleTemporaries(const std::string& path);

}  // namespace surfeit
