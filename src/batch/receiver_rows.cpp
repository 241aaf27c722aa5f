#include "batch/receiver_rows.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <glm/geometric.hpp>
#include <span>
#include <string_view>

#include "gather/rules/gather_outputs.h"
#include "surfeit/surfel.h"

namespace surfeit {
namespace {

constexpr std::array<std::string_view, 6> kGeometryNames = {"x", "y", "z", "nx", "ny", "nz"};

constexpr std::array<std::string_view, 3> kViewNames = {"view_x", "view_y", "view_z"};

std::optional<std::array<RowProperty, 3>> findViews(const RowLayout& element) {
  std::array<RowProperty, 3> views;
  for (std::size_t axis = 0; axis < views.size(); ++axis) {
    const auto found = std::find_if(element.properties.begin(), element.properties.end(),
                                    [&](const RowProperty& property) {
                                      return property.name == kViewNames[axis] && !property.is_list;
                                    });
    if (found == element.properties.end()) return std::nullopt;
    views[axis] = *found;
  }
  return views;
}

}  // namespace

Result<ReceiverMapping> ReceiverMapping::create(const RowLayout& element, const std::string& path) {
  RowLayout geometry = element;
  std::erase_if(geometry.properties, [](const RowProperty& property) {
    return std::find(kGeometryNames.begin(), kGeometryNames.end(), property.name) ==
           kGeometryNames.end();
  });
  SURFEIT_ASSIGN_OR_RETURN(SurfelMapping surfels, SurfelMapping::create(geometry, path));
  return ReceiverMapping(std::move(surfels), findViews(element));
}

// Unit; zero when there is none.
glm::vec3 ReceiverMapping::viewOf(const std::byte* row) const {
  glm::vec3 view;
  for (int axis = 0; axis < 3; ++axis) {
    const RowProperty& property = (*views_)[std::size_t(axis)];
    view[axis] = float(rowValue(row + property.offset, property.type));
  }
  const float length = glm::length(view);
  return std::isfinite(length) && length > 0 ? view / length : glm::vec3(0);
}

bool ReceiverMapping::decode(const std::byte* row, std::uint64_t record, LocalReceiver& receiver,
                             SurfelDefects& defects) const {
  Surfel surfel;
  if (!surfels_.decode(row, record, surfel, defects)) return false;
  receiver = {surfel.position, surfel.normal};
  if (views_.has_value()) receiver.view = viewOf(row);
  return true;
}

ResultRows::ResultRows(const RowLayout& input, std::uint32_t outputs, GatherMode mode)
    : outputs_(outputs) {
  const std::vector<std::string> results = resultNames(outputs, mode);
  std::vector<bool> is_placed(results.size(), false);

  // The properties of the input, results in the place of their namesakes
  for (RowProperty property : input.properties) {
    if (property.is_list) continue;
    const auto result = std::find(results.begin(), results.end(), property.name);
    if (result == results.end()) {
      addCopy({property.offset, row_bytes_, valueTypeBytes(property.type)});
    } else {
      const std::size_t number = static_cast<std::size_t>(result - results.begin());
      is_placed[number] = true;
      inserts_.push_back({number, row_bytes_});
      property.type = ValueType::kFloat32;
    }
    addProperty(property);
  }

  // The other results
  for (std::size_t number = 0; number < results.size(); ++number) {
    if (is_placed[number]) continue;
    RowProperty property;
    property.name = results[number];
    inserts_.push_back({number, row_bytes_});
    addProperty(property);
  }
}

void ResultRows::make(const std::byte* input, const GatherResult& result, std::byte* output) const {
  for (const Copy& copy : copies_) std::memcpy(output + copy.to, input + copy.from, copy.bytes);
  std::array<float, kResultFloats> values;
  packResult(result, outputs_, values.data());
  for (const Insert& insert : inserts_) {
    std::memcpy(output + insert.to, &values[insert.place], sizeof(float));
  }
}

// Appends a property to the output row.
void ResultRows::addProperty(const RowProperty& property) {
  properties_.push_back(property);
  properties_.back().offset = row_bytes_;
  row_bytes_ += valueTypeBytes(property.type);
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
