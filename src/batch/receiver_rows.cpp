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
    : outputs_(outputs), rows_(input, resultNames(outputs, mode)) {}

void ResultRows::make(const std::byte* input, const GatherResult& result, std::byte* output) const {
  std::array<float, kResultFloats> values;
  packResult(result, outputs_, values.data());
  rows_.make(input, values.data(), output);
}

}  // namespace surfeit
