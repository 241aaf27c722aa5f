// The normal of a place, from the surface through its neighbours.
#pragma once

#include <glm/vec3.hpp>
#include <string>

#include "octree/neighbours/surface_search.h"
#include "surfeit/normal_estimation.h"
#include "surfeit/status.h"
#include "surfeit/up_axis.h"

namespace surfeit {

struct FoundNormal {
  glm::vec3 normal{0};  // unit, oriented unless needsSides(); zero: a sphere
  bool is_thin = true;  // on no surface
  bool is_two_sided = false;
};

// Immutable: threads may share it.
class NormalRule {
 public:
  // kInvalidArgument for a sensor that is not finite.
  static Status check(const NormalEstimation& estimation);

  // Places, and the middle of the cloud's bounds, are counted from `origin`.
  NormalRule(const NormalEstimation& estimation, UpAxis up, const glm::dvec3& origin,
             const glm::vec3& centre);

  // Whether normals from at() point to either side, and neighbours must agree on one
  // (orientation.h).
  bool needsSides() const {
    return estimation_.orientation.toward == NormalOrientation::Toward::kConsistent;
  }

  // Whether at() must be told where the sensor was, from the origin.
  bool needsTrajectory() const {
    return estimation_.orientation.toward == NormalOrientation::Toward::kTrajectory;
  }

  FoundNormal at(const glm::vec3& place, const SurfaceAt& surface) const {
    return at(place, surface, sensor_);
  }
  FoundNormal at(const glm::vec3& place, const SurfaceAt& surface, const glm::vec3& sensor) const;

  // For provenance: "up, thin spheres".
  std::string describe() const;

 private:
  glm::vec3 oriented(const glm::vec3& normal, const glm::vec3& place,
                     const glm::vec3& sensor) const;

  NormalEstimation estimation_;
  UpAxis up_;
  glm::vec3 sensor_, centre_;
};

}  // namespace surfeit
