#include "view/disk_raster.h"

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>

#include "core/spherical_harmonics.h"

namespace surfeit {
namespace {

// Half a sample's diagonal: the reach of the screen-space filter.
constexpr float kFilterRadius = 0.7072f;

// A disk is this thick, in radii: neighbours that overlap on a curved surface lie within it.
constexpr float kThicknessInRadii = 1;

// The slopes between which a conic lies along one axis (0: x, 1: y); requires it to lie wholly
// before the eye's plane, which makes c22 negative.
struct SlopeRange {
  float low, high;
};

SlopeRange slopeRange(const glm::vec3& c, const glm::vec3& n, float radius, int axis) {
  const double r_sq = double(radius) * double(radius);
  const double ca = double(c[axis]), cz = double(c.z), na = double(n[axis]), nz = double(n.z);
  const double c00 = r_sq * (1 - na * na) - ca * ca;
  const double c02 = r_sq * (-na * nz) - ca * cz;
  const double c22 = r_sq * (1 - nz * nz) - cz * cz;
  const double root = std::sqrt(std::max(c02 * c02 - c00 * c22, 0.0));
  return {float((c02 + root) / c22), float((c02 - root) / c22)};
}

// The samples whose centres lie in [low, high], within [0, limit).
void sampleRange(float low, float high, int limit, int& begin, int& end) {
  begin = int(std::ceil(std::clamp(low - 0.5f, 0.f, float(limit))));
  end = int(std::floor(std::clamp(high - 0.5f, -1.f, float(limit - 1)))) + 1;
}

bool isEmpty(const ScreenBox& box) { return box.x_begin >= box.x_end || box.y_begin >= box.y_end; }

// Whether a sphere lies wholly beyond one of the four sides of the frustum. A side plane of slope s
// holds u = s z; the distance from it is (u - s z) / sqrt(1 + s^2).
bool isBesideFrustum(const glm::vec3& c, float radius, const Camera& camera) {
  const float slope_x = camera.slopeX(float(camera.width()));
  const float slope_y = camera.slopeY(0);
  return std::abs(c.x) - slope_x * c.z > radius * std::sqrt(1 + slope_x * slope_x) ||
         std::abs(c.y) - slope_y * c.z > radius * std::sqrt(1 + slope_y * slope_y);
}

// Of a disk of the area of the record's piece. All of a sphere is core, and of a disk whose piece
// is not known.
float coreRho(const CloudRecord& record) {
  if (!(record.area > 0) || record.normal == glm::vec3(0)) return 1;
  return std::min(1.f, record.area / (float(kPi) * record.radius * record.radius));
}

// Where the centre of a surfel that lies before the eye is seen.
void placeCentre(ScreenSurfel& surfel, const Camera& camera) {
  surfel.screen_x = camera.screenX(surfel.centre.x / surfel.centre.z);
  surfel.screen_y = camera.screenY(surfel.centre.y / surfel.centre.z);
}

}  // namespace

std::optional<ScreenSurfel> projectDisk(const CloudRecord& record, const Camera& camera) {
  ScreenSurfel surfel;
  surfel.centre = camera.cameraFromWorld(record.position);
  surfel.normal = camera.cameraFromWorldDirection(record.normal);
  surfel.radius = record.radius;
  surfel.core_rho = coreRho(record);
  surfel.value = glm::vec3(0);
  const bool is_sphere = record.normal == glm::vec3(0);
  surfel.shape = is_sphere ? ScreenSurfel::Shape::kSphere : ScreenSurfel::Shape::kDisk;
  surfel.is_back = glm::dot(surfel.normal, surfel.centre) > 0;

  // Drop what lies before the near plane; what crosses it could be seen anywhere on the screen
  const glm::vec3& c = surfel.centre;
  const float reach_z =
      surfel.radius * std::sqrt(std::max(1 - surfel.normal.z * surfel.normal.z, 0.f));
  if (!(c.z + reach_z > camera.nearDepth())) return std::nullopt;
  float low_x = 0, high_x = float(camera.width()), low_y = 0, high_y = float(camera.height());
  if (c.z - reach_z > camera.nearDepth()) {
    placeCentre(surfel, camera);
    const SlopeRange x = slopeRange(c, surfel.normal, surfel.radius, 0);
    const SlopeRange y = slopeRange(c, surfel.normal, surfel.radius, 1);
    low_x = std::min(camera.screenX(x.low), surfel.screen_x - kFilterRadius);
    high_x = std::max(camera.screenX(x.high), surfel.screen_x + kFilterRadius);
    low_y = std::min(camera.screenY(y.high), surfel.screen_y - kFilterRadius);
    high_y = std::max(camera.screenY(y.low), surfel.screen_y + kFilterRadius);
  } else if (isBesideFrustum(c, surfel.radius, camera)) {
    return std::nullopt;
  } else {
    // Far outside the screen: the screen-space filter must not find it
    surfel.screen_x = surfel.screen_y = -1e30f;
  }
  sampleRange(low_x, high_x, camera.width(), surfel.box.x_begin, surfel.box.x_end);
  sampleRange(low_y, high_y, camera.height(), surfel.box.y_begin, surfel.box.y_end);
  if (isEmpty(surfel.box)) return std::nullopt;

  // Disks below a sample are as thick as a sample is wide: several surfels share it
  surfel.thickness =
      std::max(kThicknessInRadii * surfel.radius, std::max(c.z, 0.f) * camera.slopeStep());
  return surfel;
}

std::optional<ScreenSurfel> projectSquare(const CloudRecord& record, const Camera& camera,
                                          float size) {
  ScreenSurfel surfel;
  surfel.centre = camera.cameraFromWorld(record.position);
  surfel.normal = camera.cameraFromWorldDirection(record.normal);
  surfel.radius = surfel.core_rho = 1;
  surfel.value = glm::vec3(0);
  surfel.shape = ScreenSurfel::Shape::kSquare;
  surfel.is_back = glm::dot(surfel.normal, surfel.centre) > 0;
  surfel.thickness = 0;  // the nearest wins
  if (!(surfel.centre.z > camera.nearDepth())) return std::nullopt;

  // Exactly `size` samples along each edge, whichever way the centre falls
  placeCentre(surfel, camera);
  const float edge = std::max(std::round(size), 1.f);
  const float begin_x = std::round(surfel.screen_x - 0.5f * edge);
  const float begin_y = std::round(surfel.screen_y - 0.5f * edge);
  sampleRange(begin_x, begin_x + edge, camera.width(), surfel.box.x_begin, surfel.box.x_end);
  sampleRange(begin_y, begin_y + edge, camera.height(), surfel.box.y_begin, surfel.box.y_end);
  if (isEmpty(surfel.box)) return std::nullopt;
  return surfel;
}

}  // namespace surfeit
