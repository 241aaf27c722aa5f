#include "index/rows/scene_rows.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <utility>
#include <vector>

#include "cloud/parts/property_renames.h"
#include "cloud/rows/filtered_reader.h"
#include "core/crs_comment.h"
#include "core/group_comment.h"
#include "core/parallel.h"
#include "core/up_comment.h"
#include "octree/read/provenance.h"
#include "surfeit/cloud_info.h"
#include "surfels/open_surfel_source.h"
#include "surfels/rows/surfel_rows.h"

namespace surfeit {
namespace {

// Surfels decoded at once, unless one page holds more: enough that threads have work.
constexpr std::size_t kBatchSurfels = 32768;
// Pages decoded at once, however small they are: each has buffers of its own.
constexpr std::size_t kMostSlots = 256;

// What rows of the scene hold.
CloudChannels channelsOf(const SceneHeader& header) {
  CloudChannels channels = header.channels;
  channels.radius = channels.area = true;
  return channels;
}

class SceneRowReader final : public RowReader {
 public:
  static Result<std::unique_ptr<RowReader>> create(SceneFile scene,
                                                   const RowReaderOptions& options) {
    auto reader = std::unique_ptr<SceneRowReader>(new SceneRowReader(std::move(scene)));
    SURFEIT_ASSIGN_OR_RETURN(reader->element_,
                             renamedElement(reader->element_, options.channels, reader->path()));
    SURFEIT_RETURN_IF_ERROR(checkChannelsLeft(reader->element_, reader->path()));
    return std::unique_ptr<RowReader>(std::move(reader));
  }

  const std::string& path() const override { return scene_.path(); }
  std::string formatName() const override {
    return fmt::format("Surfeit scene of version {}", scene_.header().format_version);
  }
  const RowLayout& element() const override { return element_; }

  std::vector<std::string> notes() const override {
    std::vector<std::string> notes;
    if (!scene_.header().full_precision) {
      notes.emplace_back(
          "values have the digits that a quantized scene keeps (index --precision full keeps all)");
    }
    if (scene_.header().has_lobes) {
      notes.emplace_back(
          "lobes of glossy bounces are left out: radiosity is that of all directions together");
    }
    if (scene_.header().has_sharers || scene_.header().has_tiles) {
      notes.emplace_back(
          "how much of its disk each surfel hides, as index found from its neighbours, is left "
          "out; "
          "index --channels radius=- finds it again");
    }
    return notes;
  }

  Result<Bytes> readRows(std::size_t max_rows, AlignedBuffer& buffer) override {
    if (failure_.ok() && next_ == surfels_.size()) failure_ = decodePages();
    SURFEIT_RETURN_IF_ERROR(failure_);
    const std::size_t count = std::min(max_rows, surfels_.size() - next_);
    buffer.reserve(std::max<std::size_t>(count * rows_.rowBytes(), 1));
    rows_.pack(std::span<const Surfel>(surfels_).subspan(next_, count), buffer.data());
    next_ += count;
    return Bytes(buffer.data(), count * rows_.rowBytes());
  }

  std::vector<std::string> comments() const override {
    std::vector<std::string> comments = {upComment(scene_.header().up)};
    if (const std::string crs = sceneCrs(scene_.provenance()); !crs.empty()) {
      comments.push_back(std::string(kCrsComment) + crs);
    }
    for (const GroupName& name : groupNamesOf(scene_.provenance())) {
      comments.push_back(groupComment(name.group, name.name));
    }
    return comments;
  }

  Status rewind() override {
    next_page_ = 0;
    surfels_.clear();
    next_ = 0;
    failure_ = {};
    return {};
  }

 private:
  explicit SceneRowReader(SceneFile scene)
      : scene_(std::move(scene)), rows_(channelsOf(scene_.header()), scene_.header().origin) {
    element_.name = "vertex";
    element_.count = scene_.header().surfel_count;
    element_.properties = rows_.properties();
    element_.row_bytes = rows_.rowBytes();
    slots_.resize(std::clamp<std::size_t>(kBatchSurfels / capacity(), 1, kMostSlots));
  }

  std::size_t capacity() const {
    return std::max<std::size_t>(scene_.header().surfel_group_capacity, 1);
  }

  // The next pages' surfels; none at the end.
  Status decodePages() {
    const std::size_t pages =
        std::min<std::size_t>(slots_.size(), scene_.surfelPageCount() - next_page_);
    surfels_.resize(pages * capacity());
    next_ = 0;
    parallelFor(pages, [&](std::size_t i) {
      Slot& slot = slots_[i];
      slot.count = scene_.decodeSurfels(next_page_ + std::uint32_t(i), slot.scratch,
                                        std::span(surfels_).subspan(i * capacity(), capacity()));
    });
    next_page_ += std::uint32_t(pages);

    // Close the gaps behind pages that are not full
    std::size_t size = 0;
    for (std::size_t i = 0; i < pages; ++i) {
      SURFEIT_ASSIGN_OR_RETURN(const std::uint32_t count, std::move(slots_[i].count));
      const auto page = surfels_.begin() + std::ptrdiff_t(i * capacity());
      if (size != i * capacity()) {
        std::copy(page, page + count, surfels_.begin() + std::ptrdiff_t(size));
      }
      size += count;
    }
    surfels_.resize(size);
    return {};
  }

  struct Slot {
    SceneFile::Scratch scratch;
    Result<std::uint32_t> count = 0u;
  };

  SceneFile scene_;
  SurfelRows rows_;
  RowLayout element_;
  std::vector<Slot> slots_;
  std::uint32_t next_page_ = 0;
  std::vector<Surfel> surfels_;
  Status failure_;        // which lasts until rewind()
  std::size_t next_ = 0;  // of the surfels, the first that is still to be packed
};

}  // namespace

Result<bool> isScene(const std::string& path) {
  std::array<std::byte, 8> magic{};
  SURFEIT_ASSIGN_OR_RETURN(const InputFile file, InputFile::open(path));
  SURFEIT_ASSIGN_OR_RETURN(const std::size_t size, file.readSome(0, magic));
  return isSceneFile({reinterpret_cast<const char*>(magic.data()), size});
}

Result<std::unique_ptr<RowReader>> readSceneAsCloud(SceneFile scene,
                                                    const RowReaderOptions& options) {
  SURFEIT_ASSIGN_OR_RETURN(std::unique_ptr<RowReader> reader,
                           SceneRowReader::create(std::move(scene), options));
  if (options.filter.empty()) return reader;
  const std::string key = reader->path() + '\n' + options.filter;
  return filterRows(std::move(reader), options.filter, key, options.selections.get());
}

Result<std::unique_ptr<RowReader>> openCloud(const std::string& path,
                                             const RowReaderOptions& options) {
  SURFEIT_ASSIGN_OR_RETURN(const bool is_scene, isScene(path));
  if (!is_scene) return openRowReader(path, options);
  SURFEIT_ASSIGN_OR_RETURN(SceneFile scene, SceneFile::open(path, options.access));
  return readSceneAsCloud(std::move(scene), options);
}

Result<std::unique_ptr<SurfelSource>> openCloudSource(const std::string& path, bool strict,
                                                      const RowReaderOptions& options) {
  SURFEIT_ASSIGN_OR_RETURN(const bool is_scene, isScene(path));
  if (!is_scene) return openSurfelSource(path, strict, options);
  SURFEIT_ASSIGN_OR_RETURN(std::unique_ptr<RowReader> reader, openCloud(path, options));
  return makeSurfelSource(std::move(reader), strict);
}

}  // namespace surfeit
