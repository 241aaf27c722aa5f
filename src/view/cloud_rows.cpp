#include "view/cloud_rows.h"

#include <fmt/format.h>
#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <array>
#include <cstring>
#include <utility>
#include <vector>

#include "io/cloud_formats.h"
#include "io/file.h"
#include "io/row_reader.h"
#include "octree/scene_file.h"

namespace surfeit {
namespace {

// A cloud of any format.
class FileRows final : public CloudRows {
 public:
  explicit FileRows(std::unique_ptr<RowReader> reader) : reader_(std::move(reader)) {}

  const std::string& path() const override { return reader_->path(); }
  const PlyElement& element() const override { return reader_->element(); }
  std::vector<std::string> notes() const override { return reader_->notes(); }
  Status rewind() override { return reader_->rewind(); }
  Result<std::span<const std::byte>> next() override {
    return reader_->readRows(kBatchRows, buffer_);
  }

 private:
  std::unique_ptr<RowReader> reader_;
  AlignedBuffer buffer_;
};

// Surfels as rows: their fields under the names that PLY clouds use.
PlyElement surfelElement(std::uint64_t count) {
  constexpr std::pair<const char*, std::size_t> kFields[] = {
      {"x", offsetof(Surfel, position)},
      {"y", offsetof(Surfel, position) + 4},
      {"z", offsetof(Surfel, position) + 8},
      {"radius", offsetof(Surfel, radius)},
      {"nx", offsetof(Surfel, normal)},
      {"ny", offsetof(Surfel, normal) + 4},
      {"nz", offsetof(Surfel, normal) + 8},
      {"area", offsetof(Surfel, area)},
      {"radiosity_r", offsetof(Surfel, radiosity)},
      {"radiosity_g", offsetof(Surfel, radiosity) + 4},
      {"radiosity_b", offsetof(Surfel, radiosity) + 8},
      {"albedo_r", offsetof(Surfel, albedo)},
      {"albedo_g", offsetof(Surfel, albedo) + 4},
      {"albedo_b", offsetof(Surfel, albedo) + 8},
  };
  PlyElement element;
  element.name = "surfel";
  element.count = count;
  element.row_bytes = sizeof(Surfel);
  for (const auto& [name, offset] : kFields) {
    PlyProperty property;
    property.name = name;
    property.type = PlyType::kFloat32;
    property.offset = offset;
    element.properties.push_back(property);
  }
  return element;
}

class SceneRows final : public CloudRows {
 public:
  explicit SceneRows(SceneFile scene)
      : scene_(std::move(scene)), element_(surfelElement(scene_.header().surfel_count)) {
    // Decode as many pages at once as a batch has room for, so that threads have work
    capacity_ = std::max<std::size_t>(scene_.header().surfel_group_capacity, 1);
    const std::size_t slots = std::max<std::size_t>(kBatchRows / capacity_, 1);
    slots_.resize(slots);
    surfels_.resize(slots * capacity_);
  }

  const std::string& path() const override { return scene_.path(); }
  const PlyElement& element() const override { return element_; }
  std::optional<Bounds3> statedBounds() const override { return scene_.header().bounds; }
  std::optional<CloudChannels> statedChannels() const override { return scene_.header().channels; }

  Status rewind() override {
    next_page_ = 0;
    return {};
  }

  Result<std::span<const std::byte>> next() override {
    const std::size_t pages =
        std::min<std::size_t>(slots_.size(), scene_.surfelPageCount() - next_page_);
    tbb::parallel_for(std::size_t{0}, pages, [&](std::size_t i) {
      Slot& slot = slots_[i];
      slot.result = scene_.decodeSurfels(next_page_ + std::uint32_t(i), slot.scratch,
                                         std::span(surfels_).subspan(i * capacity_, capacity_));
    });
    next_page_ += std::uint32_t(pages);

    // Close the gaps behind pages that are not full
    std::size_t count = 0;
    for (std::size_t i = 0; i < pages; ++i) {
      SURFEIT_ASSIGN_OR_RETURN(const std::uint32_t found, std::move(slots_[i].result));
      if (count != i * capacity_) {
        std::memmove(&surfels_[count], &surfels_[i * capacity_], found * sizeof(Surfel));
      }
      count += found;
    }
    return std::as_bytes(std::span<const Surfel>(surfels_.data(), count));
  }

 private:
  struct Slot {
    SceneFile::Scratch scratch;
    Result<std::uint32_t> result = 0u;
  };

  SceneFile scene_;
  PlyElement element_;
  std::size_t capacity_ = 0;
  std::vector<Slot> slots_;
  std::vector<Surfel> surfels_;
  std::uint32_t next_page_ = 0;
};

bool hasPositions(const PlyElement& element) {
  return element.find("x") != nullptr && element.find("y") != nullptr &&
         element.find("z") != nullptr;
}

}  // namespace

Result<std::unique_ptr<CloudRows>> openCloudRows(const std::string& path,
                                                 const RowReaderOptions& options) {
  // A scene says so in its first bytes
  std::array<char, 8> magic{};
  {
    SURFEIT_ASSIGN_OR_RETURN(const InputFile file, InputFile::open(path));
    SURFEIT_ASSIGN_OR_RETURN([[maybe_unused]] const std::size_t got,
                             file.readSome(0, std::as_writable_bytes(std::span(magic))));
  }
  if (isSceneFile({magic.data(), magic.size()})) {
    SURFEIT_ASSIGN_OR_RETURN(SceneFile scene, SceneFile::open(path));
    return std::unique_ptr<CloudRows>(std::make_unique<SceneRows>(std::move(scene)));
  }
  SURFEIT_ASSIGN_OR_RETURN(std::unique_ptr<RowReader> reader, openRowReader(path, options));
  if (!hasPositions(reader->element())) {
    return Status::corruption(
        fmt::format("{}: no properties x, y and z, so nothing to draw", path));
  }
  return std::unique_ptr<CloudRows>(std::make_unique<FileRows>(std::move(reader)));
}

}  // namespace surfeit
