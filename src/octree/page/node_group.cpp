#include "octree/page/node_group.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "core/thread_scratch.h"
#include "octree/node/radiosity_variance.h"
#include "octree/node/stored_loss.h"
#include "octree/page/column_codec.h"
#include "octree/page/facet_columns.h"
#include "octree/page/lobe_columns.h"
#include "octree/page/node_bounds.h"
#include "octree/page/node_moments.h"
#include "octree/page/node_references.h"
#include "octree/page/transparency_columns.h"
#include "surfeit/surfel.h"

namespace surfeit {
namespace {

// Makes up for rounding to a float.
constexpr double kRoundedUp = 1 + 1.2e-7;

// Coefficients are stored over area (times mean radiosity): largest for spheres, 4 pi Y00 = 3.54.
constexpr float kCoefficientLimit = 4;

// Of a rough node: 9 of projected area, and 9 of projected power in each color.
constexpr std::size_t kCoefficientKinds = kNodeShKinds;

Status damaged(const char* field) {
  return Status::corruption(fmt::format("node group: damaged field {}", field));
}

// Positions and normals as a reader will find them. Every page of a thread uses the same.
struct StoredPlaces {
  MutableAxes position, normal;
  bool are_readable = false;

  StoredPlaces(const Axes& positions, const Axes& normals, float max_error, bool full_precision) {
    std::vector<float>& floats = threadScratch<std::vector<float>>([] {});
    std::vector<std::byte>& payload = threadScratch<std::vector<std::byte>>([] {});
    const std::size_t count = positions[0].size();
    floats.resize(6 * count);
    for (std::size_t axis = 0; axis < 3; ++axis) {
      position[axis] = std::span(floats).subspan(axis * count, count);
      normal[axis] = std::span(floats).subspan((3 + axis) * count, count);
    }
    PayloadWriter writer(payload, static_cast<std::uint32_t>(count));
    putPositions(writer, positions, max_error, full_precision);
    putNormals(writer, normals, full_precision);
    writer.finish();
    PayloadReader reader(payload);
    are_readable = getPositions(reader, position) && getNormals(reader, normal);
  }
};

// The nodes of a page as columns. Every page of a thread uses the same.
class Columns {
 public:
  explicit Columns(std::size_t count) {
    std::vector<float>& floats = threadScratch<std::vector<float>>([] {});
    std::vector<std::uint8_t>& bytes = threadScratch<std::vector<std::uint8_t>>([] {});
    std::vector<std::uint64_t>& integers = threadScratch<std::vector<std::uint64_t>>([] {});
    if (bytes.size() < kByteColumns * count) {
      floats.resize(kFloatColumns * count);
      bytes.resize(kByteColumns * count);
      integers.resize(kIntegerColumns * count);
    }
    const auto column = [&](auto& values, std::size_t i) {
      return std::span(values).subspan(i * count, count);
    };
    for (std::size_t axis = 0; axis < 3; ++axis) {
      position[axis] = column(floats, axis);
      normal[axis] = column(floats, 3 + axis);
      radiosity[axis] = column(floats, 6 + axis);
    }
    radius = column(floats, 9);
    area = column(floats, 10);
    flatness = column(floats, 11);
    flags = column(bytes, 0);
    child_count = column(bytes, 1);
    child_level = column(bytes, 2);
    thickness = column(bytes, 3);
    cone = column(bytes, 4);
    transparency.bytes = {column(bytes, 5), column(bytes, 6)};
    tints.differences = {TransparencyColumns{{column(bytes, 7), column(bytes, 8)}},
                         TransparencyColumns{{column(bytes, 9), column(bytes, 10)}}};
    variance = column(bytes, 11);
    page = column(integers, 0);
    first = column(integers, 1);
    surfel_count = column(integers, 2);
    groups = column(integers, 3);
  }

  void gather(std::span<const LevelNode> nodes) {
    for (std::size_t i = 0; i < nodes.size(); ++i) {
      const Node& node = nodes[i].node;
      for (std::size_t axis = 0; axis < 3; ++axis) {
        position[axis][i] = node.position[static_cast<int>(axis)];
        normal[axis][i] = node.normal[static_cast<int>(axis)];
        radiosity[axis][i] = node.radiosity[static_cast<int>(axis)];
      }
      radius[i] = node.radius;
      area[i] = node.area;
      flatness[i] = node.flatness;
      variance[i] = varianceCode(node.radiosity_variance);
      flags[i] = node.flags;
      transparency.set(i, node.transparency);
      tints.set(i, node.tint);
      child_count[i] = node.child_count;
      child_level[i] = nodes[i].child_level;
      page[i] = node.page;
      first[i] = node.first;
      surfel_count[i] = node.surfel_count;
      groups[i] = node.groups;
    }
  }

  // Bounds by the positions and normals that a reader will find: radii grow by how far their node
  // moves, so that they still hold every disk. Nothing is known of what cannot be read.
  void bound(std::span<const LevelNode> nodes, float max_error, bool full_precision) {
    const StoredPlaces places(constAxes(position), constAxes(normal), max_error, full_precision);
    for (std::size_t i = 0; i < nodes.size(); ++i) {
      BoundCodes codes;
      if (places.are_readable) {
        const glm::vec3 at_place = at(places.position, i);
        const double moved = glm::distance(glm::dvec3(at(position, i)), glm::dvec3(at_place));
        if (moved > 0) radius[i] = float((double(radius[i]) + moved) * kRoundedUp);
        const bool has_normal = full_precision ? flatness[i] != 0 : signedCode(flatness[i], 1) != 0;
        codes = boundCodes(nodes[i], at_place, has_normal ? at(places.normal, i) : glm::vec3(0));
      }
      thickness[i] = codes.thickness;
      cone[i] = codes.cone;
    }
  }

  // All but the reference: page and first depend on the limits.
  void scatter(const PageForm& form, std::span<Node> nodes) const {
    for (std::size_t i = 0; i < nodes.size(); ++i) {
      Node& node = nodes[i];
      node.position = at(position, i);
      node.radius = radius[i];
      node.forgetBounds();
      // |sum A n| is zero in these: no direction
      node.normal = flatness[i] == 0 ? glm::vec3(0) : at(normal, i);
      setBounds(form.has_bounds ? BoundCodes{thickness[i], cone[i]} : BoundCodes(), node);
      node.area = area[i];
      node.radiosity = at(radiosity, i);
      node.flatness = flatness[i];
      node.child_count = child_count[i];
      node.radiosity_variance = form.has_variances ? varianceOf(variance[i]) : 0;
      node.flags = flags[i];
      node.facet_count = 0;
      node.hidden = 0;
      node.slopes = {};
      node.rough = {};
      node.surfel_count = surfel_count[i];
      node.groups = form.has_groups ? groups[i] : groupBit(0);
      node.transparency = form.has_opacity ? transparency.at(i) : std::uint16_t{0};
      node.tint = form.has_tints ? tints.at(i) : Tint{};
    }
  }

  MutableAxes position, normal, radiosity;
  std::span<float> radius, area, flatness;
  std::span<std::uint8_t> flags, child_count, child_level, thickness, cone, variance;
  TransparencyColumns transparency;
  TintColumns tints;
  std::span<std::uint64_t> page, first, surfel_count, groups;

 private:
  static constexpr std::size_t kFloatColumns = 12, kByteColumns = 12, kIntegerColumns = 4;

  static glm::vec3 at(const MutableAxes& axes, std::size_t i) {
    return {axes[0][i], axes[1][i], axes[2][i]};
  }
};

// The coefficients of the rough nodes of a page, kind by kind: projected area, then projected power
// in red, green and blue. Every page of a thread uses the same.
template <typename T>
std::array<std::span<T>, kCoefficientKinds> coefficientColumns(std::size_t rough_count) {
  std::vector<T>& values = threadScratch<std::vector<T>>([] {});
  const std::size_t count = rough_count * kShCount;
  if (values.size() < kCoefficientKinds * count) values.resize(kCoefficientKinds * count);
  std::array<std::span<T>, kCoefficientKinds> columns;
  for (std::size_t kind = 0; kind < kCoefficientKinds; ++kind) {
    columns[kind] = std::span(values).subspan(kind * count, count);
  }
  return columns;
}

// What coefficients of a kind are stored relative to.
float coefficientScale(const Node& node, std::size_t kind) {
  if (kind == kAreaKind) return node.area;
  const int color = static_cast<int>(kind) - 1;
  return node.area * node.opacity(color) * node.radiosity[color];
}

// The columns of a page but for the coefficients, checked one by one: those before the radiosity,
// and those after.
Status decodeGeometry(PayloadReader& reader, const PageForm& form, const Columns& columns) {
  if (!getPositions(reader, columns.position)) return damaged("position");
  if (!getPositive(reader, columns.radius)) return damaged("radius");
  if (!getPositive(reader, columns.area)) return damaged("area");
  if (!getNormals(reader, columns.normal)) return damaged("normal");
  if (!(form.full_precision ? getFloats(reader, columns.flatness)
                            : getSigned(reader, columns.flatness, 1))) {
    return damaged("flatness");
  }
  if (!form.has_bounds) return {};
  if (!getBytes8(reader, columns.thickness)) return damaged("thickness");
  if (!getBytes8(reader, columns.cone)) return damaged("cone");
  return {};
}

Status decodeLight(PayloadReader& reader, const PageForm& form, const Columns& columns) {
  if (!getRadiosity(reader, columns.radiosity)) return damaged("radiosity");
  if (form.has_variances && !getBytes8(reader, columns.variance)) return damaged("variance");
  return {};
}

Status decodeReferences(PayloadReader& reader, const PageForm& form, const Columns& columns) {
  if (!getBytes8(reader, columns.flags)) return damaged("flags");
  if (!getBytes8(reader, columns.child_count)) return damaged("child count");
  if (!getBytes8(reader, columns.child_level)) return damaged("child level");
  if (!getCounts(reader, columns.page)) return damaged("page");
  if (!getCounts(reader, columns.first)) return damaged("first");
  if (!getCounts(reader, columns.surfel_count)) return damaged("surfel count");
  if (form.has_groups) {
    if (!getCounts(reader, columns.groups)) return damaged("groups");
    for (const std::uint64_t groups : columns.groups) {
      if (groups == 0) return damaged("groups");
    }
  }
  if (form.has_opacity && !columns.transparency.get(reader)) return damaged("transparency");
  if (form.has_tints && !columns.tints.get(reader, columns.transparency)) return damaged("tint");
  return {};
}

// What columns cannot tell by themselves.
Status checkNodes(std::span<const Node> nodes) {
  for (const Node& node : nodes) {
    if (!(node.flatness >= 0 && node.flatness <= 1)) return damaged("flatness");
    const float largest = std::max({node.radiosity.x, node.radiosity.y, node.radiosity.z});
    // Twice: the largest code is a little more than the limit
    if (!std::isfinite(node.area * largest * (2 * kCoefficientLimit))) return damaged("radiosity");
  }
  return {};
}

// Needs flags and counts of facets.
Status checkFlags(std::span<const Node> nodes) {
  for (const Node& node : nodes) {
    const std::size_t pieces = node.isFlat() ? 1 : node.facet_count;
    const std::uint32_t two_sided = kNodeTwoSided * ((1u << pieces) - 1);
    if ((node.flags & ~(kNodeFlat | kNodeLoose | two_sided)) != 0) return damaged("flags");
  }
  return {};
}

std::size_t countRough(std::span<const Node> nodes) {
  const auto isRough = [](const Node& node) { return node.isRough(); };
  return static_cast<std::size_t>(std::count_if(nodes.begin(), nodes.end(), isRough));
}

Status decodeMoments(PayloadReader& reader, bool full_precision, std::span<Node> nodes) {
  MomentColumns moments(nodes.size(), countRough(nodes), full_precision);
  if (!moments.get(reader)) return damaged("moments");
  for (Node& node : nodes) {
    if (!moments.take(node)) return damaged("moments");
  }
  return {};
}

// Harmonics of rough nodes, and the radiosities of facets amid them.
Status decodeCoefficients(PayloadReader& reader, const PageForm& form, std::span<Node> nodes) {
  const bool full_precision = form.full_precision;
  const std::size_t rough = countRough(nodes);
  const auto floats = coefficientColumns<float>(rough);
  const auto codes = coefficientColumns<std::int16_t>(rough);
  for (std::size_t kind = 0; kind < kCoefficientKinds; ++kind) {
    if (kind == kAreaKind + 1 && !FacetColumns::getLight(reader, nodes, form)) {
      return damaged("facet radiosity");
    }
    if (!(full_precision ? getFloats(reader, floats[kind])
                         : getSmallIntegers(reader, codes[kind]))) {
      return damaged("coefficients");
    }
    std::size_t next = 0;
    for (Node& node : nodes) {
      if (!node.isRough()) continue;
      auto& sh = node.rough.sh;
      if (full_precision) {
        for (std::size_t i = 0; i < kShCount; ++i) sh[i][kind] = floats[kind][next + i];
      } else {
        const float scale = coefficientScale(node, kind) * (kCoefficientLimit / 32767);
        for (std::size_t i = 0; i < kShCount; ++i) {
          // Each kind is stored as what it differs from the one before
          std::int16_t& code = codes[kind][next + i];
          if (kind > 0) code = static_cast<std::int16_t>(code + codes[kind - 1][next + i]);
          sh[i][kind] = float(code) * scale;
        }
      }
      next += kShCount;
    }
  }
  return {};
}

// Appends the coefficients of a kind. Quantized ones are stored as differences from the kind
// before, whose codes `before` has; it gets those of this kind.
void encodeKind(std::span<const Node* const> rough, std::size_t kind, bool full_precision,
                std::span<std::int16_t> before, PayloadWriter& writer) {
  if (full_precision) {
    const std::span<float> values = coefficientColumns<float>(rough.size())[kind];
    for (std::size_t i = 0; i < values.size(); ++i) {
      values[i] = rough[i / kShCount]->rough.sh[i % kShCount][kind];
    }
    return putFloats(writer, values);
  }
  const std::span<std::int16_t> codes = coefficientColumns<std::int16_t>(rough.size())[kind];
  std::size_t next = 0;
  for (const Node* const node : rough) {
    const float scale = coefficientScale(*node, kind);
    const float inverse = scale >= std::numeric_limits<float>::min() ? 1 / scale : 0;
    for (std::size_t i = 0; i < kShCount; ++i, ++next) {
      const std::int16_t code = signedCode(node->rough.sh[i][kind] * inverse, kCoefficientLimit);
      codes[next] = static_cast<std::int16_t>(code - before[next]);
      before[next] = code;
    }
  }
  putSmallIntegers(writer, codes);
}

// The nodes of a page that have coefficients, and codes of one kind of these. Every page of a
// thread uses the same.
struct RoughNodes {
  std::vector<const Node*>& nodes = threadScratch<std::vector<const Node*>>([] {});
  std::vector<std::int16_t>& codes = threadScratch<std::vector<std::int16_t>>([] {});

  RoughNodes() {
    nodes.clear();
    codes.clear();
  }
  void add(const Node& node) {
    if (!node.isRough()) return;
    nodes.push_back(&node);
    codes.resize(codes.size() + kShCount);
  }
};

}  // namespace

std::size_t encodeNodeGroup(std::span<const LevelNode> nodes, const PageForm& form,
                            std::vector<std::byte>& payload) {
  const bool full_precision = form.full_precision;
  Columns columns(nodes.size());
  columns.gather(nodes);
  const Axes positions = constAxes(columns.position);
  const float max_error =
      *std::min_element(columns.radius.begin(), columns.radius.end()) * kPositionTolerance;
  columns.bound(nodes, max_error, full_precision);

  PayloadWriter writer(payload, static_cast<std::uint32_t>(nodes.size()));
  putPositions(writer, positions, max_error, full_precision);
  putPositive(writer, columns.radius, Rounding::kUp, full_precision);
  putPositive(writer, columns.area, Rounding::kNearest, full_precision);
  putNormals(writer, constAxes(columns.normal), full_precision);
  full_precision ? putFloats(writer, columns.flatness) : putSigned(writer, columns.flatness, 1);
  if (form.has_bounds) {
    putBytes8(writer, columns.thickness);
    putBytes8(writer, columns.cone);
  }
  putColors(writer, constAxes(columns.radiosity), full_precision);
  if (form.has_variances) putBytes8(writer, columns.variance);
  putBytes8(writer, columns.flags);
  putBytes8(writer, columns.child_count);
  putBytes8(writer, columns.child_level);
  putCounts(writer, columns.page);
  putCounts(writer, columns.first);
  putCounts(writer, columns.surfel_count);
  if (form.has_groups) putCounts(writer, columns.groups);
  if (form.has_opacity) columns.transparency.put(writer);
  if (form.has_tints) columns.tints.put(writer);
  FacetColumns facets;
  RoughNodes rough;
  for (const LevelNode& node : nodes) {
    facets.add(node.node);
    rough.add(node.node);
  }
  facets.put(writer, form);
  MomentColumns moments(nodes.size(), rough.nodes.size(), full_precision);
  for (const LevelNode& node : nodes) moments.add(node.node);
  moments.put(writer);
  for (std::size_t kind = 0; kind < kCoefficientKinds; ++kind) {
    if (kind == kAreaKind + 1) facets.putLight(writer, form);
    encodeKind(rough.nodes, kind, full_precision, rough.codes, writer);
  }
  if (form.has_lobes) {
    const auto nodeAt = [&](std::size_t i) -> const Node& { return nodes[i].node; };
    putNodeLobes(writer, nodes.size(), nodeAt, {});
  }
  return writer.finish();
}

Result<std::uint32_t> decodeNodeGroup(Bytes payload, const PageForm& form, std::uint32_t page,
                                      const NodeLimits& limits, std::span<Node> nodes,
                                      std::span<NodeLobes> lobes) {
  const bool full_precision = form.full_precision;
  PayloadReader reader(payload);
  if (!reader.ok()) return damaged("bytes of the packed part");
  const std::uint32_t count = reader.recordCount();
  if (count == 0 || count > nodes.size()) {
    return Status::corruption(
        fmt::format("node group: {} nodes, expected 1 to {}", count, nodes.size()));
  }
  const Columns columns(count);
  const std::span<Node> out = nodes.first(count);
  SURFEIT_RETURN_IF_ERROR(decodeGeometry(reader, form, columns));
  SURFEIT_RETURN_IF_ERROR(decodeLight(reader, form, columns));
  SURFEIT_RETURN_IF_ERROR(decodeReferences(reader, form, columns));
  columns.scatter(form, out);
  SURFEIT_RETURN_IF_ERROR(checkNodes(out));
  const int level = levelOfPage(limits.level_first_page, page);
  for (std::size_t i = 0; i < count; ++i) {
    SURFEIT_RETURN_IF_ERROR(resolveReference(limits, level, columns.child_level[i], columns.page[i],
                                             columns.first[i], out[i]));
  }
  if (!FacetColumns::get(reader, out, form)) return damaged("facets");
  SURFEIT_RETURN_IF_ERROR(checkFlags(out));
  SURFEIT_RETURN_IF_ERROR(decodeMoments(reader, full_precision, out));
  SURFEIT_RETURN_IF_ERROR(decodeCoefficients(reader, form, out));
  for (Node& node : out) node.findOffPlane();
  if (form.has_lobes && !getNodeLobes(reader, out, lobes)) return damaged("lobes");
  if (reader.remaining() != 0) {
    return Status::corruption(
        fmt::format("node group: {} bytes after the last field", reader.remaining()));
  }
  return count;
}

Result<std::size_t> replaceNodeRadiosity(Bytes payload, const PageForm& form,
                                         std::span<const Node> nodes,
                                         std::vector<std::byte>& replaced,
                                         std::span<const NodeLobes> lobes) {
  const bool full_precision = form.full_precision;
  PayloadReader reader(payload);
  if (!reader.ok() || reader.recordCount() != nodes.size()) return damaged("number of nodes");
  const Columns columns(nodes.size());
  PayloadWriter writer(replaced, reader.recordCount());

  const PayloadReader begin = reader;
  SURFEIT_RETURN_IF_ERROR(decodeGeometry(reader, form, columns));
  copyTaken(begin, reader, writer);
  SURFEIT_RETURN_IF_ERROR(decodeLight(reader, form, columns));
  for (std::size_t i = 0; i < nodes.size(); ++i) {
    for (std::size_t c = 0; c < 3; ++c) {
      columns.radiosity[c][i] = nodes[i].radiosity[static_cast<int>(c)];
    }
    columns.variance[i] = varianceCode(nodes[i].radiosity_variance);
  }
  putColors(writer, constAxes(columns.radiosity), full_precision);
  putBytes8(writer, columns.variance);
  const PayloadReader references = reader;
  SURFEIT_RETURN_IF_ERROR(decodeReferences(reader, form, columns));

  // Facets, moments and the projected area stay; power is stored relative to the codes of that
  FacetColumns facets;
  RoughNodes rough;
  for (const Node& node : nodes) {
    facets.add(node);
    rough.add(node);
  }
  if (!facets.pass(reader, form)) return damaged("facets");
  if (!MomentColumns(nodes.size(), rough.nodes.size(), full_precision).get(reader)) {
    return damaged("moments");
  }
  const bool has_area =
      full_precision ? getFloats(reader, coefficientColumns<float>(rough.nodes.size())[kAreaKind])
                     : getSmallIntegers(reader, rough.codes);
  if (!has_area) return damaged("coefficients");
  copyTaken(references, reader, writer);
  facets.putLight(writer, form.relit());
  for (std::size_t kind = kAreaKind + 1; kind < kCoefficientKinds; ++kind) {
    encodeKind(rough.nodes, kind, full_precision, rough.codes, writer);
  }
  if (!lobes.empty()) {
    const auto nodeAt = [&](std::size_t i) -> const Node& { return nodes[i]; };
    putNodeLobes(writer, nodes.size(), nodeAt, lobes);
  }
  return writer.finish();
}

}  // namespace surfeit
