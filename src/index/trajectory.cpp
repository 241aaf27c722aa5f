#include "index/trajectory.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <memory>

#include "cloud/cloud_formats.h"
#include "cloud/rows/surfel_names.h"

namespace surfeit {

Result<Trajectory> Trajectory::read(const std::string& path, Progress& progress) {
  SURFEIT_ASSIGN_OR_RETURN(const std::unique_ptr<RowReader> reader, openRowReader(path));
  const RowLayout& element = reader->element();
  const RowProperty* time = nullptr;
  for (const char* name : {"gps_time", "time", "t"}) {
    if (time == nullptr) time = element.find(name);
  }
  std::array<const RowProperty*, 3> axes{};
  for (std::size_t i = 0; i < 3; ++i) axes[i] = element.find(kPositionNames[i]);
  if (time == nullptr || std::find(axes.begin(), axes.end(), nullptr) != axes.end()) {
    return Status::corruption(fmt::format(
        "{}: not a trajectory: expected x, y, z and one of gps_time, time and t", path));
  }

  const std::uint64_t stride = element.count / kMostPlaces + 1;
  if (stride > 1) {
    progress.note(
        fmt::format("{}: {} places, of which every {}th is taken", path, element.count, stride));
  }
  Trajectory trajectory;
  AlignedBuffer buffer;
  for (std::uint64_t row = 0;;) {
    SURFEIT_ASSIGN_OR_RETURN(const Bytes rows, reader->readRows(4096, buffer));
    if (rows.empty()) break;
    for (std::size_t at = 0; at < rows.size(); at += element.row_bytes, ++row) {
      if (row % stride != 0) continue;
      const auto value = [&](const RowProperty& property) {
        return rowValue(rows.data() + at + property.offset, property.type);
      };
      const Place place{value(*time), {value(*axes[0]), value(*axes[1]), value(*axes[2])}};
      const double sum = place.time + place.position.x + place.position.y + place.position.z;
      if (std::isfinite(sum)) trajectory.places_.push_back(place);
    }
  }
  if (trajectory.places_.empty()) {
    return Status::corruption(fmt::format("{}: a trajectory without a finite place", path));
  }
  std::stable_sort(trajectory.places_.begin(), trajectory.places_.end(),
                   [](const Place& a, const Place& b) { return a.time < b.time; });
  return trajectory;
}

bool Trajectory::covers(double time) const {
  return time >= places_.front().time && time <= places_.back().time;
}

glm::dvec3 Trajectory::at(double time) const {
  const auto after = std::lower_bound(places_.begin(), places_.end(), time,
                                      [](const Place& place, double t) { return place.time < t; });
  if (after == places_.begin()) return places_.front().position;
  if (after == places_.end()) return places_.back().position;
  const Place &a = after[-1], &b = *after;
  const double part = b.time > a.time ? (time - a.time) / (b.time - a.time) : 0;
  return a.position + part * (b.position - a.position);
}

}  // namespace surfeit
