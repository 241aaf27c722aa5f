// Clouds of any format as rows of named columns: read them, write them by chunks, and index rows
// that the caller has in memory (docs/files.md has formats and names).
//
//   CloudInput input = *CloudInput::open("scan.las");
//   std::vector<float> x(4096);
//   std::vector<ColumnTarget> targets(input.columns().size());  // a column without data is skipped
//   targets[0] = {x.data(), sizeof(float)};
//   while (*input.read(4096, targets.data()) > 0) ...
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "surfeit/api.h"
#include "surfeit/cloud_info.h"
#include "surfeit/index.h"
#include "surfeit/job.h"
#include "surfeit/progress.h"
#include "surfeit/status.h"
#include "surfeit/up_axis.h"

namespace surfeit {

// Types of values, in host byte order.
enum class ColumnType : std::uint8_t {
  kInt8,
  kUint8,
  kInt16,
  kUint16,
  kInt32,
  kUint32,
  kFloat32,
  kFloat64
};

// A property of every row: "x", "nx", "radiosity_r".
struct CloudColumn {
  std::string name;  // a word of at most 64 bytes
  ColumnType type = ColumnType::kFloat32;
};

// Where the values of a column go, and where they are: row i at data + i * stride bytes. Columns
// may lie within each other, as the components of an array of vectors do. No alignment is needed.
struct ColumnTarget {
  void* data = nullptr;
  std::ptrdiff_t stride = 0;
};
struct ColumnValues {
  const void* data = nullptr;
  std::ptrdiff_t stride = 0;
};

// A cloud, or a scene (.sft) as one, that is read from front to back. One thread at a time. Takes a
// few MiB.
class SURFEIT_API CloudInput {
 public:
  // Errors: kIoError, kCorruption, kInvalidArgument (options).
  static Result<CloudInput> open(const std::string& path, const ReadOptions& options = {});
  CloudInput(CloudInput&&) noexcept;
  CloudInput& operator=(CloudInput&&) noexcept;
  ~CloudInput();

  std::string format() const;   // "PLY", "LAS 1.2 point format 3"
  std::uint64_t count() const;  // rows, exactly
  const std::vector<CloudColumn>& columns() const;
  // Columns that belong together: "position" and its "x", "y", "z".
  const std::vector<CloudChannel>& channels() const;
  // Comments of the file, and what it has that rows do not, a sentence each.
  std::vector<std::string> comments() const;
  std::vector<std::string> notes() const;

  // Copies the next rows, at most `most` (1 or more), to the targets, one for each column; a target
  // without data skips its column. Returns the number of rows; 0 at the end. Errors: kIoError,
  // kCorruption naming the place.
  Result<std::size_t> read(std::size_t most, const ColumnTarget* targets);

 private:
  struct State;
  explicit CloudInput(std::unique_ptr<State> state);
  std::unique_ptr<State> state_;
};

struct CloudOutputOptions {
  // Number of rows, where it is known. Formats with a count in front write it sooner then.
  std::optional<std::uint64_t> count{};
  std::vector<std::string> comments{};
  std::optional<UpAxis> up{};  // axis that the file states, where the format can
  // For OpenVDB, whose rows are held until the end; the others take a few MiB. 0: 2 GiB, or three
  // quarters of the memory that the job may hold where that is less.
  std::uint64_t memory_bytes = 0;
};

// A cloud that is written by chunks. One thread at a time. The file appears under its name when
// finish() succeeds; without it nothing stays.
class SURFEIT_API CloudOutput {
 public:
  // The extension of the name tells the format. Notes tell what the format cannot keep; `progress`
  // outlives the output. Errors: kInvalidArgument (the name, the columns), kIoError.
  static Result<CloudOutput> create(const std::string& path,
                                    const std::vector<CloudColumn>& columns,
                                    const CloudOutputOptions& options, Progress& progress);
  CloudOutput(CloudOutput&&) noexcept;
  CloudOutput& operator=(CloudOutput&&) noexcept;
  ~CloudOutput();

  // Appends rows, with values for each column. Errors: kIoError, kBudgetTooSmall, kInterrupted.
  Status write(std::size_t count, const ColumnValues* values);
  Status finish();

 private:
  struct State;
  explicit CloudOutput(std::unique_ptr<State> state);
  std::unique_ptr<State> state_;
};

// Rows in the caller's memory.
struct CloudColumns {
  std::string name = "rows";  // messages about them begin with it
  std::uint64_t count = 0;
  std::vector<CloudColumn> columns{};
  std::vector<ColumnValues> values{};  // of each column
  std::optional<UpAxis> up{};          // axis that the rows state
};

// As indexClouds, for rows in memory: the scene has the bytes of one from a file with these rows.
// Of ReadOptions only color_range is used. The rows must stay as they are meanwhile; the budget
// does not count them. Errors: as indexClouds.
SURFEIT_API Result<IndexStats> indexColumns(const CloudColumns& rows, const std::string& output,
                                            const IndexOptions& options, Progress& progress);

}  // namespace surfeit
