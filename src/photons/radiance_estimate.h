// Irradiance and area per photon from the nearest photons (memo 08-01, section 7.2; app note 6.2).
#pragma once

#include <cstddef>
#include <glm/vec2.hpp>
#include <glm/vec3.hpp>
#include <span>
#include <vector>

#include "photons/nearest_photons.h"

namespace surfeit {

// What is estimated at a photon. irradiance * area is the mean power of the photons.
struct RadianceEstimate {
  glm::vec3 irradiance{0};
  float area = 0;          // of the surface, per photon
  float radius = 0;        // of the disk that holds the photons
  bool is_sparse = false;  // fewer photons than wanted within the max distance
};

// Estimates by counting photons on a disk that ends at the first photon which no longer belongs to
// them; where the surface, or the light on it, ends within the disk, on what the photons show of
// it. One thread at a time; holds no more than scratch.
class RadianceEstimator {
 public:
  // The search must have a finite max_distance.
  explicit RadianceEstimator(const NearestPhotonSearch& search);

  // From what NearestPhotons::nearest gives, at least one photon; reorders nothing.
  RadianceEstimate estimate(std::span<const NearestPhoton> photons);

 private:
  const NearestPhotonSearch search_;
  std::vector<glm::dvec2> points_, hull_;
};

// How far the disk of a photon may reach that has few neighbours on its own surface: to where
// photons of others show that its surface ends, or that another one runs through its plane. Those
// are photons that lie farther along the plane than twice as far from it; of `others`, found with
// kOthersStretch, the second nearest counts, so that one astray does not. Infinite where there are
// none.
float distanceToOthers(std::span<const NearestPhoton> others);
inline constexpr float kOthersStretch = 2;

// Area of a convex piece of a plane, of which all that is known are points scattered over it at
// random: the area of their convex hull, but for what the hull misses. Given the hull, the points
// within it lie anywhere in it with equal probability, so that their number tells the density; the
// corners do not, for they made the hull. With n points of which c are corners, the expected area
// is hull (n + 1) / (n - c + 1) (Baldin and Reiss 2016). Takes at least one point. Both vectors are
// scratch afterwards.
double convexArea(std::vector<glm::dvec2>& points, std::vector<glm::dvec2>& hull);

}  // namespace surfeit
