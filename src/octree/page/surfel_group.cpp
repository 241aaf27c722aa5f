#include "octree/page/surfel_group.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <glm/common.hpp>

#include "core/long_side.h"
#include "core/thread_scratch.h"
#include "octree/page/column_codec.h"
#include "octree/page/lobe_columns.h"
#include "octree/page/surfel_marks.h"
#include "octree/page/transparency_columns.h"

namespace surfeit {
namespace {

// Flags that a page may hold; the last two only in the indexer's own temporary files.
constexpr std::uint8_t kStoredFlags = kSurfelSphere | kSurfelTwoSided | kSurfelHiddenFront |
                                      kSurfelHiddenBack | kSurfelLoose | kSurfelLone |
                                      kSurfelNeedsSize | kSurfelNeedsSide;

Status damaged(const char* field) {
  return Status::corruption(fmt::format("surfel group: damaged field {}", field));
}

// The surfels of a page as columns. Every page of a thread uses the same.
class Columns {
 public:
  explicit Columns(std::size_t count) {
    std::vector<float>& floats = threadScratch<std::vector<float>>([] {});
    std::vector<std::uint8_t>& bytes = threadScratch<std::vector<std::uint8_t>>([] {});
    if (bytes.size() < kByteColumns * count) {
      floats.resize(kFloatColumns * count);
      bytes.resize(kByteColumns * count);
    }
    std::span<float> rest(floats);
    const auto take = [&] {
      const std::span<float> column = rest.first(count);
      rest = rest.subspan(count);
      return column;
    };
    for (MutableAxes* axes : {&position, &normal, &radiosity, &albedo}) {
      *axes = {take(), take(), take()};
    }
    radius = take();
    area = take();
    flags = std::span(bytes).first(count);
    group = std::span(bytes).subspan(count, count);
    for (std::size_t k = 0; k < long_side.size(); ++k) {
      long_side[k] = std::span(bytes).subspan((2 + k) * count, count);
    }
    transparency.bytes = {std::span(bytes).subspan(5 * count, count),
                          std::span(bytes).subspan(6 * count, count)};
    for (std::size_t k = 0; k < 2; ++k) {
      tints.differences[k].bytes = {std::span(bytes).subspan((7 + 2 * k) * count, count),
                                    std::span(bytes).subspan((8 + 2 * k) * count, count)};
    }
  }

  void gather(std::span<const Surfel> surfels) {
    // A loop for each quarter of a surfel: more columns than registers are slower
    gatherVectors(surfels, &Surfel::position, position);
    gatherVectors(surfels, &Surfel::normal, normal);
    gatherVectors(surfels, &Surfel::radiosity, radiosity);
    gatherVectors(surfels, &Surfel::albedo, albedo);
    for (std::size_t i = 0; i < surfels.size(); ++i) {
      radius[i] = surfels[i].radius;
      area[i] = surfels[i].area;
      flags[i] = static_cast<std::uint8_t>(surfels[i].flags);
      group[i] = surfels[i].group;
      long_side[0][i] = static_cast<std::uint8_t>(surfels[i].long_side & 0xff);
      long_side[1][i] = static_cast<std::uint8_t>(surfels[i].long_side >> 8);
      long_side[2][i] = surfels[i].elongation;
      transparency.set(i, surfels[i].transparency);
      tints.set(i, surfels[i].tint);
    }
  }

  void scatter(const PageForm& form, std::span<Surfel> surfels) const {
    scatterVectors(position, &Surfel::position, surfels);
    scatterVectors(normal, &Surfel::normal, surfels);
    scatterVectors(radiosity, &Surfel::radiosity, surfels);
    if (form.has_albedo) scatterVectors(albedo, &Surfel::albedo, surfels);
    for (std::size_t i = 0; i < surfels.size(); ++i) {
      Surfel& surfel = surfels[i];
      surfel.radius = radius[i];
      surfel.area = area[i];
      surfel.flags = flags[i];
      surfel.group = form.has_groups ? group[i] : std::uint8_t{0};
      surfel.long_side = form.has_long_sides ? longSideAt(i) : kNoLongSide;
      surfel.elongation = form.has_long_sides ? long_side[2][i] : std::uint8_t{0};
      surfel.transparency = form.has_opacity ? transparency.at(i) : std::uint16_t{0};
      surfel.tint = form.has_tints ? tints.at(i) : Tint{};
      if (surfel.isSphere()) surfel.normal = glm::vec3(0);
      if (!form.has_albedo) surfel.albedo = glm::vec3(0);
    }
  }

  MutableAxes position, normal, radiosity, albedo;
  std::span<float> radius, area;
  std::span<std::uint8_t> flags, group;
  std::array<std::span<std::uint8_t>, 3> long_side;  // lower and upper byte, elongation
  TransparencyColumns transparency;
  TintColumns tints;
  std::uint16_t longSideAt(std::size_t i) const {
    return static_cast<std::uint16_t>(long_side[0][i] | long_side[1][i] << 8);
  }

 private:
  static constexpr std::size_t kFloatColumns = 14, kByteColumns = 11;

  static void gatherVectors(std::span<const Surfel> surfels, glm::vec3 Surfel::*field,
                            const MutableAxes& axes) {
    float *const x = axes[0].data(), *const y = axes[1].data(), *const z = axes[2].data();
    for (std::size_t i = 0; i < surfels.size(); ++i) {
      const glm::vec3& value = surfels[i].*field;
      x[i] = value.x;
      y[i] = value.y;
      z[i] = value.z;
    }
  }

  static void scatterVectors(const MutableAxes& axes, glm::vec3 Surfel::*field,
                             std::span<Surfel> surfels) {
    const float *const x = axes[0].data(), *const y = axes[1].data(), *const z = axes[2].data();
    for (std::size_t i = 0; i < surfels.size(); ++i) surfels[i].*field = {x[i], y[i], z[i]};
  }
};

// The columns before the radiosity.
Status decodeGeometry(PayloadReader& reader, const Columns& columns) {
  if (!getBytes8(reader, columns.flags)) return damaged("flags");
  for (const std::uint8_t flags : columns.flags) {
    if ((flags & ~kStoredFlags) != 0) return damaged("flags");
    const bool may_be_loose = (flags & (kSurfelSphere | kSurfelTwoSided)) != 0;
    if ((flags & kSurfelLoose) != 0 && !may_be_loose) return damaged("flags");
    if ((flags & kSurfelLone) != 0 && (flags & kSurfelLoose) == 0) return damaged("flags");
  }
  if (!getPositions(reader, columns.position)) return damaged("position");
  if (!getNormals(reader, columns.normal)) return damaged("normal");
  if (!getPositive(reader, columns.radius)) return damaged("radius");
  if (!getPositive(reader, columns.area)) return damaged("area");
  return {};
}

// The columns after it.
Status decodeOptional(PayloadReader& reader, const PageForm& form, const Columns& columns) {
  if (form.has_albedo && !getReflectances(reader, columns.albedo)) return damaged("albedo");
  if (form.has_groups) {
    if (!getBytes8(reader, columns.group)) return damaged("group");
    for (const std::uint8_t group : columns.group) {
      if (group >= kMaxGroups) return damaged("group");
    }
  }
  if (form.has_long_sides) {
    for (const auto& bytes : columns.long_side) {
      if (!getBytes8(reader, bytes)) return damaged("long_side");
    }
    for (std::size_t i = 0; i < columns.group.size(); ++i) {
      const std::uint16_t side = columns.longSideAt(i);
      const bool is_sphere = (columns.flags[i] & kSurfelSphere) != 0;
      const bool is_shared =
          !isDirection(side) && (side != kNoLongSide || columns.long_side[2][i] != 0);
      if (!isLongSide(side) || (is_sphere && is_shared)) return damaged("long_side");
    }
  }
  if (form.has_opacity && !columns.transparency.get(reader)) return damaged("transparency");
  if (form.has_tints && !columns.tints.get(reader, columns.transparency)) return damaged("tint");
  return {};
}

}  // namespace

std::size_t encodeSurfelGroup(std::span<const Surfel> surfels, const PageForm& form,
                              std::vector<std::byte>& payload) {
  Columns columns(surfels.size());
  columns.gather(surfels);
  const float min_radius = *std::min_element(columns.radius.begin(), columns.radius.end());
  const bool full = form.full_precision;

  PayloadWriter writer(payload, static_cast<std::uint32_t>(surfels.size()));
  putBytes8(writer, columns.flags);
  putPositions(writer, constAxes(columns.position), min_radius * kPositionTolerance, full);
  putNormals(writer, constAxes(columns.normal), full);
  putPositive(writer, columns.radius, Rounding::kNearest, full);
  putPositive(writer, columns.area, Rounding::kNearest, full);
  putColors(writer, constAxes(columns.radiosity), full);
  if (form.has_albedo) putReflectances(writer, constAxes(columns.albedo), full);
  if (form.has_groups) putBytes8(writer, columns.group);
  if (form.has_long_sides) {
    for (const auto& bytes : columns.long_side) putBytes8(writer, bytes);
  }
  if (form.has_opacity) columns.transparency.put(writer);
  if (form.has_tints) columns.tints.put(writer);
  if (form.has_lobes) putSurfelLobes(writer, surfels.size(), {});
  return writer.finish();
}

Result<std::uint32_t> decodeSurfelGroup(Bytes payload, const PageForm& form,
                                        std::span<Surfel> surfels, std::span<Lobe> lobes) {
  PayloadReader reader(payload);
  if (!reader.ok()) return damaged("bytes of the packed part");
  const std::uint32_t count = reader.recordCount();
  if (count == 0 || count > surfels.size()) {
    return Status::corruption(
        fmt::format("surfel group: {} surfels, expected 1 to {}", count, surfels.size()));
  }
  const Columns columns(count);
  SURFEIT_RETURN_IF_ERROR(decodeGeometry(reader, columns));
  if (!getRadiosity(reader, columns.radiosity)) return damaged("radiosity");
  SURFEIT_RETURN_IF_ERROR(decodeOptional(reader, form, columns));
  if (form.has_lobes && !getSurfelLobes(reader, count, lobes)) return damaged("lobes");
  if (reader.remaining() != 0) {
    return Status::corruption(
        fmt::format("surfel group: {} bytes after the last field", reader.remaining()));
  }
  columns.scatter(form, surfels.first(count));
  return count;
}

Result<std::size_t> replaceSurfelRadiosity(Bytes payload, const PageForm& form,
                                           std::span<const glm::vec3> radiosity,
                                           std::vector<std::byte>& replaced,
                                           std::span<const Lobe> lobes) {
  PayloadReader reader(payload);
  if (!reader.ok() || reader.recordCount() != radiosity.size()) return damaged("number of surfels");
  const Columns columns(radiosity.size());
  PayloadWriter writer(replaced, reader.recordCount());

  const PayloadReader begin = reader;
  SURFEIT_RETURN_IF_ERROR(decodeGeometry(reader, columns));
  copyTaken(begin, reader, writer);
  if (!getRadiosity(reader, columns.radiosity)) return damaged("radiosity");
  for (std::size_t i = 0; i < radiosity.size(); ++i) {
    for (std::size_t c = 0; c < 3; ++c) columns.radiosity[c][i] = radiosity[i][static_cast<int>(c)];
  }
  putColors(writer, constAxes(columns.radiosity), form.full_precision);
  const PayloadReader optional = reader;
  SURFEIT_RETURN_IF_ERROR(decodeOptional(reader, form, columns));
  copyTaken(optional, reader, writer);
  if (form.has_lobes && !getSurfelLobes(reader, radiosity.size(), {})) return damaged("lobes");
  if (reader.remaining() != 0) return damaged("end");
  if (!lobes.empty()) putSurfelLobes(writer, radiosity.size(), lobes);
  return writer.finish();
}

}  // namespace surfeit
