#include "view/radius_estimate.h"

#include <algorithm>
#include <cmath>

namespace surfeit {
namespace {

// Finest cells: as many records per cell of the surface as make its occupied cells countable.
constexpr double kRecordsPerCell = 8;
// Fewest records per occupied cell that a level is trusted with; else the next coarser answers.
constexpr double kTrustedRecordsPerCell = 4;
constexpr int kLevels = 4;
constexpr double kMaxCells = 4e6;

// Cells that a surface cuts, per h^2 of its area: 1 to 1.73 by its direction, 1.5 on average (see
// the header). Rather too few, for disks that are rather too large.
constexpr double kCellsPerArea = 1.25;
// Radius over spacing. Of a surface with random records exp(-pi 1.4^2) = 0.2 % stays uncovered.
constexpr double kRadiusOverSpacing = 1.4;
// Strays far from everything would get disks that hide the scene.
constexpr float kMaxRadiusInMeans = 3;

}  // namespace

RadiusEstimate::RadiusEstimate(const Bounds3d& bounds, std::uint64_t count)
    : origin_(bounds.min), levels_(kLevels) {
  // The surface of the box stands in for the unknown area of the cloud
  const glm::dvec3 extent = glm::max(bounds.extent(), glm::dvec3(1e-30));
  const double area =
      2 * (extent.x * extent.y + extent.y * extent.z + extent.z * extent.x) / kCellsPerArea;
  double cell_size = std::sqrt(kRecordsPerCell * area / double(std::max<std::uint64_t>(count, 1)));
  const double longest = std::max({extent.x, extent.y, extent.z});
  cell_size = std::clamp(cell_size, longest / 2048, longest);
  const auto cellCount = [&](double size) {
    return std::ceil(extent.x / size + 1) * std::ceil(extent.y / size + 1) *
           std::ceil(extent.z / size + 1);
  };
  while (cellCount(cell_size) > kMaxCells) cell_size *= 1.1;

  for (Level& level : levels_) {
    level.cell_size = cell_size;
    for (int axis = 0; axis < 3; ++axis) {
      level.cells[std::size_t(axis)] = std::size_t(extent[axis] / cell_size) + 1;
    }
    level.count.assign(level.cells[0] * level.cells[1] * level.cells[2], 0);
    cell_size *= 2;
  }
}

std::array<std::size_t, 3> RadiusEstimate::Level::cellOf(const glm::dvec3& offset) const {
  std::array<std::size_t, 3> cell;
  for (int axis = 0; axis < 3; ++axis) {
    const double last = double(cells[std::size_t(axis)] - 1);
    cell[std::size_t(axis)] = std::size_t(std::clamp(offset[axis] / cell_size, 0.0, last));
  }
  return cell;
}

void RadiusEstimate::add(const glm::dvec3& position) {
  Level& finest = levels_.front();
  const auto [x, y, z] = finest.cellOf(position - origin_);
  ++finest.count[finest.index(x, y, z)];
}

void RadiusEstimate::finish() {
  // Coarser levels add up eight cells of the finer one
  for (std::size_t l = 1; l < levels_.size(); ++l) {
    const Level& fine = levels_[l - 1];
    Level& coarse = levels_[l];
    for (std::size_t z = 0; z < fine.cells[2]; ++z) {
      for (std::size_t y = 0; y < fine.cells[1]; ++y) {
        for (std::size_t x = 0; x < fine.cells[0]; ++x) {
          const std::size_t parent = coarse.index(std::min(x / 2, coarse.cells[0] - 1),
                                                  std::min(y / 2, coarse.cells[1] - 1),
                                                  std::min(z / 2, coarse.cells[2] - 1));
          coarse.count[parent] += fine.count[fine.index(x, y, z)];
        }
      }
    }
  }

  // Spacing from the 27 cells around each occupied one
  for (std::size_t l = 0; l < levels_.size(); ++l) {
    Level& level = levels_[l];
    const bool is_last = l + 1 == levels_.size();
    level.radius.assign(level.count.size(), 0);
    for (std::size_t z = 0; z < level.cells[2]; ++z) {
      for (std::size_t y = 0; y < level.cells[1]; ++y) {
        for (std::size_t x = 0; x < level.cells[0]; ++x) {
          if (level.count[level.index(x, y, z)] == 0) continue;
          double records = 0, occupied = 0;
          for (std::size_t k = z > 0 ? z - 1 : 0; k < std::min(z + 2, level.cells[2]); ++k) {
            for (std::size_t j = y > 0 ? y - 1 : 0; j < std::min(y + 2, level.cells[1]); ++j) {
              for (std::size_t i = x > 0 ? x - 1 : 0; i < std::min(x + 2, level.cells[0]); ++i) {
                const std::uint32_t count = level.count[level.index(i, j, k)];
                records += double(count);
                occupied += count > 0 ? 1 : 0;
              }
            }
          }
          if (records < kTrustedRecordsPerCell * occupied && !is_last) continue;
          const double area = occupied * level.cell_size * level.cell_size / kCellsPerArea;
          level.radius[level.index(x, y, z)] =
              float(kRadiusOverSpacing * std::sqrt(area / records));
        }
      }
    }
  }

  // The mean, weighted by the records of the finest cells; no limit on radii yet
  double sum = 0, records = 0;
  const Level& finest = levels_.front();
  for (std::size_t z = 0; z < finest.cells[2]; ++z) {
    for (std::size_t y = 0; y < finest.cells[1]; ++y) {
      for (std::size_t x = 0; x < finest.cells[0]; ++x) {
        const std::uint32_t count = finest.count[finest.index(x, y, z)];
        if (count == 0) continue;
        const glm::dvec3 centre = (glm::dvec3(x, y, z) + 0.5) * finest.cell_size + origin_;
        sum += double(count) * double(radiusAt(centre));
        records += double(count);
      }
    }
  }
  mean_radius_ = records > 0 ? float(sum / records) : 0;
  max_radius_ = kMaxRadiusInMeans * mean_radius_;
}

float RadiusEstimate::radiusAt(const glm::dvec3& position) const {
  // The finest level that knows enough; the last one always answers
  for (const Level& level : levels_) {
    const auto [x, y, z] = level.cellOf(position - origin_);
    const float radius = level.radius[level.index(x, y, z)];
    if (radius > 0) return std::min(radius, max_radius_);
  }
  return std::min(float(levels_.front().cell_size), max_radius_);
}

}  // namespace surfeit
