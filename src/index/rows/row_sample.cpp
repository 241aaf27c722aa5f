#include "index/rows/row_sample.h"

#include <fmt/format.h>

#include <algorithm>
#include <cstddef>
#include <cstring>
#include <memory>
#include <span>
#include <vector>

#include "cloud/cloud_formats.h"
#include "cloud/rows/channels.h"
#include "core/resident_limit.h"
#include "octree/read/scene_file.h"
#include "surfeit/index.h"
#include "surfels/rows/surfel_writer.h"

namespace surfeit {
namespace {

constexpr std::uint64_t kRowsOfPlace = 256;
// To index a sample takes little, whatever the job may hold.
constexpr std::uint64_t kIndexMemory = std::uint64_t{64} << 20;

// Writes some rows of a cloud, as they are read.
class RowSample {
 public:
  static Result<RowSample> create(RowReader& reader, const std::string& path) {
    RowSample sample;
    RowWriterOptions writing;
    for (const RowProperty& property : reader.element().properties) {
      if (property.is_list) continue;
      writing.properties.push_back(property);
      sample.from_.push_back(property.offset);
    }
    writing.comments = reader.comments();
    SURFEIT_ASSIGN_OR_RETURN(sample.writer_, createRowWriter(path, writing));
    return sample;
  }

  Status write(Bytes rows, std::size_t row_bytes) {
    const RowLayout& to = writer_->element();
    const std::size_t count = rows.size() / row_bytes;
    packed_.assign(count * to.row_bytes, std::byte{0});
    for (std::size_t p = 0; p < from_.size(); ++p) {
      const RowProperty& property = to.properties[p];
      for (std::size_t i = 0; i < count; ++i) {
        std::memcpy(&packed_[i * to.row_bytes + property.offset], &rows[i * row_bytes + from_[p]],
                    valueTypeBytes(property.type));
      }
    }
    return writer_->writeRows(packed_);
  }
  Status finish() { return writer_->finish(); }

 private:
  std::unique_ptr<RowWriter> writer_;
  std::vector<std::size_t> from_;  // places in a row of the reader
  std::vector<std::byte> packed_;
};

}  // namespace

Result<std::uint64_t> sampleRows(RowReader& reader, std::uint64_t most, const std::string& path) {
  const std::uint64_t count = reader.element().count;
  const std::size_t row_bytes = reader.element().row_bytes;
  SURFEIT_RETURN_IF_ERROR(checkChannelsLeft(reader.element(), reader.path()));
  SURFEIT_ASSIGN_OR_RETURN(RowSample sample, RowSample::create(reader, path));
  const bool takes_places = reader.isSeekable() && count > most && most > kRowsOfPlace;
  const std::uint64_t places = most / kRowsOfPlace;
  const std::uint64_t step = takes_places ? (count - kRowsOfPlace) / places : 0;
  AlignedBuffer buffer;
  std::uint64_t taken = 0;
  while (taken < most) {
    if (takes_places) SURFEIT_RETURN_IF_ERROR(reader.seekRow(taken / kRowsOfPlace * step));
    SURFEIT_ASSIGN_OR_RETURN(
        const Bytes rows,
        reader.readRows(std::size_t(std::min(kRowsOfPlace, most - taken)), buffer));
    if (rows.empty()) break;
    SURFEIT_RETURN_IF_ERROR(sample.write(rows, row_bytes));
    taken += rows.size() / row_bytes;
  }
  SURFEIT_RETURN_IF_ERROR(sample.finish());
  return taken;
}

Result<SceneSample> sampleScene(const std::string& path, const ScratchFolder& folder,
                                Progress& progress) {
  SURFEIT_ASSIGN_OR_RETURN(const SceneFile scene, SceneFile::open(path));
  const SceneHeader& header = scene.header();
  CloudChannels channels = header.channels;
  channels.radius = channels.area = true;
  const std::string cloud = folder.file("surfels.ply");
  SURFEIT_ASSIGN_OR_RETURN(SurfelWriter writer,
                           SurfelWriter::create(cloud, channels, {}, header.origin));

  // Whole pages from all over
  SceneSample sample;
  sample.surfels = header.surfel_count;
  const std::uint64_t pages = scene.surfelPageCount();
  const std::uint64_t capacity = std::max<std::uint64_t>(1, header.surfel_group_capacity);
  const std::uint64_t wanted = std::min(pages, (kMostSampledSurfels + capacity - 1) / capacity);
  std::vector<Surfel> surfels(capacity);
  SceneFile::Scratch scratch;
  for (std::uint64_t i = 0; i < wanted; ++i) {
    SURFEIT_ASSIGN_OR_RETURN(
        const std::uint32_t count,
        scene.decodeSurfels(std::uint32_t(i * pages / wanted), scratch, surfels));
    SURFEIT_RETURN_IF_ERROR(writer.write(std::span<const Surfel>(surfels).first(count)));
    sample.sampled_surfels += count;
  }
  SURFEIT_RETURN_IF_ERROR(writer.finish());

  IndexOptions options;
  options.full_precision = header.full_precision;
  options.threads = 1;
  options.memory_bytes = kIndexMemory;
  options.temporary_directory = folder.path();
  sample.path = folder.file("sample.sft");
  SilentProgress silent(progress);
  SURFEIT_RETURN_IF_ERROR(indexClouds({cloud}, sample.path, options, silent).status());
  surfels = {};
  beginResidentStep();
  sample.sampled_bytes = fileBytesOf(sample.path);
  sample.bytes = fileBytesOf(path);
  return sample;
}

}  // namespace surfeit
