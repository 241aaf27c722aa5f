// Every tolerance is what the codes of the node and of its surfels lose at most (docs/format.md,
// "Columns"): positions 1/1000 to 2/1000 of a radius, radii and areas 2^-11, normals 7e-5.
#include "octree/read/verify_sums.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <optional>

#include "octree/node/facet_match.h"
#include "octree/node/radiosity_variance.h"

namespace surfeit {
namespace {

using Entries = std::array<double, SymmetricMatrix::kEntries>;
constexpr const char* kAxes[] = {"x", "y", "z"};
constexpr const char* kEntryNames[] = {"xx", "yy", "zz", "xy", "xz", "yz"};
constexpr const char* kColorNames[] = {"red", "green", "blue"};
// Half of a step of an unsigned and a signed fraction.
constexpr double kHalfStep = 0.5 / 255, kHalfSignedStep = 0.5 / 127;
// What floats cannot hold: clouds of the least sizes.
constexpr double kTiny = 4 * double(std::numeric_limits<float>::min());

// How far off a covariance may be, as a part of the square of the radius: its deviation is a code,
// its entries are codes of the trace.
double covarianceSlack(double deviation, double rounding) {
  return deviation * (2 * kHalfStep + 4e-3) + kHalfStep * kHalfStep + 0.01 * deviation * deviation +
         2 * rounding * (deviation + rounding);
}

double largestOf(const glm::vec3& v) {
  return double(std::max({std::abs(v.x), std::abs(v.y), std::abs(v.z)}));
}

// Of surfels around their own middle, or around a point at `shift` from their origin.
Entries secondMoment(const AreaSums& sums, const glm::dvec3& about) {
  Entries entries;
  for (std::size_t i = 0; i < entries.size(); ++i) {
    const int row = SymmetricMatrix::kRow[i], column = SymmetricMatrix::kColumn[i];
    entries[i] = sums.second_moment[i] - about[row] * sums.position[column] -
                 sums.position[row] * about[column] + sums.area * about[row] * about[column];
  }
  return entries;
}

// Facets of one kind, or what they must add up to, as parts of the node's area and radius.
struct FacetTotals {
  double area = 0;
  glm::dvec3 covered{0}, normal{0}, place{0};
  Entries spread{};         // second moment around the node's position
  Entries tensor{};         // sum A n n^T
  double front[3][3] = {};  // sum A (x - p) n^T
};

// What the codes of facets may lose.
struct FacetSlack {
  double place = 0, front = 0;
  Entries spread{};
};

// One node and its sums. The first thing that is wrong is told.
class NodeCheck {
 public:
  NodeCheck(const Node& node, const SumsBelow& below, const SumsTolerance& tolerance)
      : node_(node),
        below_(below),
        sums_(below.sums),
        tolerance_(tolerance),
        radius_(node.radius),
        rounding_(2e-7 * largestOf(node.position) / radius_),
        middle_(sums_.middle()) {}

  std::string run() {
    checkPlace();
    checkLoose();
    node_.isFlat() && node_.isTwoSided() ? checkTwoSided() : checkNormal();
    checkCovariance();
    if (tolerance_.has_variances) checkVariance();
    if (tolerance_.has_slopes && node_.isFlat()) {
      checkSlope(node_.slopes[0], sums_.flatPiece(node_.isTwoSided(), tolerance_.flatness_limit),
                 node_.normal);
    }
    if (node_.isRough()) checkRough();
    if (node_.hasFacets()) checkFacets();
    return wrong_;
  }

 private:
  double slack(double quantized, double exact) const {
    return tolerance_.full_precision ? exact : quantized;
  }
  // The first of what is wrong. NaN is.
  void expect(const char* what, const char* part, double found, double expected, double slack) {
    if (!wrong_.empty() || std::abs(found - expected) <= slack + kTiny) return;
    wrong_ = fmt::format("{}{}{} {:.7g}, expected {:.7g} from what lies below", what,
                         *part != 0 ? " " : "", part, found, expected);
  }
  void expectAtLeast(const char* what, double found, double least) {
    if (!wrong_.empty() || found >= least) return;
    wrong_ = fmt::format("{} {:.7g}, expected at least {:.7g}", what, found, least);
  }

  void checkPlace();
  void checkLoose();
  void checkNormal();
  void checkTwoSided();
  void checkCovariance();
  void checkVariance();
  void checkSlope(const RadiositySlope& slope, const AreaSums& piece, const glm::vec3& normal);
  void checkRough();
  void checkPower();
  void checkFacets();
  void checkFacetKind(bool is_two_sided);
  void checkFacetLight();
  void checkFacetNormals(const FacetTotals& found, const FacetTotals& below,
                         const FacetSlack& slack, double area_slack);
  void checkTurnedNormals(const FacetTotals& found, const FacetTotals& below, double area_slack);
  FacetTotals stored(bool is_two_sided, FacetSlack& slack) const;
  FacetTotals expected(bool is_two_sided) const;

  const Node& node_;
  const SumsBelow& below_;
  const NodeSums& sums_;
  const SumsTolerance& tolerance_;
  const double radius_;
  const double rounding_;    // of positions to floats, as a part of the radius
  const glm::dvec3 middle_;  // from the origin of the sums
  std::string wrong_;
};

void NodeCheck::checkPlace() {
  for (int axis = 0; axis < 3; ++axis) {
    expect("position", kAxes[axis], double(node_.position[axis]),
           sums_.origin[axis] + middle_[axis], (slack(5e-3, 1e-5) + rounding_) * radius_);
  }
}

// Half and half is told by areas that codes round.
void NodeCheck::checkLoose() {
  const bool is_clear = std::abs(sums_.loose_area) > slack(2e-3, 1e-5) * sums_.area;
  const bool is_right = node_.isLoose() == (sums_.loose_area > 0) || !is_clear;
  if (!wrong_.empty() || is_right) return;
  wrong_ = fmt::format("{}, expected otherwise from what lies below",
                       node_.isLoose() ? "loose" : "not loose");
}

void NodeCheck::checkNormal() {
  const double found = sums_.normalLength() / sums_.area, most = slack(3e-3, 1e-5);
  expect("flatness", "", double(node_.flatness), found, most);
  for (int axis = 0; axis < 3; ++axis) {
    expect("normal", kAxes[axis], double(node_.flatness) * double(node_.normal[axis]),
           sums_.normal[axis] / sums_.area, most);
  }
  const double limit = double(tolerance_.flatness_limit);
  // Layers that face alike are no flat node, but facets
  const bool is_wrong =
      node_.isFlat() ? found < limit - most : node_.facet_count < 2 && found > limit + most;
  if (wrong_.empty() && is_wrong) {
    wrong_ = fmt::format(
        "{}, expected otherwise: the flatness of what lies below is {:.7g}, the "
        "limit {:.7g}",
        node_.isFlat() ? "flat" : "not flat", found, limit);
  }
}

// All surfels are two-sided, and turned to one side: sum A |c| n with c = n_i n. The few that were
// not turned make the sum shorter (FacetSums), so that a part of 1 - flatness is not known.
void NodeCheck::checkTwoSided() {
  const glm::dvec3 n(node_.normal);
  const double flatness = double(node_.flatness), most = slack(3e-3, 1e-5);
  SymmetricMatrix tensor;
  double trace = 0;
  for (std::size_t i = 0; i < tensor.kEntries; ++i) {
    tensor.entries[i] = float(below_.two_sided[i] / sums_.area);
    if (i < 3) trace += below_.two_sided[i] / sums_.area;
  }
  expect("two-sided part", "", 1, trace, most);
  expectAtLeast("flatness", flatness, double(tolerance_.flatness_limit) - most);
  const double along = double(quadraticForm(tensor, node_.normal));
  expectAtLeast("square of the cosines to the normal", along, flatness * flatness - most);
  const glm::vec3 turned = tensor * node_.normal;
  for (int axis = 0; axis < 3; ++axis) {
    expect("normal", kAxes[axis], along * n[axis], double(turned[axis]), 2 * (1 - flatness) + most);
  }
}

void NodeCheck::checkCovariance() {
  const Entries moment = secondMoment(sums_, middle_);
  const double area = sums_.area, square = radius_ * radius_;
  const double trace = std::max(0.0, (moment[0] + moment[1] + moment[2]) / area);
  const double most = slack(covarianceSlack(std::sqrt(trace) / radius_, rounding_), 1e-5) * square;
  for (std::size_t i = 0; i < moment.size(); ++i) {
    expect("covariance", kEntryNames[i], double(node_.covariance.entries[i]), moment[i] / area,
           most);
  }
}

// As the indexer rounds it, and colors. Facets are pieces of their own: within them radiosities
// vary less than in all of the node.
void NodeCheck::checkVariance() {
  const double found = 1 + double(node_.radiosity_variance);
  const double most = 1 + double(RadiosityVariance::of(sums_));
  const glm::vec3& mean = node_.radiosity;
  const double lost = 1e-6 * double(tolerance_.brightest) /
                      std::max(double(std::max({mean.r, mean.g, mean.b})), kTiny);
  const double slack = (.05 + lost) * std::min(most, 62761.);
  if (node_.hasFacets() && found <= most + slack) return;
  expect("variance of the radiosity", "", found - 1, std::min(most, 62761.) - 1, slack);
}

// Of a piece as it is turned. Normals as they are stored move what they and the brightness have in
// common, and decide whether they differ at all.
void NodeCheck::checkSlope(const RadiositySlope& slope, const AreaSums& piece,
                           const glm::vec3& normal) {
  const double length = piece.normalLength() / piece.area;
  const double range_sq = 1.5 * (1 - length * length);
  constexpr double kLeast = RadiositySlope::kLeastRangeSq;
  if (range_sq > .8 * kLeast && range_sq < 1.2 * kLeast) return;
  const double range = std::sqrt(std::max(range_sq, kLeast));
  const RadiositySlope expected = RadiositySlope::towards(normal, piece);
  for (std::size_t color = 0; color < 3; ++color) {
    const double mean = piece.radiosity[color] / piece.area;
    if (!(mean > 0)) continue;
    const double lost = 3e-6 * double(tolerance_.brightest) / mean;
    for (int axis = 0; axis < 3; ++axis) {
      expect("slope of the radiosity in", kColorNames[color], double(slope.value(color)[axis]),
             double(expected.value(color)[axis]), 0.02 + 3 / range * (1e-3 + lost));
    }
  }
}

void NodeCheck::checkRough() {
  const double area = sums_.area;
  const RoughNode& rough = node_.rough;
  for (int i = 0; i < kShCount; ++i) {
    expect("coefficient of the area", std::to_string(i).c_str(), double(rough.sh[i][kAreaKind]),
           sums_.sh[i][kAreaKind], slack(5e-3, 1e-5) * area);
    expect("band 4 of the area", std::to_string(i).c_str(), double(rough.area_band_4[i]),
           sums_.band_4[i], slack(2.4 * (kHalfSignedStep + 3e-3), 3e-5) * area);
  }
  for (int row = 0; row < 3; ++row) {
    for (int column = 0; column < 3; ++column) {
      expect("front moment", (std::string(kAxes[row]) + kAxes[column]).c_str(),
             double(rough.front_moment[std::size_t(row)][column]),
             sums_.front_moment[row][column] - middle_[row] * sums_.normal[column],
             (slack(kHalfSignedStep + 8e-3, 1e-5) + rounding_) * area * radius_);
    }
  }
  checkPower();
}

// What is a ten-millionth as bright as the brightest may be lost: steps are parts of a page's
// largest.
void NodeCheck::checkPower() {
  for (int color = 0; color < 3; ++color) {
    const double power = sums_.radiosity[color];
    const double lost = 1e-5 * sums_.area * double(node_.radiosity[color]) +
                        1e-7 * sums_.area * double(tolerance_.brightest);
    for (int i = 0; i < kShCount; ++i) {
      expect("coefficient of the power in", kColorNames[color],
             double(node_.rough.sh[i][powerKind(color)]), sums_.sh[i][powerKind(color)],
             4 * (slack(1e-2, 1e-4) * power + lost));
    }
  }
}

// As the node has them, with what their codes may lose.
FacetTotals NodeCheck::stored(bool is_two_sided, FacetSlack& slack) const {
  const double place = kHalfSignedStep + 3e-3 + rounding_;  // of an offset
  FacetTotals totals;
  for (std::size_t k = 0; k < node_.facet_count; ++k) {
    if (node_.isTwoSided(k) != is_two_sided) continue;
    const NodeFacet& facet = node_.facets[k];
    const double area = double(facet.area) / 65535;
    const glm::dvec3 normal(facet.meanNormal());
    const glm::dvec3 at(signedFractionOf(facet.offset[0]), signedFractionOf(facet.offset[1]),
                        signedFractionOf(facet.offset[2]));
    const SymmetricMatrix covariance = covarianceOf(facet.covariance, 1);
    const double deviation = double(deviationOf(facet.covariance, 1)) + kHalfStep;
    const double length = std::min(glm::length(normal), 1.0);
    totals.area += area;
    totals.covered += area * glm::dvec3(facet.opacity());
    totals.normal += area * normal;
    totals.place += area * at;
    slack.place += area * place;
    for (std::size_t i = 0; i < totals.spread.size(); ++i) {
      const int row = SymmetricMatrix::kRow[i], column = SymmetricMatrix::kColumn[i];
      const double entry = double(covariance.entries[i]);
      totals.spread[i] += area * (entry + at[row] * at[column]);
      slack.spread[i] += area * ((std::abs(at[row]) + std::abs(at[column])) * place + 1e-4 +
                                 2 * rounding_ * (deviation + rounding_) +
                                 std::abs(entry) * (2 * kHalfStep + 4e-3) / deviation +
                                 6e-3 * deviation * deviation);
      if (length > 0) totals.tensor[i] += area * normal[row] * normal[column] / (length * length);
    }
    for (int row = 0; row < 3; ++row) {
      for (int column = 0; column < 3; ++column) {
        totals.front[row][column] += area * at[row] * normal[column];
      }
    }
    // Within a facet places and normals may vary together
    slack.front += area * (place + 1e-3 + deviation * std::sqrt(1 - length * length));
  }
  return totals;
}

FacetTotals NodeCheck::expected(bool is_two_sided) const {
  FacetTotals totals;
  const glm::dvec3 origin(sums_.origin[0], sums_.origin[1], sums_.origin[2]);
  const glm::dvec3 at = glm::dvec3(node_.position) - origin;
  for (const FacetGroup& group : sums_.facets.groups()) {
    if (group.is_two_sided != is_two_sided) continue;
    const Entries moment = secondMoment(group, at);
    totals.area += group.area / sums_.area;
    for (int axis = 0; axis < 3; ++axis) {
      totals.covered[axis] += group.covered[axis] / sums_.area;
      totals.normal[axis] += group.normal[axis] / sums_.area;
      totals.place[axis] += (group.position[axis] - group.area * at[axis]) / (sums_.area * radius_);
    }
    for (std::size_t i = 0; i < moment.size(); ++i) {
      totals.spread[i] += moment[i] / (sums_.area * radius_ * radius_);
    }
  }
  for (std::size_t i = 0; i < totals.tensor.size(); ++i) {
    totals.tensor[i] = below_.two_sided[i] / sums_.area;
  }
  for (int row = 0; row < 3; ++row) {
    for (int column = 0; column < 3; ++column) {
      totals.front[row][column] =
          (sums_.front_moment[row][column] - at[row] * sums_.normal[column]) /
          (sums_.area * radius_);
    }
  }
  return totals;
}

// Which surfels are in which facet is not stored: facets of a kind are compared in sum.
void NodeCheck::checkFacetKind(bool is_two_sided) {
  FacetSlack slack;
  const FacetTotals found = stored(is_two_sided, slack);
  const FacetTotals below = expected(is_two_sided);
  const double area_slack = 2e-3 + double(node_.facet_count) / 65535;
  expect("area of facets", "", found.area, below.area, area_slack);
  for (int color = 0; color < 3; ++color) {
    expect("opacity of facets", node_.isTinted() ? kColorNames[color] : "", found.covered[color],
           below.covered[color], area_slack);
  }
  for (int axis = 0; axis < 3; ++axis) {
    expect("offset of facets", kAxes[axis], found.place[axis], below.place[axis],
           slack.place + area_slack);
  }
  // Clouds of the least sizes have no covariances: squares of their lengths are no floats
  const bool has_spreads = radius_ * radius_ > 1e6 * kTiny;
  if (!has_spreads) return;
  for (std::size_t i = 0; i < found.spread.size(); ++i) {
    expect("covariance of facets", kEntryNames[i], found.spread[i], below.spread[i],
           slack.spread[i] + area_slack / 2);
  }
  is_two_sided ? checkTurnedNormals(found, below, area_slack)
               : checkFacetNormals(found, below, slack, area_slack);
}

void NodeCheck::checkFacetNormals(const FacetTotals& found, const FacetTotals& below,
                                  const FacetSlack& slack, double area_slack) {
  for (int row = 0; row < 3; ++row) {
    expect("normal of facets", kAxes[row], found.normal[row], below.normal[row], area_slack + 1e-3);
    for (int column = 0; column < 3; ++column) {
      expect("front moment of facets", (std::string(kAxes[row]) + kAxes[column]).c_str(),
             found.front[row][column], below.front[row][column], slack.front + area_slack);
    }
  }
}

// Normals are turned to one side or the other. Surfels of a facet differ from its normal the more,
// the shorter it is.
void NodeCheck::checkTurnedNormals(const FacetTotals& found, const FacetTotals& below,
                                   double area_slack) {
  double slack = area_slack + 1e-3;
  for (std::size_t k = 0; k < node_.facet_count; ++k) {
    if (!node_.isTwoSided(k)) continue;
    const double length = double(glm::length(node_.facets[k].meanNormal()));
    slack += double(node_.facets[k].area) / 65535 * 4 * std::max(0.0, 1 - length);
  }
  for (std::size_t i = 0; i < found.tensor.size(); ++i) {
    expect("square of the normals of facets", kEntryNames[i], found.tensor[i], below.tensor[i],
           slack);
  }
}

void NodeCheck::checkFacets() {
  if (!wrong_.empty()) return;
  if (sums_.facets.groups().empty()) {
    wrong_ = "facets, expected none above spheres";
    return;
  }
  checkFacetKind(false);
  checkFacetKind(true);
  double area = 0, facing = 0;
  for (std::size_t k = 0; k < node_.facet_count; ++k) {
    area += double(node_.facets[k].area) / 65535;
    facing +=
        double(node_.facets[k].area) / 65535 * double(glm::length(node_.facets[k].meanNormal()));
  }
  expectAtLeast("flatness of facets", facing / area, double(tolerance_.flatness_limit) - 4e-3);
  checkFacetLight();
}

// A mean of what lies below; where surfels group as they did when they were indexed, that of its
// own group. (Scenes that were lit again give each facet the light of the groups that face most as
// it does.)
void NodeCheck::checkFacetLight() {
  const double lost = 1e-6 * double(tolerance_.brightest);
  const FacetSums groups = sums_.facets.fewest(tolerance_.flatness_limit);
  const std::optional<FacetMatch> match = matchFacets(groups, sums_.origin, node_);
  for (std::size_t i = 0; i < node_.facet_count; ++i) {
    const std::size_t at = match ? (*match)[i] : i;
    const NodeFacet& facet = node_.facets[at];
    if (match && tolerance_.has_slopes) {
      checkSlope(node_.slopes[at], groups.groups()[i], facet.meanNormal());
    }
    for (int color = 0; color < 3; ++color) {
      const double found = double(facet.radiosity[color]);
      if (match) {
        const FacetGroup& group = groups.groups()[i];
        const double mean = group.radiosity[color] / group.covered[color];
        expect("facet radiosity in", kColorNames[color], found, mean, 1e-2 * mean + lost);
      } else {
        expect("facet radiosity in", kColorNames[color], found,
               std::clamp(found, double(below_.least[color]), double(below_.greatest[color])),
               1e-2 * found + lost);
      }
    }
  }
}

}  // namespace

void SumsBelow::add(const Surfel& surfel) {
  sums.add(surfel);
  least = glm::min(least, surfel.radiosity);
  greatest = glm::max(greatest, surfel.radiosity);
  if (!surfel.isTwoSided() || surfel.isSphere()) return;
  for (std::size_t i = 0; i < SymmetricMatrix::kEntries; ++i) {
    two_sided[i] += double(surfel.area) * double(surfel.normal[SymmetricMatrix::kRow[i]]) *
                    double(surfel.normal[SymmetricMatrix::kColumn[i]]);
  }
}

void SumsBelow::add(const SumsBelow& child) {
  sums.add(child.sums);
  least = glm::min(least, child.least);
  greatest = glm::max(greatest, child.greatest);
  for (std::size_t i = 0; i < SymmetricMatrix::kEntries; ++i) two_sided[i] += child.two_sided[i];
}

std::string wrongSum(const Node& node, const SumsBelow& below, const SumsTolerance& tolerance) {
  return NodeCheck(node, below, tolerance).run();
}

}  // namespace surfeit
