#include "sample/dice.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <glm/geometric.hpp>
#include <glm/vec2.hpp>
#include <limits>
#include <span>
#include <utility>

#include "core/assert.h"
#include "core/curve_key.h"

namespace surfeit {
namespace {

// The corner where the longest edge begins.
int longestEdge(const Micropolygon& polygon) {
  int longest = 0;
  double longest_sq = -1;
  for (int i = 0; i < 3; ++i) {
    const glm::dvec3 edge = polygon.corner[(i + 1) % 3] - polygon.corner[i];
    const double length_sq = glm::dot(edge, edge);
    if (length_sq > longest_sq) longest = i, longest_sq = length_sq;
  }
  return longest;
}

// The two parts of a cut from the corner opposite the longest edge, which is divided at `ratio`.
std::pair<Micropolygon, Micropolygon> cut(const Micropolygon& polygon, double ratio) {
  const int a = longestEdge(polygon), b = (a + 1) % 3;
  const glm::dvec3 corner = polygon.corner[a] + ratio * (polygon.corner[b] - polygon.corner[a]);
  const glm::dvec3 weight = polygon.weight[a] + ratio * (polygon.weight[b] - polygon.weight[a]);
  std::pair<Micropolygon, Micropolygon> parts(polygon, polygon);
  parts.first.corner[b] = parts.second.corner[a] = corner;
  parts.first.weight[b] = parts.second.weight[a] = weight;
  return parts;
}

// The longer side of the rectangle that has the area of a convex polygon and, along `axis`, its
// variance.
glm::dvec3 longSide(std::span<const glm::dvec3> corners, const glm::dvec3& axis) {
  const glm::dvec3 along = glm::normalize(axis);
  double sum = 0, moment = 0, square = 0;  // of twice the areas of a fan
  glm::dvec3 normal(0);
  for (std::size_t i = 2; i < corners.size(); ++i) {
    const glm::dvec3 cross = glm::cross(corners[i - 1] - corners[0], corners[i] - corners[0]);
    const double b = glm::dot(corners[i - 1] - corners[0], along);
    const double c = glm::dot(corners[i] - corners[0], along), area = glm::length(cross);
    normal += cross;
    sum += area;
    moment += area * (b + c) / 3;
    square += area * (b * b + c * c + b * c) / 6;
  }
  if (!(sum > 0)) return axis;
  const double mean = moment / sum;
  const double length = std::sqrt(std::max(0.0, 12 * (square / sum - mean * mean)));
  const double width = 0.5 * sum / std::max(length, 1e-300);
  if (length >= width) return length * along;
  return width * glm::normalize(glm::cross(normal, along));
}

// Cuts a triangle into slabs across its longest edge a b, in the coordinates of that edge: t runs
// from 0 at a to 1 at b, s from 0 on the edge to 1 at the corner c opposite, whose foot is at
// t = foot. The triangle is 0 <= s <= height(t), and its area in these coordinates is 1/2.
class SlabCutter {
 public:
  SlabCutter(const Micropolygon& polygon, double area) : polygon_(polygon), area_(area) {
    a_ = longestEdge(polygon), b_ = (a_ + 1) % 3, c_ = (a_ + 2) % 3;
    const glm::dvec3 edge = polygon.corner[b_] - polygon.corner[a_];
    length_ = glm::length(edge);
    const glm::dvec3 to_c = polygon.corner[c_] - polygon.corner[a_];
    foot_ = std::clamp(glm::dot(to_c, edge) / (length_ * length_), 0.0, 1.0);
  }

  double length() const { return length_; }

  // Of the corner above the edge.
  double apexHeight() const { return 2 * area_ / length_; }
  // The t of the place on the edge that is nearest to this one.
  double nearestOnEdge(const glm::dvec3& place) const {
    const glm::dvec3 edge = polygon_.corner[b_] - polygon_.corner[a_];
    return std::clamp(glm::dot(place - polygon_.corner[a_], edge) / (length_ * length_), 0.0, 1.0);
  }

  // The part between t = begin and t = end, begin < end, and s = low and s = high; of area 0 where
  // the triangle is not as high.
  PiecePart slab(double begin, double end, double low = 0, double high = 1) const {
    // Its corners in turn: along the edge, and back along the top
    glm::dvec2 corners[kMostCorners] = {{begin, 0}, {end, 0}, {end, height(end)}};
    int count = 3;
    if (begin < foot_ && foot_ < end) corners[count++] = {foot_, 1};
    corners[count++] = {begin, height(begin)};
    if (low > 0) count = keepBeyond(low, 1, corners, count);
    if (high < 1) count = keepBeyond(high, -1, corners, count);

    // Area and centroid, as a fan of triangles from the first corner
    double area = 0;
    glm::dvec2 moment(0);
    for (int i = 2; i < count; ++i) {
      const glm::dvec2 u = corners[i - 1] - corners[0], v = corners[i] - corners[0];
      const double triangle_area = 0.5 * (u.x * v.y - u.y * v.x);
      area += triangle_area;
      moment += triangle_area * (corners[0] + corners[i - 1] + corners[i]) / 3.0;
    }

    PiecePart part;
    if (!(area > 0)) return part;
    part.area = 2 * area * area_;
    const glm::dvec3 weights = pieceWeights(moment / area);
    part.centroid = combine(polygon_.corner, weights);
    part.weight = combine(polygon_.weight, weights);
    glm::dvec3 places[kMostCorners];
    for (int i = 0; i < count; ++i) {
      places[i] = combine(polygon_.corner, pieceWeights(corners[i]));
      part.radius = std::max(part.radius, glm::distance(places[i], part.centroid));
    }
    part.long_side = longSide(std::span(places).first(std::size_t(count)),
                              polygon_.corner[b_] - polygon_.corner[a_]);
    return part;
  }

 private:
  static constexpr int kMostCorners = 7;  // 5, and one more with each cut

  // Cuts off what lies on the other side of s = limit: below for side 1, above for -1.
  static int keepBeyond(double limit, double side, glm::dvec2 (&corners)[kMostCorners], int count) {
    glm::dvec2 kept[kMostCorners];
    int kept_count = 0;
    for (int i = 0; i < count; ++i) {
      const glm::dvec2 &from = corners[i], &to = corners[(i + 1) % count];
      const double before = side * (from.y - limit), after = side * (to.y - limit);
      if (before >= 0) kept[kept_count++] = from;
      if ((before >= 0) != (after >= 0)) {
        kept[kept_count++] = from + before / (before - after) * (to - from);
      }
    }
    std::copy_n(kept, kept_count, corners);
    return kept_count;
  }

  double height(double t) const {
    if (t < foot_) return t / foot_;
    return foot_ < 1 ? (1 - t) / (1 - foot_) : 1;
  }
  // Barycentric weights of a, b, c at coordinates (t, s).
  glm::dvec3 pieceWeights(const glm::dvec2& at) const {
    const double weight_b = at.x - at.y * foot_;
    return {1 - at.y - weight_b, weight_b, at.y};
  }
  glm::dvec3 combine(const glm::dvec3 (&values)[3], const glm::dvec3& weights) const {
    return values[a_] * weights.x + values[b_] * weights.y + values[c_] * weights.z;
  }

  const Micropolygon& polygon_;
  double area_, length_, foot_;
  int a_, b_, c_;
};

// Goes down to one piece of `count`; `takeFirst(parts, first_count)` chooses at every cut.
template <typename TakeFirst>
Micropolygon descend(Micropolygon polygon, std::uint64_t count, TakeFirst&& takeFirst) {
  while (count > 1) {
    const std::uint64_t first_count = count / 2;
    auto parts = cut(polygon, double(first_count) / double(count));
    const bool is_first = takeFirst(parts, first_count);
    polygon = is_first ? parts.first : parts.second;
    count = is_first ? first_count : count - first_count;
  }
  return polygon;
}

}  // namespace

double Micropolygon::radius() const {
  const glm::dvec3 centre = centroid();
  double radius_sq = 0;
  for (const glm::dvec3& point : corner) {
    radius_sq = std::max(radius_sq, glm::dot(point - centre, point - centre));
  }
  return std::sqrt(radius_sq);
}

Micropolygon wholeTriangle(const Mesh& mesh, std::uint32_t triangle) {
  const glm::uvec3& corners = mesh.triangle[triangle];
  Micropolygon polygon;
  for (int i = 0; i < 3; ++i) {
    polygon.corner[i] = glm::dvec3(mesh.position[corners[i]]);
    polygon.weight[i] = glm::dvec3(0);
    polygon.weight[i][i] = 1;
  }
  return polygon;
}

Micropolygon piece(Micropolygon polygon, std::uint64_t count, std::uint64_t index) {
  SURFEIT_ASSERT(index < count);
  return descend(polygon, count, [&](const auto&, std::uint64_t first_count) {
    const bool is_first = index < first_count;
    if (!is_first) index -= first_count;
    return is_first;
  });
}

std::uint64_t pieceNear(Micropolygon polygon, std::uint64_t count, const glm::dvec3& target) {
  std::uint64_t index = 0;
  descend(polygon, count, [&](const auto& parts, std::uint64_t first_count) {
    const bool is_first = glm::distance(parts.first.centroid(), target) <=
                          glm::distance(parts.second.centroid(), target);
    if (!is_first) index += first_count;
    return is_first;
  });
  return index;
}

void appendParts(const Micropolygon& polygon, double area, double spacing,
                 std::vector<PiecePart>& parts) {
  const double radius = polygon.radius();
  if (radius <= std::max(1.5 * spacing, 2 * std::sqrt(area))) {
    const int a = longestEdge(polygon);
    parts.push_back({polygon.centroid(),
                     (polygon.weight[0] + polygon.weight[1] + polygon.weight[2]) / 3.0, radius,
                     area});
    parts.back().long_side =
        longSide(polygon.corner, polygon.corner[(a + 1) % 3] - polygon.corner[a]);
    return;
  }
  const SlabCutter cutter(polygon, area);
  const int slabs =
      int(std::clamp(std::ceil(cutter.length() / (2 * spacing)), 1.0, double(kMaxSlabs)));
  for (int i = 0; i < slabs; ++i) {
    parts.push_back(cutter.slab(double(i) / slabs, double(i + 1) / slabs));
  }
}

TriangleDice::TriangleDice(const Micropolygon& triangle, double area, std::uint64_t piece_count,
                           double spacing)
    : triangle_(triangle), area_(area), spacing_(spacing), piece_count_(piece_count) {
  SURFEIT_ASSERT(piece_count > 0);
  const SlabCutter cutter(triangle, area);
  const double height = cutter.apexHeight();
  if (!(cutter.length() >= kStripAspect * height)) return;
  // Each part has about the area of a square of `spacing`, and is at most twice as long
  rows_ = int(std::clamp(std::ceil(height / spacing), 1.0, double(kMaxSlabs)));
  const double length = rows_ > 1 ? spacing * spacing * rows_ / height : 2 * spacing;
  const double most = double(piece_count) * double(kMaxSlabs / rows_);
  slabs_ = std::uint64_t(std::clamp(std::ceil(cutter.length() / length), 1.0, most));
}

void TriangleDice::appendParts(std::uint64_t index, std::vector<PiecePart>& parts) const {
  SURFEIT_ASSERT(index < piece_count_);
  if (!isStrip()) {
    const double area = area_ / double(piece_count_);
    return surfeit::appendParts(piece(triangle_, piece_count_, index), area, spacing_, parts);
  }
  const SlabCutter cutter(triangle_, area_);
  const std::uint64_t end = slabs_ * (index + 1) / piece_count_;
  for (std::uint64_t slab = slabs_ * index / piece_count_; slab < end; ++slab) {
    for (int row = 0; row < rows_; ++row) {
      const PiecePart part =
          cutter.slab(double(slab) / double(slabs_), double(slab + 1) / double(slabs_),
                      double(row) / rows_, double(row + 1) / rows_);
      if (part.area > 0) parts.push_back(part);
    }
  }
}

std::uint64_t TriangleDice::pieceNear(const glm::dvec3& target) const {
  if (!isStrip()) return surfeit::pieceNear(triangle_, piece_count_, target);
  const double along = SlabCutter(triangle_, area_).nearestOnEdge(target);
  const std::uint64_t slab = std::min(std::uint64_t(along * double(slabs_)), slabs_ - 1);
  // The one of which the slabs end beyond this one
  return ((slab + 1) * piece_count_ + slabs_ - 1) / slabs_ - 1;
}

std::vector<std::uint32_t> trianglesAlongCurve(const Mesh& mesh) {
  // From a round number: another order gives other surfels
  const RootCube cube = rootCube(movedBounds(mesh.bounds(), glm::dvec3(0)), 0);
  std::vector<std::pair<CurveKey, std::uint32_t>> keys;
  keys.reserve(mesh.triangle.size());
  for (std::size_t i = 0; i < mesh.triangle.size(); ++i) {
    const glm::uvec3& corners = mesh.triangle[i];
    const glm::vec3 centroid = mesh.position[corners.x] / 3.0f + mesh.position[corners.y] / 3.0f +
                               mesh.position[corners.z] / 3.0f;
    keys.emplace_back(curveKey(centroid, cube), std::uint32_t(i));
  }
  std::sort(keys.begin(), keys.end());
  std::vector<std::uint32_t> order;
  order.reserve(keys.size());
  for (const auto& [key, triangle] : keys) order.push_back(triangle);
  return order;
}

DicePlan::DicePlan(const Mesh& mesh, std::uint64_t count)
    : mesh_(mesh),
      count_(count),
      order_(trianglesAlongCurve(mesh)),
      is_adopted_(mesh.triangle.size()) {
  // Always summed in this order: next() must come to the same total, to the last bit
  for (const std::uint32_t triangle : order_) total_area_ += triangleArea(mesh, triangle);
  std::vector<bool> has_surfels(mesh.triangle.size());
  double area = 0;
  for (std::uint64_t i = 0; i < order_.size(); ++i) {
    const double before = area;
    area += triangleArea(mesh, order_[i]);
    if (surfelsUpTo(area) == surfelsUpTo(before)) continue;
    has_surfels[order_[i]] = true;
    last_bearer_ = i;
  }
  if (std::find(has_surfels.begin(), has_surfels.end(), false) == has_surfels.end()) return;
  findAdopted(has_surfels);
}

void DicePlan::findAdopted(const std::vector<bool>& has_surfels) {
  // Corners by place, because files may have a vertex for each face
  using Place = std::array<float, 3>;
  const auto placeOf = [&](std::uint32_t triangle, int k) {
    const glm::vec3& at = mesh_.position[mesh_.triangle[triangle][k]];
    return Place{at.x, at.y, at.z};
  };
  std::vector<std::pair<Place, std::uint32_t>> corners;
  for (std::uint32_t triangle = 0; triangle < has_surfels.size(); ++triangle) {
    if (!has_surfels[triangle]) continue;
    for (int k = 0; k < 3; ++k) corners.emplace_back(placeOf(triangle, k), triangle);
  }
  std::sort(corners.begin(), corners.end());
  glm::dvec3 next(std::numeric_limits<double>::infinity());  // with surfels
  double next_radius = 0;
  for (std::uint64_t i = order_.size(); i-- > 0;) {
    const std::uint32_t triangle = order_[i];
    const Micropolygon polygon = wholeTriangle(mesh_, triangle);
    if (has_surfels[triangle]) {
      next = polygon.centroid();
      next_radius = polygon.radius();
      continue;
    }
    if (glm::distance(polygon.centroid(), next) - next_radius <= spacing()) continue;
    // The nearest of those around its corners
    double nearest = std::numeric_limits<double>::infinity();
    std::uint32_t bearer = 0;
    for (int k = 0; k < 3; ++k) {
      const Place place = placeOf(triangle, k);
      auto at = std::lower_bound(corners.begin(), corners.end(), std::pair(place, 0u));
      for (; at != corners.end() && at->first == place; ++at) {
        const glm::dvec3 centroid = wholeTriangle(mesh_, at->second).centroid();
        const double distance = glm::distance(centroid, polygon.centroid());
        if (!(distance < nearest)) continue;
        nearest = distance;
        bearer = at->second;
      }
    }
    if (!std::isfinite(nearest)) continue;
    adopted_.emplace_back(bearer, triangle);
    is_adopted_[triangle] = true;
  }
  std::sort(adopted_.begin(), adopted_.end());
}

double DicePlan::spacing() const { return std::sqrt(total_area_ / double(count_)); }

std::uint64_t DicePlan::surfelsUpTo(double area) const {
  return std::uint64_t(std::floor(area / total_area_ * double(count_) + 0.5));
}

bool DicePlan::next(DiceJob& job) {
  while (cursor_ < order_.size()) {
    const std::uint64_t i = cursor_++;
    const double area = triangleArea(mesh_, order_[i]);
    job.first_surfel = surfelsUpTo(area_before_);
    area_before_ += area;
    job.piece_count = surfelsUpTo(area_before_) - job.first_surfel;
    if (job.piece_count == 0) continue;

    // Small triangles hand their area on to the next with pieces; those after the last, back to it
    job.triangle = order_[i];
    job.area = area;
    job.carried.clear();
    const std::uint64_t end = i == last_bearer_ ? order_.size() : i;
    for (std::uint64_t k = carried_begin_; k < end; ++k) {
      if (k != i && !is_adopted_[order_[k]]) job.carried.push_back(order_[k]);
    }
    carried_begin_ = cursor_ = end == i ? i + 1 : end;
    const auto first = std::make_pair(job.triangle, std::uint32_t{0});
    for (auto at = std::lower_bound(adopted_.begin(), adopted_.end(), first);
         at != adopted_.end() && at->first == job.triangle; ++at) {
      job.carried.push_back(at->second);
    }
    return true;
  }
  return false;
}

}  // namespace surfeit
