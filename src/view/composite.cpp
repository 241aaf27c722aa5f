#include "surfeit/composite.h"

#include <OpenEXR/ImfHeader.h>
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <exception>
#include <memory>
#include <new>
#include <span>
#include <utility>
#include <vector>

#include "cloud/cloud_formats.h"
#include "cloud/exr/exr_reader.h"
#include "core/job_limits.h"
#include "view/channel.h"
#include "view/non_finite.h"
#include "view/picture.h"
#include "view/picture_file.h"
#include "view/row_field.h"
#include "view/value_map.h"

namespace surfeit {
namespace {

constexpr std::size_t kBatchRows = 4096;
constexpr int kMaxPixelsPerEdge = 32768;
constexpr int kMaxReduce = 16;
// Per pixel: the picture, the encoder's copy and the file in memory.
constexpr std::uint64_t kBytesPerPixel = sizeof(Picture::Pixel) + 32;
constexpr std::uint64_t kStreamBytes = std::uint64_t{64} << 20;

struct Place {
  std::int32_t y = 0, x = 0;
  auto operator<=>(const Place&) const = default;
};

// One input, row by row, in scan line order.
class PixelRows {
 public:
  static Result<PixelRows> open(const std::string& path) {
    PixelRows rows;
    RowReaderOptions as_stored;
    as_stored.color_range.reset();
    SURFEIT_ASSIGN_OR_RETURN(rows.reader_, openRowReader(path, as_stored));
    if (exrHeaderOf(rows.reader_.get()) == nullptr) {
      return Status::invalidArgument(
          fmt::format("{}: {}, expected an OpenEXR picture", path, rows.reader_->formatName()));
    }
    rows.x_ = RowField::find(rows.element(), "pixel_x");
    rows.y_ = RowField::find(rows.element(), "pixel_y");
    return rows;
  }

  const RowLayout& element() const { return reader_->element(); }
  const Imf::Header& header() const { return *exrHeaderOf(reader_.get()); }

  // The next row; nullptr at the end. Lasts until the next call.
  Result<const std::byte*> next() {
    const std::size_t row_bytes = element().row_bytes;
    if (at_ == batch_.size()) {
      SURFEIT_ASSIGN_OR_RETURN(batch_, reader_->readRows(kBatchRows, *buffer_));
      at_ = 0;
      if (batch_.empty()) return static_cast<const std::byte*>(nullptr);
    }
    const std::byte* const row = batch_.data() + at_;
    at_ += row_bytes;
    return row;
  }

  Place placeOf(const std::byte* row) const {
    return {std::int32_t(y_.read(row)), std::int32_t(x_.read(row))};
  }

 private:
  std::unique_ptr<RowReader> reader_;
  std::unique_ptr<AlignedBuffer> buffer_ = std::make_unique<AlignedBuffer>();
  Bytes batch_;
  std::size_t at_ = 0;
  RowField x_, y_;
};

// Rows of several inputs side by side: those of the first, beside them what the others have of the
// same pixel, or zeros.
class JoinedRows {
 public:
  static Result<JoinedRows> open(std::span<const std::string> paths) {
    JoinedRows joined;
    for (const std::string& path : paths) {
      SURFEIT_ASSIGN_OR_RETURN(PixelRows rows, PixelRows::open(path));
      joined.inputs_.push_back({std::move(rows), nullptr, joined.element_.row_bytes});
      const PixelRows& added = joined.inputs_.back().rows;
      const PixelRows& first = joined.inputs_.front().rows;
      if (added.header().dataWindow() != first.header().dataWindow()) {
        return Status::invalidArgument(
            fmt::format("{}: another data window than {}, expected the same", path, paths.front()));
      }
      for (RowProperty property : added.element().properties) {
        if (joined.element_.find(property.name) != nullptr) continue;
        property.offset += joined.element_.row_bytes;
        joined.element_.properties.push_back(std::move(property));
      }
      joined.element_.row_bytes += added.element().row_bytes;
    }
    joined.element_.count = joined.inputs_.front().rows.element().count;
    joined.row_.resize(joined.element_.row_bytes);
    for (std::size_t i = 1; i < joined.inputs_.size(); ++i) {
      SURFEIT_ASSIGN_OR_RETURN(joined.inputs_[i].row, joined.inputs_[i].rows.next());
    }
    return joined;
  }

  const RowLayout& element() const { return element_; }
  const Imf::Header& header() const { return inputs_.front().rows.header(); }

  // False at the end. row() and place() are those of the next pixel otherwise.
  Result<bool> next() {
    Input& first = inputs_.front();
    SURFEIT_ASSIGN_OR_RETURN(first.row, first.rows.next());
    if (first.row == nullptr) return false;
    place_ = first.rows.placeOf(first.row);
    for (Input& input : inputs_) {
      while (input.row != nullptr && input.rows.placeOf(input.row) < place_) {
        SURFEIT_ASSIGN_OR_RETURN(input.row, input.rows.next());
      }
      const bool is_there = input.row != nullptr && input.rows.placeOf(input.row) == place_;
      std::byte* const out = row_.data() + input.offset;
      const std::size_t size = input.rows.element().row_bytes;
      if (is_there)
        std::memcpy(out, input.row, size);
      else
        std::memset(out, 0, size);
    }
    return true;
  }
  const std::byte* row() const { return row_.data(); }
  const Place& place() const { return place_; }

 private:
  struct Input {
    PixelRows rows;
    const std::byte* row = nullptr;  // not used yet; nullptr: at the end
    std::size_t offset = 0;          // of its properties in a joined row
  };

  std::vector<Input> inputs_;
  RowLayout element_;
  std::vector<std::byte> row_;
  Place place_;
};

Status checkOptions(const CompositeOptions& options) {
  if (options.reduce < 1 || options.reduce > kMaxReduce) {
    return Status::invalidArgument(
        fmt::format("reduce {}: expected 1 to {} pixels", options.reduce, kMaxReduce));
  }
  if (!std::isfinite(options.exposure)) {
    return Status::invalidArgument("the exposure must be finite");
  }
  if (options.range && !(std::isfinite(options.range->x) && std::isfinite(options.range->y) &&
                         options.range->x != options.range->y)) {
    return Status::invalidArgument("the range needs two different finite numbers");
  }
  return {};
}

// A picture for the display window, which a file may claim to be of any size.
Result<Picture> createPicture(const Imath::Box2i& window, const std::string& path,
                              const CompositeOptions& options) {
  const std::int64_t width =
      (std::int64_t(window.max.x) - window.min.x + options.reduce) / options.reduce;
  const std::int64_t height =
      (std::int64_t(window.max.y) - window.min.y + options.reduce) / options.reduce;
  if (width < 1 || height < 1 || width > kMaxPixelsPerEdge || height > kMaxPixelsPerEdge) {
    return Status::invalidArgument(
        fmt::format("{}: a display window for {} x {} pixels, expected 1 to {} along each edge",
                    path, width, height, kMaxPixelsPerEdge));
  }
  const std::uint64_t budget =
      options.memory_bytes > 0 ? options.memory_bytes : defaultMemoryBytes();
  const std::uint64_t needed =
      std::uint64_t(width) * std::uint64_t(height) * kBytesPerPixel + kStreamBytes;
  if (needed > budget) {
    return Status::budgetTooSmall(
        fmt::format("a memory budget of {} MiB is too small for a picture of {}x{}: {} MiB is the "
                    "least that works",
                    budget >> 20, width, height, (needed >> 20) + 1));
  }
  Picture picture;
  picture.width = int(width);
  picture.height = int(height);
  picture.pixels.resize(std::size_t(width) * std::size_t(height));
  return picture;
}

// Adds every row to its pixel.
Status addRows(JoinedRows& rows, const Channel& channel, const CompositeOptions& options,
               Picture& picture, ValueExtent& extent, CompositeStats& stats, Progress& progress) {
  const Imath::Box2i window = rows.header().displayWindow();
  const RowField depth = RowField::find(rows.element(), "depth");
  const std::array<RowField, 3> position = {RowField::find(rows.element(), "x"),
                                            RowField::find(rows.element(), "y"),
                                            RowField::find(rows.element(), "z")};
  const float share = 1.0f / float(options.reduce * options.reduce);
  progress.beginPhase("pixels", rows.element().count, "pixels");
  for (std::uint64_t read = 0;; ++read) {
    if (read % kBatchRows == 0 && progress.isCancelled()) return Status::interrupted();
    SURFEIT_ASSIGN_OR_RETURN(const bool is_row, rows.next());
    if (!is_row) return {};
    progress.advance(1);
    const Place& place = rows.place();
    if (place.x < window.min.x || place.x > window.max.x || place.y < window.min.y ||
        place.y > window.max.y) {
      continue;
    }
    const std::int64_t x = (std::int64_t(place.x) - window.min.x) / options.reduce;
    const std::int64_t y = (std::int64_t(place.y) - window.min.y) / options.reduce;
    Picture::Pixel& pixel = picture.pixels[std::size_t(y * picture.width + x)];
    glm::vec3 value = channel.value(rows.row());
    if (isFinite(value)) {
      extent.addValue(double(value.x));
    } else {
      value = kNonFiniteColor;
      ++stats.non_finite_values;
    }
    extent.bounds.add(
        {position[0].read(rows.row()), position[1].read(rows.row()), position[2].read(rows.row())});
    pixel.color += share * value;
    pixel.alpha += share;
    if (depth.exists()) pixel.depth = std::min(pixel.depth, float(depth.read(rows.row())));
    ++stats.pixels;
  }
}

Result<CompositeStats> compose(std::span<const std::string> inputs, const std::string& path,
                               const CompositeOptions& options, Progress& progress) {
  SURFEIT_RETURN_IF_ERROR(checkOptions(options));
  SURFEIT_ASSIGN_OR_RETURN(const PictureFormat format, pictureFormat(path));
  if (inputs.empty()) return Status::invalidArgument("no picture to read");
  SURFEIT_ASSIGN_OR_RETURN(JoinedRows rows, JoinedRows::open(inputs));
  CompositeStats stats;
  stats.channel = options.channel.empty() ? Channel::choose(rows.element()) : options.channel;
  SURFEIT_ASSIGN_OR_RETURN(const Channel channel,
                           Channel::find(rows.element(), stats.channel, inputs.front()));
  SURFEIT_ASSIGN_OR_RETURN(Picture picture,
                           createPicture(rows.header().displayWindow(), inputs.front(), options));
  stats.width = picture.width;
  stats.height = picture.height;
  ValueExtent extent;
  SURFEIT_RETURN_IF_ERROR(addRows(rows, channel, options, picture, extent, stats, progress));
  if (stats.non_finite_values > 0) {
    progress.note(fmt::format("{}: {} values of channel {} are not finite; drawn in magenta",
                              inputs.front(), stats.non_finite_values, stats.channel));
  }

  const ValueMap map = chooseValueMap(options.range, channel, extent, format, progress);
  for (Picture::Pixel& pixel : picture.pixels) {
    pixel.color = map.scale * pixel.color + pixel.alpha * map.offset;
  }
  PngOptions png;
  png.exposure = options.exposure;
  png.is_data = channel.kind() != ValueKind::kLight;
  png.background = options.background;
  SURFEIT_RETURN_IF_ERROR(writePicture(path, picture, png));
  return stats;
}

}  // namespace

Result<CompositeStats> compositePicture(const std::vector<std::string>& inputs,
                                        const std::string& picture, const CompositeOptions& options,
                                        Progress& progress) {
  try {
    return compose(inputs, picture, options, progress);
  } catch (const std::bad_alloc&) {
    return Status::budgetTooSmall(fmt::format("{}: out of memory", picture));
  } catch (const std::exception& error) {
    return Status::failed(fmt::format("{}: {}", picture, error.what()));
  }
}

}  // namespace surfeit
