// Inputs that can be read only once, from front to back: pipes and sockets, standard input among
// them. What comes is kept in a temporary file, so that it can be read as any other.
#pragma once

#include <string>

#include "storage/positional_file.h"
#include "surfeit/status.h"

namespace surfeit {

// The path that the system has for standard input, where a user writes "-".
std::string inputPath(const std::string& path);

// A file with all that comes from the pipe or socket open as `descriptor`, read to its end the
// first time. Later calls about the same pipe open the same bytes again. Safe from any thread.
Result<FileDescriptor> openSpooled(int descriptor, const std::string& path);

// The same of a FIFO with that name, if it was read before; else not open. To open the FIFO itself
// would wait for another writer.
FileDescriptor openKnownSpool(const std::string& path);

}  // namespace surfeit
