#include "view/cloud_rows.h"

#include <fmt/format.h>

#include <utility>

#include "cloud/cloud_formats.h"
#include "cloud/rows/row_reader.h"
#include "core/up_comment.h"
#include "index/rows/scene_rows.h"
#include "octree/read/scene_file.h"
#include "surfeit/cloud_info.h"

namespace surfeit {
namespace {

// A cloud of any format.
class FileRows final : public CloudRows {
 public:
  explicit FileRows(std::unique_ptr<RowReader> reader) : reader_(std::move(reader)) {}

  const std::string& path() const override { return reader_->path(); }
  const RowLayout& element() const override { return reader_->element(); }
  UpAxis up() const override { return statedUpAxis(reader_->comments()).value_or(kDefaultUpAxis); }
  std::vector<std::string> notes() const override { return reader_->notes(); }
  Status rewind() override { return reader_->rewind(); }
  Result<std::span<const std::byte>> next() override {
    return reader_->readRows(kBatchRows, buffer_);
  }

 private:
  std::unique_ptr<RowReader> reader_;
  AlignedBuffer buffer_;
};

class SceneRows final : public CloudRows {
 public:
  SceneRows(SceneHeader header, std::unique_ptr<RowReader> reader)
      : header_(header), reader_(std::move(reader)) {}

  const std::string& path() const override { return reader_->path(); }
  const RowLayout& element() const override { return reader_->element(); }
  UpAxis up() const override { return header_.up; }
  Status rewind() override { return reader_->rewind(); }
  Result<std::span<const std::byte>> next() override {
    return reader_->readRows(kBatchRows, buffer_);
  }
  std::optional<Bounds3d> statedBounds() const override {
    if (element().count < header_.surfel_count) return std::nullopt;  // filtered
    return movedBounds(header_.bounds, header_.origin);
  }

 private:
  SceneHeader header_;
  std::unique_ptr<RowReader> reader_;
  AlignedBuffer buffer_;
};

bool hasPositions(const RowLayout& element) {
  return element.find("x") != nullptr && element.find("y") != nullptr &&
         element.find("z") != nullptr;
}

}  // namespace

Result<std::unique_ptr<CloudRows>> openCloudRows(const std::string& path,
                                                 const RowReaderOptions& options) {
  SURFEIT_ASSIGN_OR_RETURN(const bool is_scene, isScene(path));
  if (is_scene) {
    SURFEIT_ASSIGN_OR_RETURN(SceneFile scene, SceneFile::open(path));
    const SceneHeader header = scene.header();
    SURFEIT_ASSIGN_OR_RETURN(auto reader, readSceneAsCloud(std::move(scene), options));
    return std::unique_ptr<CloudRows>(std::make_unique<SceneRows>(header, std::move(reader)));
  }
  SURFEIT_ASSIGN_OR_RETURN(std::unique_ptr<RowReader> reader, openRowReader(path, options));
  if (!hasPositions(reader->element())) {
    return Status::corruption(
        fmt::format("{}: no properties x, y and z, so nothing to draw", path));
  }
  return std::unique_ptr<CloudRows>(std::make_unique<FileRows>(std::move(reader)));
}

}  // namespace surfeit
