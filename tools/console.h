// Standard output and standard error: all that the program says goes through here. What nobody can
// read is no reason to end a job: a failed write to standard error is forgotten. What the user
// asked for on standard output is the job: its failure is returned. Never throws, never raises a
// signal.
#pragma once

#include <string>
#include <string_view>

#include "surfeit/status.h"

namespace surfeit {

// At the start of the program: a missing descriptor 0, 1 or 2 is taken by a stand-in that cannot be
// written, so that no file of ours gets its number; and a reader that went away (SIGPIPE) or a file
// at the limit of the shell (SIGXFSZ) is a failed write.
void prepareStreams();

// `text` without what a terminal would obey: control characters but for tab and newline, and bytes
// that are not UTF-8, become "\x1b". Text of files and names of files may hold anything.
std::string printable(std::string_view text);

// Writes to standard error: printable(text), or the bytes as they are. Waits for a reader that does
// not read a second in all, then drops what it would have been told.
void tell(std::string_view text);
void tellRaw(std::string_view bytes);

// Writes printable(text) to standard output, all of it, or kIoError.
Status writeAnswer(std::string_view text);

}  // namespace surfeit
