// The formats of clouds: one table of how each is recognised, read and written. docs/files.md has
// them for users.
#pragma once

#include <cstddef>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "cloud/rows/channels.h"
#include "cloud/rows/filtered_reader.h"
#include "cloud/rows/row_reader.h"
#include "cloud/rows/row_reader_options.h"
#include "cloud/rows/row_writer.h"
#include "storage/byte_input.h"
#include "storage/file.h"
#include "surfeit/color_range.h"
#include "surfeit/status.h"
#include "surfeit/up_axis.h"

namespace surfeit {

// One row of the table. A format that is only read has no `create`, one that is only written no
// `open`.
struct CloudFormat {
  std::string_view name;        // "PTC"
  std::string_view extensions;  // of files to write, separated by blanks: ".bgeo .geo"
  // Whether these, the first bytes of the file (decompressed; up to kMagicBytes), are of this
  // format. Formats without a magic (text) look at more than a word and stand last in the table.
  bool (*recognises)(std::string_view first_bytes);
  Result<std::unique_ptr<RowReader>> (*open)(const std::string& path,
                                             const RowReaderOptions& options);
  Result<std::unique_ptr<RowWriter>> (*create)(const std::string& path,
                                               const RowWriterOptions& options);
  unsigned traits = 0;

  enum Trait : unsigned {
    kReadInPlaces = 1,    // not from .gz and .zst
    kStatesUp = 2,        // may say what is up (core/up_comment.h)
    kHasUpZ = 4,          // has z up, whatever it says
    kFloatPositions = 8,  // whatever type rows have
  };
  bool has(Trait trait) const { return (traits & trait) != 0; }
};

std::span<const CloudFormat> cloudFormats();

// Whether these are the first bytes of a Surfeit scene (docs/format.md), which is no cloud.
bool isSceneFile(std::string_view first_bytes);

// The format of a file that is known but not read, by its first bytes and its name: "STL". Empty:
// not known.
std::string nameOfOtherFormat(const std::string& path, std::string_view first_bytes);

// Opens a cloud by its first bytes. kCorruption when they are of no known format, with those that
// are read and, for known ones that are not read (LAZ, E57, SPRT, ...), what to do instead.
Result<std::unique_ptr<RowReader>> openRowReader(const std::string& path,
                                                 const RowReaderOptions& options = {});

// How colors of `inputs` are read that go to `output`: as `asked`, but from LAS to LAS, whose
// records stay as they are, with their own numbers.
Result<std::optional<ColorRange>> colorRangeFor(std::span<const std::string> inputs,
                                                const std::string& output, ColorRange asked);

// The format of the cloud that is written under a name, by its extension; none where no format has
// it.
const CloudFormat* formatWritten(const std::string& path);

// Tells of a scene that gets the name of a cloud.
void noteSceneName(const std::string& output, Progress& progress);

// What the writer of `path` holds of so many rows until its end: 0 but for OpenVDB, whose tree is
// sorted in memory (RowWriterOptions::memory_bytes).
std::uint64_t heldWriterBytes(const std::string& path, std::uint64_t count, std::size_t row_bytes);

// Creates a cloud by the extension of its name, .gz and .zst aside. kInvalidArgument for a name
// whose extension is none that is written, naming those that are.
Result<std::unique_ptr<RowWriter>> createRowWriter(const std::string& path,
                                                   const RowWriterOptions& options);

}  // namespace surfeit
