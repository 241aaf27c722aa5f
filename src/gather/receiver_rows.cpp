#include "gather/receiver_rows.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cstring>
#include <span>
#include <string_view>

#include "surfeit/surfel.h"

namespace surfeit {
namespace {

constexpr std::array<std::string_view, 6> kGeometryNames = {"x", "y", "z", "nx", "ny", "nz"};
// Numbered as ResultRows::make has the values
constexpr std::array<std::string_view, 4> kResultNames = {"occlusion", "irradiance_r",
                                                          "irradiance_g", "irradiance_b"};

// The results of a mode: the first, or all.
std::span<const std::string_view> resultNames(GatherMode mode) {
  return std::span(kResultNames).first(mode == GatherMode::kBleeding ? kResultNames.size() : 1);
}

}  // namespace

Result<ReceiverMapping> ReceiverMapping::create(const PlyElement& element,
                                                const std::string& path) {
  PlyElement geometry = element;
  std::erase_if(geometry.properties, [](const PlyProperty& property) {
    return std::find(kGeometryNames.begin(), kGeometryNames.end(), property.name) ==
           kGeometryNames.end();
  });
  SURFEIT_ASSIGN_OR_RETURN(SurfelMapping surfels, SurfelMapping::create(geometry, path));
  return ReceiverMapping(std::move(surfels));
}

bool ReceiverMapping::decode(const std::byte* row, std::uint64_t record, Receiver& receiver,
                             SurfelDefects& defects) const {
  Surfel surfel;
  if (!surfels_.decode(row, record, surfel, defects)) return false;
  receiver = {surfel.position, surfel.normal};
  return true;
}

ResultRows::ResultRows(const PlyElement& input, GatherMode mode) {
  const std::span<const std::string_view> results = resultNames(mode);
  std::array<bool, kResultNames.size()> is_placed = {};

  // The properties of the input, results in the place of their namesakes
  for (PlyProperty property : input.properties) {
    if (property.is_list) continue;
    const auto result = std::find(results.begin(), results.end(), property.name);
    if (result == results.end()) {
      addCopy({property.offset, row_bytes_, plyTypeBytes(property.type)});
    } else {
      const std::size_t number = static_cast<std::size_t>(result - results.begin());
      is_placed[number] = true;
      inserts_.push_back({number, row_bytes_});
      property.type = PlyType::kFloat32;
    }
    addProperty(property);
  }

  // The other results
  for (std::size_t number = 0; number < results.size(); ++number) {
    if (is_placed[number]) continue;
    PlyProperty property;
    property.name = results[number];
    inserts_.push_back({number, row_bytes_});
    addProperty(property);
  }
}

void ResultRows::make(const std::byte* input, const GatherResult& result, std::byte* output) const {
  for (const Copy& copy : copies_) std::memcpy(output + copy.to, input + copy.from, copy.bytes);
  const std::array<float, kResultNames.size()> values = {result.occlusion, result.irradiance.r,
                                                         result.irradiance.g, result.irradiance.b};
  for (const Insert& insert : inserts_) {
    std::memcpy(output + insert.to, &values[insert.result], sizeof(float));
  }
}

// Appends a property to the output row.
void ResultRows::addProperty(const PlyProperty& property) {
  properties_.push_back(property);
  properties_.back().offset = row_bytes_;
  row_bytes_ += plyTypeBytes(property.type);
}

// Values that are neighbours in input and output are copied at once.
void ResultRows::addCopy(const Copy& copy) {
  if (!copies_.empty()) {
    Copy& last = copies_.back();
    if (last.from + last.bytes == copy.from && last.to + last.bytes == copy.to) {
      last.bytes += copy.bytes;
      return;
    }
  }
  copies_.push_back(copy);
}

}  // namespace surfeit
