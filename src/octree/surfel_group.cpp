#include "octree/surfel_group.h"

#include <fmt/format.h>

#include <algorithm>

#include "octree/column_codec.h"
#include "octree/local_density.h"

namespace surfeit {
namespace {

// Position error allowed, as a part of the smallest radius in the group (docs/format.md).
constexpr float kPositionTolerance = 1e-3f;

// Flags that a page may hold; the last only in the indexer's own temporary files.
constexpr std::uint8_t kStoredFlags = kSurfelSphere | kSurfelTwoSided | kSurfelNeedsSize;

// A column as its own array.
template <typename T, typename Field>
std::vector<T> column(std::span<const Surfel> surfels, Field field) {
  std::vector<T> values(surfels.size());
  std::transform(surfels.begin(), surfels.end(), values.begin(), field);
  return values;
}

Status damaged(const char* field) {
  return Status::corruption(fmt::format("surfel group: damaged field {}", field));
}

// Scratch of decodeSurfelGroup, per thread.
struct DecodeScratch {
  std::vector<glm::vec3> vectors;
  std::vector<float> numbers;
  std::vector<std::uint8_t> bytes;
};

}  // namespace

void encodeSurfelGroup(std::span<const Surfel> surfels, const PageForm& form,
                       std::vector<std::byte>& payload) {
  payload.clear();
  ByteWriter writer(payload);
  writer.put(static_cast<std::uint32_t>(surfels.size()));

  float min_radius = surfels.front().radius;
  for (const Surfel& surfel : surfels) min_radius = std::min(min_radius, surfel.radius);
  const bool full = form.full_precision;
  putBytes8(writer, column<std::uint8_t>(surfels, [](const Surfel& s) {
              return static_cast<std::uint8_t>(s.flags);
            }));
  putPositions(writer, column<glm::vec3>(surfels, [](const Surfel& s) { return s.position; }),
               min_radius * kPositionTolerance, full);
  putNormals(writer, column<glm::vec3>(surfels, [](const Surfel& s) { return s.normal; }), full);
  putPositive(writer, column<float>(surfels, [](const Surfel& s) { return s.radius; }),
              Rounding::kNearest, full);
  putPositive(writer, column<float>(surfels, [](const Surfel& s) { return s.area; }),
              Rounding::kNearest, full);
  putColors(writer, column<glm::vec3>(surfels, [](const Surfel& s) { return s.radiosity; }), full);
  if (form.has_albedo) {
    putReflectances(writer, column<glm::vec3>(surfels, [](const Surfel& s) { return s.albedo; }),
                    full);
  }
}

Result<std::uint32_t> decodeSurfelGroup(Bytes payload, const PageForm& form,
                                        std::span<Surfel> surfels) {
  ByteReader reader(payload);
  const std::uint32_t count = reader.get<std::uint32_t>();
  if (!reader.ok() || count == 0 || count > surfels.size()) {
    return Status::corruption(
        fmt::format("surfel group: {} surfels, expected 1 to {}", count, surfels.size()));
  }
  thread_local DecodeScratch scratch;
  if (scratch.vectors.size() < count) {
    scratch.vectors.resize(surfels.size());
    scratch.numbers.resize(surfels.size());
    scratch.bytes.resize(surfels.size());
  }
  const std::span<glm::vec3> vectors = std::span(scratch.vectors).first(count);
  const std::span<float> numbers = std::span(scratch.numbers).first(count);
  const std::span<std::uint8_t> flags = std::span(scratch.bytes).first(count);
  const std::span<Surfel> out = surfels.first(count);

  if (!getBytes8(reader, flags)) return damaged("flags");
  for (std::size_t i = 0; i < count; ++i) {
    if ((flags[i] & ~kStoredFlags) != 0) return damaged("flags");
    out[i] = Surfel();
    out[i].flags = flags[i];
  }
  if (!getPositions(reader, vectors)) return damaged("position");
  for (std::size_t i = 0; i < count; ++i) out[i].position = vectors[i];
  if (!getNormals(reader, vectors)) return damaged("normal");
  for (std::size_t i = 0; i < count; ++i) {
    out[i].normal = out[i].isSphere() ? glm::vec3(0) : vectors[i];
  }
  if (!getPositive(reader, numbers)) return damaged("radius");
  for (std::size_t i = 0; i < count; ++i) out[i].radius = numbers[i];
  if (!getPositive(reader, numbers)) return damaged("area");
  for (std::size_t i = 0; i < count; ++i) out[i].area = numbers[i];
  if (!getColors(reader, vectors)) return damaged("radiosity");
  for (std::size_t i = 0; i < count; ++i) out[i].radiosity = vectors[i];
  if (form.has_albedo) {
    if (!getReflectances(reader, vectors)) return damaged("albedo");
    for (std::size_t i = 0; i < count; ++i) out[i].albedo = vectors[i];
  }
  if (reader.remaining() != 0) {
    return Status::corruption(
        fmt::format("surfel group: {} bytes after the last field", reader.remaining()));
  }
  return count;
}

}  // namespace surfeit
