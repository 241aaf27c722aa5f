#include "octree/neighbours/normal_rule.h"

#include <fmt/format.h>

#include <cmath>
#include <glm/geometric.hpp>

#include "core/up_comment.h"
#include "octree/neighbours/surface_fits.h"

namespace surfeit {
namespace {

using Toward = NormalOrientation::Toward;

}  // namespace

Status NormalRule::check(const NormalEstimation& estimation) {
  const glm::dvec3& sensor = estimation.orientation.sensor;
  if (std::isfinite(sensor.x + sensor.y + sensor.z)) return {};
  return Status::invalidArgument("sensor: a coordinate is not finite");
}

NormalRule::NormalRule(const NormalEstimation& estimation, UpAxis up, const glm::dvec3& origin,
                       const glm::vec3& centre)
    : estimation_(estimation),
      up_(up),
      sensor_(estimation.orientation.sensor - origin),
      centre_(centre) {}

glm::vec3 NormalRule::oriented(const glm::vec3& normal, const glm::vec3& place,
                               const glm::vec3& sensor) const {
  float toward = 0;
  switch (estimation_.orientation.toward) {
    case Toward::kUp:
      toward = normal[int(up_)];
      break;
    case Toward::kSensor:
    case Toward::kTrajectory:
      toward = glm::dot(normal, sensor - place);
      break;
    case Toward::kOutward:
      toward = glm::dot(normal, place - centre_);
      break;
    case Toward::kConsistent:
      break;
  }
  return toward < 0 ? -normal : normal;
}

FoundNormal NormalRule::at(const glm::vec3& place, const SurfaceAt& surface,
                           const glm::vec3& sensor) const {
  FoundNormal found;
  found.is_thin = surface.normal == glm::vec3(0) || surface.thickness > kThinThickness;
  found.is_two_sided =
      found.is_thin && estimation_.thin_is_two_sided && surface.normal != glm::vec3(0);
  if (!found.is_thin || found.is_two_sided) found.normal = oriented(surface.normal, place, sensor);
  return found;
}

std::string NormalRule::describe() const {
  const NormalOrientation& orientation = estimation_.orientation;
  std::string text;
  switch (orientation.toward) {
    case Toward::kUp:
      text = fmt::format("up {}", upAxisName(up_));
      break;
    case Toward::kSensor:
      text = fmt::format("sensor {},{},{}", orientation.sensor.x, orientation.sensor.y,
                         orientation.sensor.z);
      break;
    case Toward::kOutward:
      text = "outward";
      break;
    case Toward::kTrajectory:
      text = "trajectory";
      break;
    case Toward::kConsistent:
      text = fmt::format("consistent, up {}", upAxisName(up_));
      break;
  }
  return text + (estimation_.thin_is_two_sided ? ", thin two-sided" : ", thin spheres");
}

}  // namespace surfeit
