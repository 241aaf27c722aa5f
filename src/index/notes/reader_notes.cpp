#include "index/notes/reader_notes.h"

#include <fmt/format.h>

#include "cloud/rows/comment_notes.h"
#include "surfels/rows/no_data.h"

namespace surfeit {

void tellNotes(RowReader& reader, Progress& progress) {
  for (const std::string& note : reader.notes()) {
    progress.note(fmt::format("{}: {}", reader.path(), note));
  }
  for (const std::string& note : notesOfComments(reader.comments())) {
    progress.note(fmt::format("{}: {}", reader.path(), note));
  }
  // A failure will be that of whoever reads the rows
  const Result<std::string> note = noteOfNoData(reader);
  if (note.ok() && !note->empty()) progress.note(fmt::format("{}: {}", reader.path(), *note));
}

}  // namespace surfeit
