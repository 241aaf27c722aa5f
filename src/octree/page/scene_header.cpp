#include "octree/page/scene_header.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <iterator>

#include "storage/byte_coding.h"

namespace surfeit {
namespace {

// Bits of the channel field.
enum ChannelBits : std::uint32_t {
  kHasNormal = 1,
  kHasRadius = 2,
  kHasArea = 4,
  kHasRadiosity = 8,
  kHasAlbedo = 16,
  kHasTwoSided = 32,
  kHasGroup = 64,
  kHasLongSide = 128,
  kHasOpacity = 256,
  kHasTint = 512,
  kAllChannels = 1023,
};

// Bits of the feature field. A reader refuses bits that it does not know.
enum FeatureBits : std::uint32_t {
  kFullPrecision = 1,
  kHasLobes = 2,
  kHasLayers = 4,
  kHasLoose = 8,
  kHasRectangles = 16,
  kHasSharers = 32,
  kHasTiles = 64,
  kHasVariances = 128,
  kHasSlopes = 256,
  kAllFeatures = 511
};

// Largest groups that a reader accepts: they bound what a page can make it allocate.
constexpr std::uint32_t kMaxNodeGroup = 4096;
constexpr std::uint32_t kMaxSurfelGroup = 16384;

// As far from 0 as coordinates of clouds may be (docs/format.md, "Limits").
constexpr double kLargestOrigin = 1e12;

std::uint32_t channelBits(const CloudChannels& channels) {
  return (channels.normal ? kHasNormal : 0u) | (channels.radius ? kHasRadius : 0u) |
         (channels.area ? kHasArea : 0u) | (channels.radiosity ? kHasRadiosity : 0u) |
         (channels.albedo ? kHasAlbedo : 0u) | (channels.two_sided ? kHasTwoSided : 0u) |
         (channels.group ? kHasGroup : 0u) | (channels.long_side ? kHasLongSide : 0u) |
         (channels.opacity ? kHasOpacity : 0u) | (channels.tint ? kHasTint : 0u);
}

CloudChannels channelsFromBits(std::uint32_t bits) {
  CloudChannels channels;
  channels.normal = (bits & kHasNormal) != 0;
  channels.radius = (bits & kHasRadius) != 0;
  channels.area = (bits & kHasArea) != 0;
  channels.radiosity = (bits & kHasRadiosity) != 0;
  channels.albedo = (bits & kHasAlbedo) != 0;
  channels.two_sided = (bits & kHasTwoSided) != 0;
  channels.group = (bits & kHasGroup) != 0;
  channels.long_side = (bits & kHasLongSide) != 0;
  channels.opacity = (bits & kHasOpacity) != 0;
  channels.tint = (bits & kHasTint) != 0;
  return channels;
}

template <typename T>
Status wrongField(const char* field, const T& found, const std::string& expected) {
  return Status::corruption(fmt::format("header: {} is {}, expected {}", field, found, expected));
}

Status checkGeometry(const SceneHeader& header) {
  for (int axis = 0; axis < 3; ++axis) {
    if (!std::isfinite(header.bounds.min[axis]) || !std::isfinite(header.bounds.max[axis]) ||
        header.bounds.min[axis] > header.bounds.max[axis]) {
      return Status::corruption(fmt::format("header: bounds {}..{} on axis {} are no interval",
                                            header.bounds.min[axis], header.bounds.max[axis],
                                            axis));
    }
    if (!std::isfinite(header.cube.origin[axis])) {
      return wrongField("root cube origin", header.cube.origin[axis], "a finite number");
    }
    if (!(std::abs(header.origin[axis]) <= kLargestOrigin)) {
      return wrongField("origin", header.origin[axis], "a number of at most 1e12");
    }
  }
  if (!std::isfinite(header.cube.size) || header.cube.size <= 0) {
    return wrongField("root cube size", header.cube.size, "a positive number");
  }
  if (!(header.flatness_limit >= 0 && header.flatness_limit <= 1)) {
    return wrongField("flatness limit", header.flatness_limit, "0 to 1");
  }
  return {};
}

Status checkCounts(const SceneHeader& header, std::uint32_t node_pages,
                   std::uint32_t surfel_pages) {
  if (header.leaf_capacity == 0) return wrongField("leaf capacity", 0, "at least 1");
  if (header.node_group_capacity < 8 || header.node_group_capacity > kMaxNodeGroup) {
    return wrongField("node group capacity", header.node_group_capacity,
                      fmt::format("8 to {}", kMaxNodeGroup));
  }
  if (header.surfel_group_capacity == 0 || header.surfel_group_capacity > kMaxSurfelGroup) {
    return wrongField("surfel group capacity", header.surfel_group_capacity,
                      fmt::format("1 to {}", kMaxSurfelGroup));
  }
  // Every page holds at least one record and at most its group's capacity
  if (header.surfel_count < std::max(surfel_pages, 1u) ||
      header.surfel_count > std::uint64_t{surfel_pages} * header.surfel_group_capacity) {
    return wrongField("surfel count", header.surfel_count,
                      fmt::format("what {} pages can hold", surfel_pages));
  }
  if (header.node_count < std::max(node_pages, 1u) ||
      header.node_count > std::uint64_t{node_pages} * header.node_group_capacity) {
    return wrongField("node count", header.node_count,
                      fmt::format("what {} pages can hold", node_pages));
  }
  // Levels: the root's page stands alone, then first pages never go back
  const auto& first = header.level_first_page;
  if (first[0] != 0 || first[1] != 1 || first[kCurveLevels + 1] != node_pages ||
      !std::is_sorted(std::begin(first), std::end(first))) {
    return wrongField("level table", fmt::format("{}..{}", first[0], first[kCurveLevels + 1]),
                      fmt::format("rising from 0 to {}", node_pages));
  }
  return {};
}

// In the order of their codes: files of version 1 have 0.
constexpr UpAxis kUpAxes[] = {UpAxis::kY, UpAxis::kZ, UpAxis::kX};

std::uint32_t codeOf(UpAxis up) {
  return std::uint32_t(std::find(std::begin(kUpAxes), std::end(kUpAxes), up) - std::begin(kUpAxes));
}

}  // namespace

std::vector<std::byte> encodeSceneHeader(const SceneHeader& header) {
  std::vector<std::byte> bytes;
  ByteWriter writer(bytes);
  writer.put((header.full_precision ? kFullPrecision : 0u) | (header.has_lobes ? kHasLobes : 0u) |
             (header.has_layers ? kHasLayers : 0u) | (header.has_loose ? kHasLoose : 0u) |
             (header.has_rectangles ? kHasRectangles : 0u) |
             (header.has_sharers ? kHasSharers : 0u) | (header.has_tiles ? kHasTiles : 0u) |
             (header.has_variances ? kHasVariances : 0u) | (header.has_slopes ? kHasSlopes : 0u));
  writer.put(channelBits(header.channels));
  writer.put(header.surfel_count);
  writer.put(header.node_count);
  writer.put(header.leaf_capacity);
  writer.put(header.node_group_capacity);
  writer.put(header.surfel_group_capacity);
  writer.put(header.flatness_limit);
  for (int axis = 0; axis < 3; ++axis) writer.put(header.bounds.min[axis]);
  for (int axis = 0; axis < 3; ++axis) writer.put(header.bounds.max[axis]);
  for (const double origin : header.cube.origin) writer.put(origin);
  writer.put(header.cube.size);
  for (const std::uint32_t page : header.level_first_page) writer.put(page);
  writer.put(codeOf(header.up));
  for (int axis = 0; axis < 3; ++axis) writer.put(header.origin[axis]);
  return bytes;
}

Result<SceneHeader> decodeSceneHeader(Bytes fields, std::uint32_t node_page_count,
                                      std::uint32_t surfel_page_count) {
  ByteReader reader(fields);
  SceneHeader header;
  const std::uint32_t features = reader.get<std::uint32_t>();
  if ((features & ~kAllFeatures) != 0) {
    return wrongField("feature bits", fmt::format("{:#x}", features),
                      fmt::format("none beyond {:#x}; a newer program wrote this file",
                                  std::uint32_t{kAllFeatures}));
  }
  header.full_precision = (features & kFullPrecision) != 0;
  header.has_lobes = (features & kHasLobes) != 0;
  header.has_layers = (features & kHasLayers) != 0;
  header.has_loose = (features & kHasLoose) != 0;
  header.has_rectangles = (features & kHasRectangles) != 0;
  header.has_sharers = (features & kHasSharers) != 0;
  header.has_tiles = (features & kHasTiles) != 0;
  header.has_variances = (features & kHasVariances) != 0;
  header.has_slopes = (features & kHasSlopes) != 0;
  const std::uint32_t channels = reader.get<std::uint32_t>();
  if ((channels & ~kAllChannels) != 0) {
    return wrongField("channel bits", fmt::format("{:#x}", channels), "known channels");
  }
  header.channels = channelsFromBits(channels);
  if (header.channels.tint && !header.channels.opacity) {
    return wrongField("channel bits", fmt::format("{:#x}", channels),
                      "opacity where there are tints");
  }
  header.surfel_count = reader.get<std::uint64_t>();
  header.node_count = reader.get<std::uint64_t>();
  header.leaf_capacity = reader.get<std::uint32_t>();
  header.node_group_capacity = reader.get<std::uint32_t>();
  header.surfel_group_capacity = reader.get<std::uint32_t>();
  header.flatness_limit = reader.get<float>();
  for (int axis = 0; axis < 3; ++axis) header.bounds.min[axis] = reader.get<float>();
  for (int axis = 0; axis < 3; ++axis) header.bounds.max[axis] = reader.get<float>();
  for (double& origin : header.cube.origin) origin = reader.get<double>();
  header.cube.size = reader.get<double>();
  for (std::uint32_t& page : header.level_first_page) page = reader.get<std::uint32_t>();
  const std::uint32_t up = reader.get<std::uint32_t>();
  if (up >= std::size(kUpAxes)) return wrongField("up axis", up, "0 to 2");
  header.up = kUpAxes[up];
  for (int axis = 0; axis < 3; ++axis) header.origin[axis] = reader.get<double>();
  const std::span<const std::byte> unused = reader.take(reader.remaining());
  if (!std::all_of(unused.begin(), unused.end(), [](std::byte b) { return b == std::byte{0}; })) {
    return wrongField("reserved space", "not zero", "zero");
  }
  SURFEIT_RETURN_IF_ERROR(checkGeometry(header));
  SURFEIT_RETURN_IF_ERROR(checkCounts(header, node_page_count, surfel_page_count));
  return header;
}

}  // namespace surfeit
