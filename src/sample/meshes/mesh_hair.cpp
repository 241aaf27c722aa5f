// Strands from cyHair files (Yuksel, http://www.cemyuksel.com/research/hairmodels/):
//
//   [ "HAIR" | strands u32 | points u32 | arrays u32 | segments u32 | thickness f32
//     | transparency f32 | color 3 f32 | text 88 ]                                   128 bytes
//   [ segments of each strand, u16 ] [ points, 3 f32 ] [ thickness, f32 ]
//   [ transparency, f32 ] [ color, 3 f32 ]                     those that `arrays` has a bit for
//
// Segments, thickness, transparency and color of the header are for strands without an array.
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <memory>
#include <span>
#include <vector>

#include "sample/meshes/curves.h"
#include "sample/meshes/mesh_builder.h"
#include "storage/byte_coding.h"
#include "storage/file.h"

namespace surfeit {
namespace {

constexpr std::size_t kHeaderBytes = 128;
enum HairArray : std::uint32_t {
  kSegments = 1,
  kPoints = 2,
  kThickness = 4,
  kTransparency = 8,
  kColors = 16,
  kAllArrays = 31
};

struct HairHeader {
  std::uint32_t strands = 0, points = 0, arrays = 0, segments = 0;
  float thickness = 0, transparency = 0;
  glm::vec3 color{0};

  bool has(HairArray array) const { return (arrays & array) != 0; }
};

// One array of the file, read from front to back a buffer at a time.
class HairStream {
 public:
  HairStream(const InputFile& file, std::uint64_t offset, std::uint64_t bytes)
      : file_(file), offset_(offset), end_(offset + bytes) {}

  template <typename T>
  Status read(T& value) {
    std::span<std::byte> to = std::as_writable_bytes(std::span(&value, 1));
    while (!to.empty()) {
      if (next_ == buffer_.size()) SURFEIT_RETURN_IF_ERROR(fill());
      const std::size_t count = std::min(to.size(), buffer_.size() - next_);
      std::memcpy(to.data(), buffer_.data() + next_, count);
      next_ += count;
      to = to.subspan(count);
    }
    return {};
  }

 private:
  Status fill() {
    constexpr std::uint64_t kBufferBytes = 1 << 16;
    buffer_.resize(std::size_t(std::min(kBufferBytes, end_ - offset_)));
    next_ = 0;
    if (buffer_.empty()) {
      return Status::corruption(fmt::format("{}: an array ends early", file_.path()));
    }
    SURFEIT_RETURN_IF_ERROR(file_.readAt(offset_, buffer_));
    offset_ += buffer_.size();
    return {};
  }

  const InputFile& file_;
  std::uint64_t offset_, end_;
  std::vector<std::byte> buffer_;
  std::size_t next_ = 0;
};

Result<HairHeader> readHeader(const InputFile& file) {
  std::array<std::byte, kHeaderBytes> bytes{};
  if (file.size() < kHeaderBytes) {
    return Status::corruption(fmt::format("{}: found {} bytes, expected a header of {}",
                                          file.path(), file.size(), kHeaderBytes));
  }
  SURFEIT_RETURN_IF_ERROR(file.readAt(0, bytes));
  ByteReader reader(std::span<const std::byte>(bytes).subspan(4));
  HairHeader header;
  header.strands = reader.get<std::uint32_t>();
  header.points = reader.get<std::uint32_t>();
  header.arrays = reader.get<std::uint32_t>();
  header.segments = reader.get<std::uint32_t>();
  header.thickness = reader.get<float>();
  header.transparency = reader.get<float>();
  for (int i = 0; i < 3; ++i) header.color[i] = reader.get<float>();
  if (!header.has(kPoints) || header.arrays > kAllArrays) {
    return Status::corruption(fmt::format(
        "{}: at 12: found the arrays {:#x}, expected the bits of 0x1f, points (2) among "
        "them",
        file.path(), header.arrays));
  }
  return header;
}

// Colors are sRGB, as those of other meshes without linear ones.
glm::vec3 linearOf(const glm::vec3& srgb) {
  glm::vec3 color(0);
  for (int i = 0; i < 3; ++i) {
    if (srgb[i] > 0) color[i] = linearFromSrgb(std::min(srgb[i], 1.0f));
  }
  return color;
}

// The strands of a file, one after the other.
class HairFile {
 public:
  static Result<HairFile> open(const std::string& path, const CurveOptions& options) {
    SURFEIT_ASSIGN_OR_RETURN(InputFile input, InputFile::open(path));
    SURFEIT_ASSIGN_OR_RETURN(const HairHeader header, readHeader(input));
    HairFile hair(std::move(input), header, options);
    SURFEIT_RETURN_IF_ERROR(hair.placeArrays());
    return hair;
  }

  const HairHeader& header() const { return header_; }
  std::uint64_t bytesBehind() const { return file_->size() - end_; }

  // Points whose color or transparency had to be cut, among those that were visited last.
  std::uint64_t cutPoints() const { return cut_points_; }

  // Calls visit(strand, points) for each; the points are overwritten by the next.
  Status forEachStrand(const Progress& progress, const StrandVisit& visit) {
    cut_points_ = 0;
    const auto stream = [&](HairArray array, std::size_t i, std::uint64_t bytes) {
      return HairStream(*file_, offset_[i], header_.has(array) ? bytes : 0);
    };
    const std::uint64_t count = header_.points;
    HairStream segments = stream(kSegments, 0, 2 * std::uint64_t(header_.strands));
    HairStream places = stream(kPoints, 1, 12 * count);
    HairStream widths = stream(kThickness, 2, 4 * count);
    HairStream clears = stream(kTransparency, 3, 4 * count);
    HairStream colors = stream(kColors, 4, 12 * count);
    std::uint64_t used = 0;
    std::vector<CurvePoint> points;
    for (std::uint64_t strand = 0; strand < header_.strands; ++strand) {
      if (strand % 4096 == 0 && progress.isCancelled()) return Status::interrupted();
      std::uint16_t length = 0;
      if (header_.has(kSegments)) SURFEIT_RETURN_IF_ERROR(segments.read(length));
      const std::uint64_t corners = 1 + (header_.has(kSegments) ? length : header_.segments);
      if (corners > count - used) return wrongCount(strand, used + corners);
      used += corners;
      points.resize(std::size_t(corners));
      for (CurvePoint& point : points) {
        SURFEIT_RETURN_IF_ERROR(readPoint(places, widths, clears, colors, point));
      }
      SURFEIT_RETURN_IF_ERROR(visit(strand, std::span<const CurvePoint>(points)));
    }
    if (used != count) return wrongCount(header_.strands, used);
    return {};
  }

 private:
  HairFile(InputFile file, const HairHeader& header, const CurveOptions& options)
      : file_(std::make_unique<InputFile>(std::move(file))), header_(header), options_(options) {}

  // Compares what the header counts with the bytes that there are.
  Status placeArrays() {
    const std::uint64_t points = header_.points;
    const std::uint64_t bytes[5] = {2 * std::uint64_t(header_.strands), 12 * points, 4 * points,
                                    4 * points, 12 * points};
    end_ = kHeaderBytes;
    for (std::size_t i = 0; i < 5; ++i) {
      offset_[i] = end_;
      if (header_.has(HairArray(1u << i))) end_ += bytes[i];
    }
    if (end_ <= file_->size()) return {};
    return Status::corruption(
        fmt::format("{}: found {} bytes, expected {} for {} strands of {} points", file_->path(),
                    file_->size(), end_, header_.strands, header_.points));
  }

  Status readPoint(HairStream& places, HairStream& widths, HairStream& clears, HairStream& colors,
                   CurvePoint& point) {
    std::array<float, 3> place{}, color{header_.color.x, header_.color.y, header_.color.z};
    float width = header_.thickness, clear = header_.transparency;
    SURFEIT_RETURN_IF_ERROR(places.read(place));
    if (header_.has(kThickness)) SURFEIT_RETURN_IF_ERROR(widths.read(width));
    if (header_.has(kTransparency)) SURFEIT_RETURN_IF_ERROR(clears.read(clear));
    if (header_.has(kColors)) SURFEIT_RETURN_IF_ERROR(colors.read(color));
    const auto isPart = [](float value) { return value >= 0 && value <= 1; };
    if (!isPart(clear) || !std::all_of(color.begin(), color.end(), isPart)) ++cut_points_;
    point.position = {place[0], place[1], place[2]};
    // What is partly clear covers as a thinner strand does
    const double there = 1 - std::clamp(double(clear), 0.0, 1.0);
    point.width = (options_.width > 0 ? options_.width : double(width)) * there;
    point.color = linearOf({color[0], color[1], color[2]});
    return {};
  }

  Status wrongCount(std::uint64_t strand, std::uint64_t found) const {
    return Status::corruption(
        fmt::format("{}: strand {}: {} points up to here, expected {} in all strands",
                    file_->path(), strand, found, header_.points));
  }

  std::unique_ptr<InputFile> file_;
  HairHeader header_;
  CurveOptions options_;
  std::uint64_t offset_[5] = {}, end_ = 0, cut_points_ = 0;
};

}  // namespace

Status loadHairMesh(const std::string& path, const CurveOptions& options, MeshBuilder& builder,
                    Progress& progress) {
  SURFEIT_ASSIGN_OR_RETURN(HairFile hair, HairFile::open(path, options));
  if (hair.bytesBehind() > 0) {
    progress.note(
        fmt::format("{}: {} bytes behind the last array are ignored", path, hair.bytesBehind()));
  }
  SURFEIT_RETURN_IF_ERROR(addStrands(
      path, hair.header().strands, options,
      [&](const StrandVisit& visit) { return hair.forEachStrand(progress, visit); }, builder,
      progress));
  if (hair.cutPoints() > 0) {
    progress.note(fmt::format(
        "{}: {} points have a color or transparency outside 0 to 1, which is cut (colors are sRGB)",
        path, hair.cutPoints()));
  }
  return {};
}

}  // namespace surfeit
