#include "sample/meshes/spline.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstddef>

namespace surfeit {
namespace {

// What control points count at one place of a curve.
class Blend {
 public:
  Blend(std::span<const CurvePoint> control, std::span<const float> weights)
      : control_(control), weights_(weights) {}

  void add(std::size_t i, double factor) {
    if (!weights_.empty()) factor *= double(weights_[i]);
    sum_.position += factor * control_[i].position;
    sum_.width += factor * control_[i].width;
    color_ += factor * glm::dvec3(control_[i].color);
    total_ += factor;
  }

  CurvePoint point() const {
    CurvePoint point;
    point.position = sum_.position / total_;
    point.width = sum_.width / total_;
    point.color = glm::vec3(color_ / total_);
    return point;
  }

 private:
  std::span<const CurvePoint> control_;
  std::span<const float> weights_;
  CurvePoint sum_;
  glm::dvec3 color_{0};
  double total_ = 0;
};

// The knots of all basis functions, from those that a file has.
Status completeKnots(const HoudiniBasis& basis, std::size_t vertices, std::vector<double>& knots) {
  const std::size_t order = basis.order, inner = vertices - order + 2;
  std::vector<double> given(basis.knots.begin(), basis.knots.end());
  if (given.empty()) {
    for (std::size_t i = 0; i < inner; ++i) given.push_back(double(i));
  }
  knots.clear();
  if (given.size() == vertices + order) {
    knots = given;
  } else if (given.size() == inner && basis.has_ends) {
    knots.assign(order - 1, given.front());
    knots.insert(knots.end(), given.begin(), given.end());
    knots.insert(knots.end(), order - 1, given.back());
  } else if (given.size() + 2 == vertices + order) {
    // The outermost knots have no influence
    knots.push_back(given.front());
    knots.insert(knots.end(), given.begin(), given.end());
    knots.push_back(given.back());
  } else {
    return Status::corruption(fmt::format("{} knots, expected {} for {} vertices of order {}",
                                          given.size(), vertices + order, vertices, order));
  }
  const bool are_numbers =
      std::all_of(knots.begin(), knots.end(), [](double knot) { return std::isfinite(knot); });
  if (are_numbers && std::is_sorted(knots.begin(), knots.end())) return {};
  return Status::corruption("knots that do not rise");
}

// Values of the `order` basis functions that are not 0 within the span that begins with knot
// `span` (Piegl and Tiller, The NURBS Book, A2.2).
void basisFunctions(const std::vector<double>& knots, std::size_t span, std::size_t order, double u,
                    std::vector<double>& values) {
  values.assign(order, 0);
  values[0] = 1;
  for (std::size_t degree = 1; degree < order; ++degree) {
    double saved = 0;
    for (std::size_t r = 0; r < degree; ++r) {
      const double right = knots[span + r + 1] - u, left = u - knots[span + 1 + r - degree];
      const double part = values[r] / (right + left);
      values[r] = saved + right * part;
      saved = left * part;
    }
    values[degree] = saved;
  }
}

Status evaluateNurbs(const HoudiniBasis& basis, std::span<const CurvePoint> control,
                     std::span<const float> weights, std::vector<CurvePoint>& points) {
  const std::size_t order = basis.order;
  std::vector<double> knots, values;
  SURFEIT_RETURN_IF_ERROR(completeKnots(basis, control.size(), knots));
  const int steps = order > 2 ? kSplineSteps : 1;
  for (std::size_t span = order - 1; span < control.size(); ++span) {
    const double from = knots[span], to = knots[span + 1];
    if (!(to > from)) continue;
    for (int step = points.empty() ? 0 : 1; step <= steps; ++step) {
      basisFunctions(knots, span, order, from + (to - from) * step / steps, values);
      Blend blend(control, weights);
      for (std::size_t i = 0; i < order; ++i) blend.add(span + 1 + i - order, values[i]);
      points.push_back(blend.point());
    }
  }
  return points.empty() ? Status::corruption("knots that are all the same") : Status();
}

Status evaluateBezier(const HoudiniBasis& basis, std::span<const CurvePoint> control,
                      std::span<const float> weights, std::vector<CurvePoint>& points) {
  const std::size_t degree = basis.order - 1;
  if ((control.size() - 1) % degree != 0) {
    return Status::corruption(
        fmt::format("{} vertices, expected a multiple of {} and one more", control.size(), degree));
  }
  const int steps = degree > 1 ? kSplineSteps : 1;
  for (std::size_t begin = 0; begin + degree < control.size(); begin += degree) {
    for (int step = points.empty() ? 0 : 1; step <= steps; ++step) {
      const double u = double(step) / steps;
      Blend blend(control, weights);
      double binomial = 1;
      for (std::size_t i = 0; i <= degree; ++i) {
        blend.add(begin + i,
                  binomial * std::pow(u, double(i)) * std::pow(1 - u, double(degree - i)));
        binomial *= double(degree - i) / double(i + 1);
      }
      points.push_back(blend.point());
    }
  }
  return {};
}

}  // namespace

Status evaluateSpline(const HoudiniBasis& basis, std::span<const CurvePoint> control,
                      std::span<const float> weights, std::vector<CurvePoint>& points) {
  points.clear();
  if (basis.kind == HoudiniBasis::Kind::kPolygon) {
    points.assign(control.begin(), control.end());
    return {};
  }
  if (basis.order < 2 || control.size() < basis.order) {
    return Status::corruption(fmt::format("{} vertices, expected {} or more for its order",
                                          control.size(), std::max(basis.order, 2u)));
  }
  if (std::any_of(weights.begin(), weights.end(), [](float w) { return !(w > 0 && w < 1e6f); })) {
    return Status::corruption("a weight that is not above 0");
  }
  return basis.kind == HoudiniBasis::Kind::kNurbs ? evaluateNurbs(basis, control, weights, points)
                                                  : evaluateBezier(basis, control, weights, points);
}

}  // namespace surfeit
