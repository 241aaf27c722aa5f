#include "photons/radiance_estimate.h"

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <limits>

#include "core/assert.h"
#include "core/spherical_harmonics.h"

namespace surfeit {
namespace {

// Hulls of fewer photons say little.
constexpr std::size_t kLeastHullPhotons = 10;
// Photons along a line, on a hull without area, stand for this part of the disk.
constexpr double kLeastPart = 1.0 / 64;
// A hull counts where it is smaller than the disk by more than chance: by one part in the root of
// the number of photons, which is three times what it varies by, and what the estimate does.
bool isSmaller(double hull_area, double disk_area, std::size_t photon_count) {
  return hull_area < disk_area * (1 - 1 / std::sqrt(double(photon_count)));
}

// Photons at one position stand for a disk of this part of the max distance.
constexpr float kLeastRadius = 1.0f / 16384;

double cross(const glm::dvec2& o, const glm::dvec2& a, const glm::dvec2& b) {
  return (a.x - o.x) * (b.y - o.y) - (a.y - o.y) * (b.x - o.x);
}

// Appends the chain of hull corners over sorted points, without the last point.
template <typename Iterator>
void appendChain(Iterator begin, Iterator end, std::vector<glm::dvec2>& hull) {
  const std::size_t first = hull.size();
  for (Iterator point = begin; point != end; ++point) {
    while (hull.size() >= first + 2 && cross(hull[hull.size() - 2], hull.back(), *point) <= 0) {
      hull.pop_back();
    }
    hull.push_back(*point);
  }
  hull.pop_back();
}

// Removes points that are certainly no corners: those in a rectangle that the farthest points along
// the diagonals span (after Akl and Toussaint 1978). Of points on a disk, nearly two in three.
void removeInnerPoints(std::vector<glm::dvec2>& points) {
  glm::dvec2 most_sum = points[0], least_sum = points[0];
  glm::dvec2 most_difference = points[0], least_difference = points[0];
  for (const glm::dvec2& p : points) {
    const double sum = p.x + p.y, difference = p.x - p.y;
    if (sum > most_sum.x + most_sum.y) most_sum = p;
    if (sum < least_sum.x + least_sum.y) least_sum = p;
    if (difference > most_difference.x - most_difference.y) most_difference = p;
    if (difference < least_difference.x - least_difference.y) least_difference = p;
  }
  const double left = std::max(least_sum.x, least_difference.x);
  const double right = std::min(most_sum.x, most_difference.x);
  const double bottom = std::max(least_sum.y, most_difference.y);
  const double top = std::min(most_sum.y, least_difference.y);
  std::erase_if(points, [&](const glm::dvec2& p) {
    return p.x > left && p.x < right && p.y > bottom && p.y < top;
  });
}

}  // namespace

float distanceToOthers(std::span<const NearestPhoton> others) {
  constexpr float kNone = std::numeric_limits<float>::infinity();
  float nearest_sq = kNone, second_sq = kNone;
  for (const NearestPhoton& other : others) {
    const float along_sq = glm::dot(other.offset, other.offset);
    const float height_sq = (other.distance_sq - along_sq) / (kOthersStretch * kOthersStretch);
    if (4 * height_sq > along_sq) continue;
    second_sq = std::min(second_sq, std::max(along_sq, nearest_sq));
    nearest_sq = std::min(nearest_sq, along_sq);
  }
  return std::sqrt(second_sq);
}

double convexArea(std::vector<glm::dvec2>& points, std::vector<glm::dvec2>& hull) {
  const double count = double(points.size());
  removeInnerPoints(points);

  // Monotone chains (Andrew 1979)
  std::sort(points.begin(), points.end(), [](const glm::dvec2& a, const glm::dvec2& b) {
    return a.x < b.x || (a.x == b.x && a.y < b.y);
  });
  hull.clear();
  appendChain(points.begin(), points.end(), hull);
  appendChain(points.rbegin(), points.rend(), hull);

  double twice_area = 0;
  for (std::size_t i = 2; i < hull.size(); ++i) twice_area += cross(hull[0], hull[i - 1], hull[i]);
  return 0.5 * twice_area * (count + 1) / (count - double(hull.size()) + 1);
}

RadianceEstimator::RadianceEstimator(const NearestPhotonSearch& search) : search_(search) {
  SURFEIT_ASSERT(std::isfinite(search.max_distance));
  points_.reserve(search.count + 1);
  hull_.reserve(search.count + 2);
}

RadianceEstimate RadianceEstimator::estimate(std::span<const NearestPhoton> photons) {
  SURFEIT_ASSERT(!photons.empty() && photons.size() <= search_.count + 1);
  RadianceEstimate result;
  result.is_sparse = photons.size() <= search_.count;
  const std::span<const NearestPhoton> counted =
      photons.first(std::min(photons.size(), search_.count));

  // With the radius of the next photon, n photons at random have the disk's area over n as the
  // expected area of each, without bias. Where the surface is curved, that photon is farther away
  // than in the tangent plane, where the disk lies
  float radius_sq = 0;
  for (const NearestPhoton& photon : photons) {
    radius_sq = std::max(radius_sq, glm::dot(photon.offset, photon.offset));
  }
  result.radius = result.is_sparse ? search_.max_distance : std::sqrt(radius_sq);
  result.radius = std::max(result.radius, search_.max_distance * kLeastRadius);
  const double disk = double(kPi) * double(result.radius) * double(result.radius);
  double area = disk;
  if (photons.size() >= kLeastHullPhotons) {
    points_.clear();
    for (const NearestPhoton& photon : photons) points_.emplace_back(photon.offset);
    const double hull_area = convexArea(points_, hull_);
    if (isSmaller(hull_area, disk, photons.size())) area = std::max(hull_area, disk * kLeastPart);
  }

  // A lone photon does not stand for all of the disk: no area is larger than that of a photon of
  // the sparsest estimate that is not short of photons
  const double largest = double(kPi) * double(search_.max_distance) * double(search_.max_distance) /
                         double(search_.count);
  glm::dvec3 power(0);
  for (const NearestPhoton& photon : counted) power += glm::dvec3(photon.power);
  const double count = double(counted.size());
  const double photon_area = std::min(area / count, largest);
  result.area = float(photon_area);
  result.irradiance = glm::vec3(power / (count * photon_area));
  return result;
}

}  // namespace surfeit
