#include "octree/node_group.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "core/curve_key.h"
#include "octree/column_codec.h"

namespace surfeit {
namespace {

// Position error allowed, as a part of the smallest node radius in the group; the radii stored
// grow by as much, so that they still hold every disk.
constexpr float kPositionTolerance = 1e-3f;

// Coefficients are stored over area (times mean radiosity): largest for spheres, 4 pi Y00 = 3.54.
constexpr float kCoefficientLimit = 4;

// Coefficients of a rough node: 9 of area and 27 of power.
constexpr std::size_t kCoefficientCount = 4 * kShCount;

template <typename T, typename Field>
std::vector<T> column(std::span<const LevelNode> nodes, Field field) {
  std::vector<T> values(nodes.size());
  std::transform(nodes.begin(), nodes.end(), values.begin(), field);
  return values;
}

Status damaged(const char* field) {
  return Status::corruption(fmt::format("node group: damaged field {}", field));
}

float coefficient(const Node& node, std::size_t i) {
  return i < kShCount ? node.area_sh[i] : node.power_sh[i / kShCount - 1][i % kShCount];
}

void setCoefficient(Node& node, std::size_t i, float value) {
  (i < kShCount ? node.area_sh[i] : node.power_sh[i / kShCount - 1][i % kShCount]) = value;
}

// What coefficient i is stored relative to.
float coefficientScale(const Node& node, std::size_t i) {
  return i < kShCount ? node.area : node.area * node.radiosity[static_cast<int>(i / kShCount) - 1];
}

// Scratch of decodeNodeGroup, per thread.
struct DecodeScratch {
  std::vector<glm::vec3> vectors;
  std::vector<float> numbers;
  std::vector<std::uint8_t> bytes;
  std::vector<std::uint64_t> pages, firsts, counts;

  void resize(std::size_t size) {
    if (vectors.size() >= size) return;
    vectors.resize(size);
    numbers.resize(size);
    bytes.resize(size);
    pages.resize(size);
    firsts.resize(size);
    counts.resize(size);
  }
};

// The level that a node page belongs to.
int levelOfPage(std::span<const std::uint32_t> level_first_page, std::uint32_t page) {
  const auto after = std::upper_bound(level_first_page.begin(), level_first_page.end(), page);
  return static_cast<int>(after - level_first_page.begin()) - 1;
}

// Turns stored references into global ones and checks that they point at something that exists.
Status resolveReference(const NodeLimits& limits, int level, int child_level,
                        std::uint64_t stored_page, std::uint64_t first, Node& node) {
  if (node.isLeaf()) {
    if (child_level != 0) return damaged("child level");
    if (stored_page >= limits.surfel_page_count || first >= limits.surfel_group_capacity ||
        node.surfel_count == 0) {
      return damaged("surfel reference");
    }
    // Only a leaf that begins a page may run over its end, and its pages must exist
    const std::uint64_t pages_after = limits.surfel_page_count - stored_page;
    if (node.surfel_count > pages_after * limits.surfel_group_capacity ||
        (first > 0 && node.surfel_count > limits.surfel_group_capacity - first)) {
      return damaged("surfel count");
    }
    node.page = static_cast<std::uint32_t>(stored_page);
  } else {
    if (child_level <= level || child_level > kCurveLevels) return damaged("child level");
    const std::uint64_t begin = limits.level_first_page[static_cast<std::size_t>(child_level)];
    const std::uint64_t end = limits.level_first_page[static_cast<std::size_t>(child_level) + 1];
    if (stored_page >= end - begin || node.child_count > 8 || node.child_count < 2 ||
        first > limits.node_group_capacity - node.child_count) {
      return damaged("child reference");
    }
    node.page = static_cast<std::uint32_t>(begin + stored_page);
  }
  node.first = static_cast<std::uint16_t>(first);
  return {};
}

// Positions, sizes, directions and colors.
Status decodeShapes(ByteReader& reader, bool full_precision, DecodeScratch& scratch,
                    std::span<Node> out) {
  const std::size_t count = out.size();
  const std::span<glm::vec3> vectors = std::span(scratch.vectors).first(count);
  const std::span<float> numbers = std::span(scratch.numbers).first(count);
  if (!getPositions(reader, vectors)) return damaged("position");
  for (std::size_t i = 0; i < count; ++i) out[i].position = vectors[i];
  if (!getPositive(reader, numbers)) return damaged("radius");
  for (std::size_t i = 0; i < count; ++i) out[i].radius = numbers[i];
  if (!getPositive(reader, numbers)) return damaged("area");
  for (std::size_t i = 0; i < count; ++i) out[i].area = numbers[i];
  if (!getNormals(reader, vectors)) return damaged("normal");
  for (std::size_t i = 0; i < count; ++i) out[i].normal = vectors[i];
  if (!(full_precision ? getFloats(reader, numbers) : getSigned(reader, numbers, 1))) {
    return damaged("flatness");
  }
  for (std::size_t i = 0; i < count; ++i) {
    if (!(numbers[i] >= 0 && numbers[i] <= 1)) return damaged("flatness");
    out[i].flatness = numbers[i];
  }
  if (!getColors(reader, vectors)) return damaged("radiosity");
  for (std::size_t i = 0; i < count; ++i) {
    out[i].radiosity = vectors[i];
    const float largest = std::max({vectors[i].x, vectors[i].y, vectors[i].z});
    if (!std::isfinite(out[i].area * largest * kCoefficientLimit)) return damaged("radiosity");
  }
  return {};
}

// What lies below each node; child levels, pages and firsts wait in scratch until all are there.
Status decodeReferences(ByteReader& reader, const NodeLimits& limits, int level,
                        DecodeScratch& scratch, std::span<Node> out) {
  const std::size_t count = out.size();
  const std::span<std::uint8_t> bytes = std::span(scratch.bytes).first(count);
  const std::span<std::uint64_t> pages = std::span(scratch.pages).first(count);
  const std::span<std::uint64_t> firsts = std::span(scratch.firsts).first(count);
  const std::span<std::uint64_t> counts = std::span(scratch.counts).first(count);
  if (!getBytes8(reader, bytes)) return damaged("flags");
  for (std::size_t i = 0; i < count; ++i) {
    if ((bytes[i] & ~kNodeFlat) != 0) return damaged("flags");
    out[i].flags = bytes[i];
  }
  if (!getBytes8(reader, bytes)) return damaged("child count");
  for (std::size_t i = 0; i < count; ++i) out[i].child_count = bytes[i];
  if (!getBytes8(reader, bytes)) return damaged("child level");
  if (!getCounts(reader, pages)) return damaged("page");
  if (!getCounts(reader, firsts)) return damaged("first");
  if (!getCounts(reader, counts)) return damaged("surfel count");
  for (std::size_t i = 0; i < count; ++i) {
    out[i].surfel_count = counts[i];
    SURFEIT_RETURN_IF_ERROR(resolveReference(limits, level, bytes[i], pages[i], firsts[i], out[i]));
  }
  return {};
}

// Harmonics of the nodes that are not flat.
Status decodeCoefficients(ByteReader& reader, bool full_precision, DecodeScratch& scratch,
                          std::span<Node> out) {
  std::size_t rough = 0;
  for (const Node& node : out) rough += node.isFlat() ? 0 : 1;
  for (std::size_t i = 0; i < kCoefficientCount; ++i) {
    const std::span<float> values = std::span(scratch.numbers).first(rough);
    if (!(full_precision ? getFloats(reader, values)
                         : getSigned(reader, values, kCoefficientLimit))) {
      return damaged("coefficients");
    }
    std::size_t next = 0;
    for (Node& node : out) {
      if (node.isFlat()) continue;
      setCoefficient(node, i, values[next++] * (full_precision ? 1 : coefficientScale(node, i)));
    }
  }
  // |sum A n| is zero in these: no direction
  for (Node& node : out) {
    if (node.flatness == 0) node.normal = glm::vec3(0);
  }
  return {};
}

}  // namespace

void encodeNodeGroup(std::span<const LevelNode> nodes, bool full_precision,
                     std::vector<std::byte>& payload) {
  payload.clear();
  ByteWriter writer(payload);
  writer.put(static_cast<std::uint32_t>(nodes.size()));

  const auto positions =
      column<glm::vec3>(nodes, [](const LevelNode& n) { return n.node.position; });
  auto radii = column<float>(nodes, [](const LevelNode& n) { return n.node.radius; });
  const float max_error = *std::min_element(radii.begin(), radii.end()) * kPositionTolerance;
  const float error = positionError(positions, max_error, full_precision);
  for (float& radius : radii) radius += error;
  putPositions(writer, positions, max_error, full_precision);
  putPositive(writer, radii, Rounding::kUp, full_precision);
  putPositive(writer, column<float>(nodes, [](const LevelNode& n) { return n.node.area; }),
              Rounding::kNearest, full_precision);
  putNormals(writer, column<glm::vec3>(nodes, [](const LevelNode& n) { return n.node.normal; }),
             full_precision);
  const auto flatness = column<float>(nodes, [](const LevelNode& n) { return n.node.flatness; });
  full_precision ? putFloats(writer, flatness) : putSigned(writer, flatness, 1);
  putColors(writer, column<glm::vec3>(nodes, [](const LevelNode& n) { return n.node.radiosity; }),
            full_precision);

  // References
  putBytes8(writer, column<std::uint8_t>(nodes, [](const LevelNode& n) { return n.node.flags; }));
  putBytes8(writer,
            column<std::uint8_t>(nodes, [](const LevelNode& n) { return n.node.child_count; }));
  putBytes8(writer, column<std::uint8_t>(nodes, [](const LevelNode& n) { return n.child_level; }));
  putCounts(writer, column<std::uint64_t>(nodes, [](const LevelNode& n) { return n.node.page; }));
  putCounts(writer, column<std::uint64_t>(nodes, [](const LevelNode& n) { return n.node.first; }));
  putCounts(writer,
            column<std::uint64_t>(nodes, [](const LevelNode& n) { return n.node.surfel_count; }));

  // Coefficients of the nodes that are not flat, relative to what a reader decodes
  std::vector<float> values;
  for (std::size_t i = 0; i < kCoefficientCount; ++i) {
    values.clear();
    for (const LevelNode& n : nodes) {
      if (n.node.isFlat()) continue;
      const float scale = full_precision ? 1 : coefficientScale(n.node, i);
      values.push_back(scale > 0 ? coefficient(n.node, i) / scale : 0);
    }
    full_precision ? putFloats(writer, values) : putSigned(writer, values, kCoefficientLimit);
  }
}

Result<std::uint32_t> decodeNodeGroup(Bytes payload, bool full_precision, std::uint32_t page,
                                      const NodeLimits& limits, std::span<Node> nodes) {
  ByteReader reader(payload);
  const std::uint32_t count = reader.get<std::uint32_t>();
  if (!reader.ok() || count == 0 || count > nodes.size()) {
    return Status::corruption(
        fmt::format("node group: {} nodes, expected 1 to {}", count, nodes.size()));
  }
  thread_local DecodeScratch scratch;
  scratch.resize(nodes.size());
  const std::span<Node> out = nodes.first(count);
  std::fill(out.begin(), out.end(), Node());

  SURFEIT_RETURN_IF_ERROR(decodeShapes(reader, full_precision, scratch, out));
  const int level = levelOfPage(limits.level_first_page, page);
  SURFEIT_RETURN_IF_ERROR(decodeReferences(reader, limits, level, scratch, out));
  SURFEIT_RETURN_IF_ERROR(decodeCoefficients(reader, full_precision, scratch, out));
  if (reader.remaining() != 0) {
    return Status::corruption(
        fmt::format("node group: {} bytes after the last field", reader.remaining()));
  }
  return count;
}

}  // namespace surfeit
