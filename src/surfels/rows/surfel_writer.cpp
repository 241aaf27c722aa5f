#include "surfels/rows/surfel_writer.h"

#include <algorithm>
#include <cstddef>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "cloud/cloud_formats.h"
#include "core/resident_limit.h"
#include "surfels/rows/surfel_rows.h"

namespace surfeit {
namespace {

constexpr std::size_t kWrittenBytes = 256 << 10;

}  // namespace

struct SurfelWriter::State {
  std::unique_ptr<RowWriter> file;
  SurfelRows packing;
  std::vector<std::byte> rows;
  std::string path;
  Progress* progress = nullptr;
  std::set<std::string> told;  // notes of the file

  // What the file has not said yet.
  void note() {
    if (progress == nullptr) return;
    for (const std::string& line : file->notes()) {
      if (told.insert(line).second) progress->note(path + ": " + line);
    }
  }
};

Result<SurfelWriter> SurfelWriter::create(const std::string& path, const CloudChannels& channels,
                                          RowWriterOptions options, const glm::dvec3& origin) {
  SurfelRows packing(channels, origin);
  options.properties = packing.properties();
  if (options.memory_beside_bytes == 0) {
    const ResidentRoom room = residentRoom();
    options.memory_bytes = std::min(options.memory_bytes, room.free_bytes);
    options.memory_beside_bytes = room.resident_bytes;
  }
  SURFEIT_ASSIGN_OR_RETURN(std::unique_ptr<RowWriter> file, createRowWriter(path, options));
  SurfelWriter writer(std::make_unique<State>(
      State{std::move(file), std::move(packing), {}, path, options.progress, {}}));
  writer.state_->note();
  return writer;
}

SurfelWriter::SurfelWriter(std::unique_ptr<State> state) : state_(std::move(state)) {}
SurfelWriter::SurfelWriter(SurfelWriter&&) noexcept = default;
SurfelWriter& SurfelWriter::operator=(SurfelWriter&&) noexcept = default;
SurfelWriter::~SurfelWriter() = default;

Status SurfelWriter::write(std::span<const Surfel> surfels) {
  const std::size_t row_bytes = state_->packing.rowBytes();
  const std::size_t most = kWrittenBytes / row_bytes;
  state_->rows.resize(most * row_bytes);
  while (!surfels.empty()) {
    const std::size_t count = std::min(most, surfels.size());
    state_->packing.pack(surfels.first(count), state_->rows.data());
    SURFEIT_RETURN_IF_ERROR(
        state_->file->writeRows(std::span(state_->rows).first(count * row_bytes)));
    surfels = surfels.subspan(count);
  }
  return {};
}

std::uint64_t SurfelWriter::temporaryBytes() const { return state_->file->temporaryBytes(); }

Status SurfelWriter::finish() {
  SURFEIT_RETURN_IF_ERROR(state_->file->finish());
  state_->note();
  return {};
}

}  // namespace surfeit
