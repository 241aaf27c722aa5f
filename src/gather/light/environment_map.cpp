#include "gather/light/environment_map.h"

#include <fmt/format.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <utility>

#include "core/assert.h"
#include "core/spherical_harmonics.h"
#include "gather/light/environment_grid.h"

namespace surfeit {
namespace {

// Bilinear weights reach over 2.25 cells: the square of their sum is that many times the sum of
// their squares, cell by cell 1.5 in each direction.
constexpr float kLookupCells = 2.25f;
constexpr int kMinLevels = 6, kMaxLevels = 11;  // 32 to 1024 cells along an edge

Status checkOptions(const EnvironmentPlacement& environment) {
  if (!(environment.intensity >= 0) || !std::isfinite(environment.intensity)) {
    return Status::invalidArgument(
        fmt::format("intensity of the environment: {}, expected 0 or more", environment.intensity));
  }
  if (!std::isfinite(environment.rotation)) {
    return Status::invalidArgument(fmt::format(
        "rotation of the environment: {}, expected a number of radians", environment.rotation));
  }
  return {};
}

// Where a level begins; all levels from the largest to that of one cell are `count`.
std::size_t levelOffset(int level, int count) {
  return ((std::size_t{1} << 2 * count) - (std::size_t{1} << 2 * (count - level))) / 3;
}

}  // namespace

EnvironmentMap::EnvironmentMap(EnvironmentMap&&) noexcept = default;
EnvironmentMap& EnvironmentMap::operator=(EnvironmentMap&&) noexcept = default;
EnvironmentMap::~EnvironmentMap() = default;

Result<EnvironmentMap> EnvironmentMap::create(EnvironmentPicture picture,
                                              const EnvironmentPlacement& environment,
                                              const std::string& path) {
  SURFEIT_RETURN_IF_ERROR(checkOptions(environment));
  const double unit = double(kPi) * double(environment.intensity);
  EnvironmentMap map;
  map.grid_ = std::move(picture.grid);
  map.texels_ = std::move(picture.texels);
  for (glm::vec3& texel : map.texels_) texel = glm::vec3(unit * glm::dvec3(texel));
  map.power_ = unit * picture.power;
  map.rotation_ = std::remainder(double(environment.rotation), kTurn);
  // Up is the last of three in cyclic order
  map.first_axis_ = (static_cast<int>(environment.up.value_or(kDefaultUpAxis)) + 1) % 3;

  // Sums of light must stay finite, over many pixels and with what is added later
  constexpr float kBrightest = 1e30f;
  for (const glm::vec3& texel : map.texels_) {
    const float brightest = std::max({texel.x, texel.y, texel.z});
    if (brightest <= kBrightest) continue;
    return Status::invalidArgument(
        fmt::format("{}: a radiosity of {} with intensity {}, expected at most {}", path, brightest,
                    environment.intensity, kBrightest));
  }
  map.buildLevels(picture.columns);
  return map;
}

// Cells are about as large as texels at the horizon: columns^2 / pi of them fill the sphere.
void EnvironmentMap::buildLevels(int columns) {
  const unsigned texels = unsigned(columns) * unsigned(columns) / 3;
  level_count_ = std::clamp(int(std::bit_width(texels)) / 2 + 1, kMinLevels, kMaxLevels);
  levels_.resize(levelOffset(level_count_, level_count_));

  const SquareGrid square(1 << (level_count_ - 1));
  const std::size_t cells = square.cellCount();
  average(square, {}, std::span(levels_).first(cells));
  for (int level = 1; level < level_count_; ++level) {
    const std::size_t edge = std::size_t{1} << (level_count_ - 1 - level);
    const glm::vec3* const finer = &levels_[levelOffset(level - 1, level_count_)];
    glm::vec3* const means = &levels_[levelOffset(level, level_count_)];
    for (std::size_t y = 0; y < edge; ++y) {
      for (std::size_t x = 0; x < edge; ++x) {
        const glm::vec3* const four = finer + 4 * y * edge + 2 * x;
        means[y * edge + x] = 0.25f * (four[0] + four[1] + four[2 * edge] + four[2 * edge + 1]);
      }
    }
  }
}

// The overlay gives light and area of every cell. Their quotient keeps constants; what areas err in
// it (environment_grid.h) is made good for all cells together, so that power is kept too.
void EnvironmentMap::average(const SphereGrid& grid, std::span<const float> solid_angles,
                             std::span<glm::vec3> means) const {
  const std::vector<glm::dvec4> sums = overlay(*grid_, texels_, rotation_, grid);
  const auto solidAngle = [&](std::size_t i) {
    return solid_angles.empty() ? 2 * kTurn / double(sums.size()) : double(solid_angles[i]);
  };
  glm::dvec3 power(0);
  for (std::size_t i = 0; i < sums.size(); ++i) {
    power += solidAngle(i) / sums[i].w * glm::dvec3(sums[i]);
  }
  glm::dvec3 correction;
  for (int i = 0; i < 3; ++i) correction[i] = power[i] > 0 ? power_[i] / power[i] : 1;
  for (std::size_t i = 0; i < sums.size(); ++i) {
    means[i] = glm::vec3(correction / sums[i].w * glm::dvec3(sums[i]));
  }
}

glm::vec3 EnvironmentMap::lookup(const glm::vec3& direction, float solid_angle) const {
  SURFEIT_ASSERT(solid_angle >= 0);
  const auto component = [&](int i) { return direction[(first_axis_ + i) % 3]; };
  const SquareGrid::Point point = SquareGrid::project({component(0), component(1), component(2)});

  // Between the two levels whose cells are just smaller and just larger
  const float finest = float(2 * kTurn) * kLookupCells / float(1 << 2 * (level_count_ - 1));
  const float level = std::clamp(0.5f * std::log2(std::max(solid_angle, 1e-20f) / finest), 0.0f,
                                 float(level_count_ - 1));
  const int finer = std::min(int(level), level_count_ - 2);
  const float weight = level - float(finer);
  const glm::vec3 fine = lookupLevel(finer, point.x, point.y);
  return weight == 0 ? fine
                     : (1 - weight) * fine + weight * lookupLevel(finer + 1, point.x, point.y);
}

// Bilinear between the middles of cells; over an edge of the square the neighbour of a cell is its
// mirror image on the same edge.
glm::vec3 EnvironmentMap::lookupLevel(int level, float x, float y) const {
  const glm::vec3* const cells = &levels_[levelOffset(level, level_count_)];
  const int edge = 1 << (level_count_ - 1 - level);
  // Counted from one cell before the first, so that what is cut off is below the place
  const float place_x = 0.5f * (x + 1) * float(edge) + 0.5f;
  const float place_y = 0.5f * (y + 1) * float(edge) + 0.5f;
  const int left = int(place_x) - 1, below = int(place_y) - 1;
  const float weight_x = place_x - float(left + 1), weight_y = place_y - float(below + 1);
  const auto blend = [&](const glm::vec3& a, const glm::vec3& b, const glm::vec3& c,
                         const glm::vec3& d) {
    return (1 - weight_y) * ((1 - weight_x) * a + weight_x * b) +
           weight_y * ((1 - weight_x) * c + weight_x * d);
  };
  if (left >= 0 && below >= 0 && left + 1 < edge && below + 1 < edge) {
    const glm::vec3* const first = cells + std::ptrdiff_t(below) * edge + left;
    return blend(first[0], first[1], first[edge], first[edge + 1]);
  }

  const auto cell = [&](int column, int row) {
    if (column < 0 || column >= edge) {
      column = column < 0 ? 0 : edge - 1;
      row = edge - 1 - row;
    }
    if (row < 0 || row >= edge) {
      row = row < 0 ? 0 : edge - 1;
      column = edge - 1 - column;
    }
    return cells[std::size_t(row) * std::size_t(edge) + std::size_t(column)];
  };
  return blend(cell(left, below), cell(left + 1, below), cell(left, below + 1),
               cell(left + 1, below + 1));
}

glm::vec3 EnvironmentMap::mean() const { return glm::vec3(power_ / (2 * kTurn)); }

std::size_t EnvironmentMap::memoryBytes() const {
  return (texels_.size() + levels_.size()) * sizeof(glm::vec3);
}

EnvironmentCube::EnvironmentCube(const EnvironmentMap& map, const RasterGeometry& geometry)
    : pixels_(geometry.pixels().size()) {
  const int resolution = geometry.resolution();
  SURFEIT_CHECK(pixels_.size() == RasterGeometry::pixelCount(resolution));
  // Faces of the frame's axes are those of the world's, in another order: the axes keep theirs
  const std::size_t face = pixels_.size() / RasterGeometry::kFaces;
  const auto worldPixel = [&](std::size_t i) {
    return (i + std::size_t(2 * map.first_axis_) * face) % pixels_.size();
  };
  std::vector<float> solid_angles(pixels_.size());
  for (std::size_t i = 0; i < pixels_.size(); ++i) {
    solid_angles[i] = geometry.pixels()[worldPixel(i)].solid_angle;
  }
  std::vector<glm::vec3> means(pixels_.size());
  map.average(CubeGrid(resolution), solid_angles, means);
  for (std::size_t i = 0; i < pixels_.size(); ++i) pixels_[worldPixel(i)] = means[i];
}

LoadedEnvironment::LoadedEnvironment(EnvironmentMap loaded, int raster_resolution)
    : map(std::move(loaded)), cube(map, RasterGeometry(raster_resolution)) {}

GatherRules gatherRules(const GatherSettings& settings, const LoadedEnvironment* environment) {
  GatherRules rules(settings);
  if (environment != nullptr) {
    rules.environment = &environment->map;
    rules.environment_cube = &environment->cube;
  }
  return rules;
}

}  // namespace surfeit
