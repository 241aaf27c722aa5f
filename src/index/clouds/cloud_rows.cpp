#include "surfeit/cloud_rows.h"

#include <algorithm>
#include <set>
#include <utility>

#include "cloud/cloud_formats.h"
#include "cloud/rows/channels.h"
#include "core/guard.h"
#include "core/job_limits.h"
#include "core/resident_limit.h"
#include "core/up_comment.h"
#include "index/rows/column_copies.h"
#include "index/rows/scene_rows.h"

namespace surfeit {
namespace {

// What is read or packed at once.
constexpr std::size_t kBatchBytes = 1 << 20;
constexpr std::uint64_t kUsualMemory = std::uint64_t{2} << 30;

std::size_t batchRows(const RowLayout& layout) {
  return std::max<std::size_t>(1, kBatchBytes / std::max<std::size_t>(1, layout.row_bytes));
}

}  // namespace

struct CloudInput::State {
  std::unique_ptr<RowReader> reader;
  std::vector<CloudColumn> columns;
  std::vector<CloudChannel> channels;
  AlignedBuffer buffer;

  Result<std::size_t> read(std::size_t most, const ColumnTarget* targets);
};

Result<CloudInput> CloudInput::open(const std::string& path, const ReadOptions& options) {
  return guarded(path, [&]() -> Result<CloudInput> {
    RowReaderOptions reading;
    SURFEIT_ASSIGN_OR_RETURN(reading.channels, parseChannelRenames(options.channels));
    reading.part = options.part;
    reading.filter = options.filter;
    reading.color_range = options.color_range;
    auto state = std::make_unique<State>();
    SURFEIT_ASSIGN_OR_RETURN(state->reader, openCloud(path, reading));
    const RowLayout& layout = state->reader->element();
    for (const RowProperty& property : layout.properties) {
      state->columns.push_back({property.name, static_cast<ColumnType>(property.type)});
    }
    for (const RowChannel& channel : channelsOf(layout)) {
      CloudChannel& added = state->channels.emplace_back();
      added.name = channel.name;
      added.type = valueTypeName(channel.type);
      for (const std::size_t i : channel.properties) {
        added.properties.push_back(layout.properties[i].name);
      }
    }
    return CloudInput(std::move(state));
  });
}

CloudInput::CloudInput(std::unique_ptr<State> state) : state_(std::move(state)) {}
CloudInput::CloudInput(CloudInput&&) noexcept = default;
CloudInput& CloudInput::operator=(CloudInput&&) noexcept = default;
CloudInput::~CloudInput() = default;

std::string CloudInput::format() const { return state_->reader->formatName(); }
std::uint64_t CloudInput::count() const { return state_->reader->element().count; }
const std::vector<CloudColumn>& CloudInput::columns() const { return state_->columns; }
const std::vector<CloudChannel>& CloudInput::channels() const { return state_->channels; }
std::vector<std::string> CloudInput::comments() const { return state_->reader->comments(); }
std::vector<std::string> CloudInput::notes() const { return state_->reader->notes(); }

Result<std::size_t> CloudInput::read(std::size_t most, const ColumnTarget* targets) {
  return guarded(state_->reader->path(), [&] { return state_->read(most, targets); });
}

Result<std::size_t> CloudInput::State::read(std::size_t most, const ColumnTarget* targets) {
  const RowLayout& layout = reader->element();
  const auto row_bytes = static_cast<std::ptrdiff_t>(layout.row_bytes);
  const std::size_t batch = batchRows(layout);
  std::size_t done = 0;
  while (done < most) {
    SURFEIT_ASSIGN_OR_RETURN(const Bytes rows,
                             reader->readRows(std::min(batch, most - done), buffer));
    if (rows.empty()) break;
    const std::size_t count = rows.size() / layout.row_bytes;
    for (std::size_t i = 0; i < layout.properties.size(); ++i) {
      const ColumnTarget& target = targets[i];
      if (target.data == nullptr) continue;
      const RowProperty& property = layout.properties[i];
      copyColumn(
          rows.data() + property.offset, row_bytes,
          static_cast<std::byte*>(target.data) + static_cast<std::ptrdiff_t>(done) * target.stride,
          target.stride, valueTypeBytes(property.type), count);
    }
    done += count;
  }
  return done;
}

struct CloudOutput::State {
  std::string path;
  std::unique_ptr<RowWriter> writer;
  Progress& progress;
  std::set<std::string> told{};
  std::vector<std::byte> rows{};

  // What the writer has not said yet.
  void note() {
    for (const std::string& line : writer->notes()) {
      if (told.insert(line).second) progress.note(path + ": " + line);
    }
  }
};

Result<CloudOutput> CloudOutput::create(const std::string& path,
                                        const std::vector<CloudColumn>& columns,
                                        const CloudOutputOptions& options, Progress& progress) {
  return guarded(path, [&]() -> Result<CloudOutput> {
    SURFEIT_ASSIGN_OR_RETURN(const RowLayout layout, layoutOf(columns, path));
    RowWriterOptions writing;
    writing.properties = layout.properties;
    writing.comments = options.comments;
    if (options.up) stateUpAxis(*options.up, writing.comments);
    writing.count = options.count;
    writing.progress = &progress;
    const ResidentRoom room = residentRoom();
    writing.memory_bytes =
        std::min(options.memory_bytes > 0 ? options.memory_bytes : defaultMemoryBytes(kUsualMemory),
                 room.free_bytes);
    writing.memory_beside_bytes = room.resident_bytes;
    SURFEIT_ASSIGN_OR_RETURN(std::unique_ptr<RowWriter> writer, createRowWriter(path, writing));
    CloudOutput output(std::unique_ptr<State>(new State{path, std::move(writer), progress}));
    output.state_->note();
    return output;
  });
}

CloudOutput::CloudOutput(std::unique_ptr<State> state) : state_(std::move(state)) {}
CloudOutput::CloudOutput(CloudOutput&&) noexcept = default;
CloudOutput& CloudOutput::operator=(CloudOutput&&) noexcept = default;
CloudOutput::~CloudOutput() = default;

Status CloudOutput::write(std::size_t count, const ColumnValues* values) {
  return guarded(state_->path, [&]() -> Status {
    const RowLayout& layout = state_->writer->element();
    const std::size_t batch = batchRows(layout);
    for (std::size_t first = 0; first < count; first += batch) {
      if (state_->progress.isCancelled()) return Status::interrupted();
      const std::size_t size = std::min(batch, count - first);
      state_->rows.resize(size * layout.row_bytes);
      packRows(layout, values, first, size, state_->rows.data());
      SURFEIT_RETURN_IF_ERROR(state_->writer->writeRows(state_->rows));
      state_->progress.advance(size);
    }
    return {};
  });
}

Status CloudOutput::finish() {
  return guarded(state_->path, [&]() -> Status {
    SURFEIT_RETURN_IF_ERROR(state_->writer->finish());
    state_->note();
    return {};
  });
}

}  // namespace surfeit
