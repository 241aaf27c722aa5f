#include "octree/neighbours/surface_cell.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <glm/geometric.hpp>
#include <glm/vec2.hpp>
#include <limits>
#include <numeric>
#include <vector>

#include "core/spherical_harmonics.h"
#include "core/tangent_frame.h"
#include "octree/neighbours/cell_cutters.h"
#include "octree/neighbours/cell_polygon.h"
#include "octree/neighbours/sheet_gaps.h"
#include "octree/neighbours/surface_fits.h"
#include "octree/neighbours/third_nearest.h"

namespace surfeit {
namespace {

// A surfel with a wrong normal is so many times as far from what faces as it does as from the third
// nearest place of any sheet.
constexpr float kFarOff = 4;
// What lies so close beside a place, in spacings, has no mirror image; and shares its cell.
constexpr float kSharing = 0.05f, kCoincident = 1e-3f;

// Neighbours whose normals differ by more than 60 degrees are of another surface, which meets this
// one at an edge (as of photons, photons/nearest_photons.h).
constexpr float kLeastCosine = 0.5f;
// For rounding, of bounds: of the cosine, and of lengths.
constexpr float kBoundsSlack = 1e-3f;
// At the edge of a surface cells are closed by other places of the edge, far outside: they reach
// farther than this, in distances of the places that cut them.
constexpr float kSpike = 2;
// What cuts from farther away lies flatter than this, root mean square, or all of it are strays.
constexpr float kLooseSlope = 0.3f;
constexpr float kOpen = SurfaceFitLanes::kOpen;

constexpr float kInfinity = std::numeric_limits<float>::infinity();

// Of the plane that its cell lies in.
glm::vec3 normalIn(const SurfaceFitLanes& fits, std::size_t lane) {
  return {fits.own_x[lane], fits.own_y[lane], fits.own_z[lane]};
}

// Of so many neighbours, in units of the farthest.
float spacingOf(float count) { return std::sqrt(kPi / (count + 1)); }

}  // namespace

struct SurfaceCells::Scratch {
  SurfaceFitLanes fits;
  std::array<CellPlace, SurfaceFitLanes::kLanes> places;
  std::vector<FlatNeighbour> flat;
  std::vector<float> heights;
  std::vector<glm::vec2> cutters;
  std::vector<float> slopes_sq;           // of those from farther away
  std::vector<Neighbour> cutting, sheet;  // the cutters; all on the place's own sheet
  std::vector<Neighbour> bounding;        // of the cutters, those at its sides
  CellEnds ends;
  ThirdNearest third_nearest;

  // Of the cell in the making. Lengths are in units of the farthest neighbour.
  std::size_t lane = 0;
  float unit = 1, spacing = 1, sharers = 1;
  glm::vec3 own_normal{0}, normal{0};
  TangentFrame frame{glm::vec3(0, 0, 1)};  // of cells that are cut one by one
  CellPolygon polygon;
  OtherSheets others;         // that neighbours are on
  std::size_t far_count = 0;  // of the sheet, places from farther away
  float neighbour_spacing = 0;
  bool was_touching = false;  // of the cell that was closed last
  float open = kOpen;         // the polygon begins as a square of twice that
  bool has_measures = false;
  std::array<float, SurfaceFitLanes::kLanes> sheet_thickness{};  // as of SurfaceCell
  std::array<bool, SurfaceFitLanes::kLanes> is_lone{};           // as of SurfaceCell
  std::array<bool, SurfaceFitLanes::kLanes> is_apart{};  // whether hardly any are on its sheet

  FlatNeighbour flatten(const glm::vec3& place) const {
    const glm::vec3 offset = place / unit;
    return {{glm::dot(offset, frame.tangent), glm::dot(offset, frame.bitangent)},
            glm::dot(offset, normal),
            0};
  }
  // Not around an edge, where the surface ends, nor on the other side of something thin.
  bool mayShareSheet(const Neighbour& n) const {
    const bool are_known = own_normal != glm::vec3(0) && n.normal != glm::vec3(0);
    return !are_known || glm::dot(n.normal, own_normal) >= kLeastCosine;
  }
  // Whether something within `radius` of this height does. Alone before a denser sheet, a place
  // must not take what that has farther away for its own.
  bool mayBeOwn(float above, float radius) const {
    return !is_apart[lane] ||
           (above - radius < .5f * others.above && -above - radius < .5f * others.below);
  }
  bool isLine() const { return fits.is_line[lane] > 0; }
  bool hasPlane() const { return !isLine() || own_normal != glm::vec3(0); }

  void begin(std::size_t of_lane);
  void begin();
  void cutByNeighbours();
  bool isLoose() const;
  bool isFull(const SurfaceCell& cell) const;
  bool isSparse();
  bool isLost() const;
  void measureSpacing();
  void flattenAll(std::span<const Neighbour> neighbours);
  bool isAmid(std::span<const Neighbour> neighbours) const;
  SurfaceCell cell() const;
  SurfaceCell cell(float area, const CellMoments& moments) const;
  void dropOthers();
  bool isSettled(float reach_sq) const {
    const float reach = places[lane].reach / unit;  // beyond which places are not known
    // Where all are, what is open reaches farther than any of them
    return 2 * std::sqrt(reach_sq) <= std::min(reach, kOpen);
  }
};

SurfaceCells::SurfaceCells() : scratch_(std::make_unique<Scratch>()) {}
SurfaceCells::SurfaceCells(SurfaceCells&&) noexcept = default;
SurfaceCells& SurfaceCells::operator=(SurfaceCells&&) noexcept = default;
SurfaceCells::~SurfaceCells() = default;

void SurfaceCells::fit(std::span<const CellPlace> places, bool with_normals) {
  SurfaceFitLanes& fits = scratch_->fits;
  fits.most_neighbours = 0;
  fits.with_quadrics = with_normals;
  scratch_->has_measures = false;
  for (std::size_t lane = 0; lane < SurfaceFitLanes::kLanes; ++lane) {
    const CellPlace place = lane < places.size() ? places[lane] : CellPlace();
    const std::size_t count = std::min(place.neighbours.size(), SurfaceFitLanes::kMostNeighbours);
    scratch_->places[lane] = place;
    fits.most_neighbours = std::max(fits.most_neighbours, count);
    fits.count[lane] = float(count);
    fits.unit[lane] = count > 0 ? glm::length(place.neighbours.back().offset) : 1;
    fits.own_x[lane] = place.normal.x;
    fits.own_y[lane] = place.normal.y;
    fits.own_z[lane] = place.normal.z;
    for (std::size_t i = 0; i < count; ++i) {
      const glm::vec3& offset = place.neighbours[i].offset;
      fits.x[i][lane] = offset.x, fits.y[i][lane] = offset.y, fits.z[i][lane] = offset.z;
    }
  }
  fastestSurfaceFitKernel().fit(fits);
}

SurfacePlane SurfaceCells::planeOf(std::size_t lane) const {
  const SurfaceFitLanes& fits = scratch_->fits;
  if (fits.count[lane] == 0) return {};
  SurfacePlane plane;
  plane.normal = {fits.surface_x[lane], fits.surface_y[lane], fits.surface_z[lane]};
  plane.confidence = fits.confidence[lane];
  plane.is_line = fits.is_line[lane] > 0;
  plane.thickness = fits.thickness[lane] / spacingOf(fits.count[lane]);
  return plane;
}

glm::vec3 SurfaceCells::heightOf(std::size_t lane) const {
  const SurfaceFitLanes& fits = scratch_->fits;
  return fits.surface_height[lane] * fits.unit[lane] * normalIn(fits, lane);
}

void SurfaceCells::Scratch::begin(std::size_t of_lane) {
  lane = of_lane;
  unit = fits.unit[lane];
  spacing = spacingOf(fits.count[lane]);
  own_normal = places[lane].normal;
  normal = normalIn(fits, lane);
  open = kOpen;
  begin();
}

void SurfaceCells::Scratch::begin() {
  polygon.begin(open);
  sharers = 1;
  cutters.clear();
  slopes_sq.clear();
  cutting.clear();
  sheet.clear();
  ends.clear();
  far_count = 0;
}

// Of the place's own sheet.
void SurfaceCells::Scratch::flattenAll(std::span<const Neighbour> neighbours) {
  const bool has_normal = own_normal != glm::vec3(0);
  flat.resize(neighbours.size());
  std::size_t count = 0;
  for (std::size_t i = 0; i < neighbours.size(); ++i) {
    if (has_normal && !mayShareSheet(neighbours[i])) continue;
    flat[count++] = {
        {fits.beside_u[i][lane], fits.beside_v[i][lane]}, fits.above[i][lane], std::uint32_t(i)};
  }
  flat.resize(count);
  // Without a gap below anything there are no other sheets
  others = {};
  if (fits.highest[lane] > kNarrowGap * spacing) {
    others = dropOtherSheets(spacing, has_normal, flat, heights);
  }
  is_apart[lane] = flat.size() < neighbours.size() / 6;
  const bool is_known = has_normal && flat.size() < neighbours.size();
  sheet_thickness[lane] = is_known ? spreadOf(flat) / spacingOf(float(flat.size())) : -1;
  is_lone[lane] = is_apart[lane] || (is_known && isAmid(neighbours));
}

// Whether neighbours that face elsewhere lie on both sides: around an edge they lie on one.
bool SurfaceCells::Scratch::isAmid(std::span<const Neighbour> neighbours) const {
  float low = 0, high = 0;
  for (std::size_t i = 0; i < neighbours.size(); ++i) {
    if (mayShareSheet(neighbours[i])) continue;
    low = std::min(low, fits.above[i][lane]), high = std::max(high, fits.above[i][lane]);
  }
  return std::min(-low, high) > kNarrowGap * spacing;
}

// Neighbours on other sheets are infinitely far.
void SurfaceCells::Scratch::dropOthers() {
  const bool may_have_sheets = fits.highest[lane] > kNarrowGap * spacing;
  sheet_thickness[lane] = -1;
  is_lone[lane] = is_apart[lane] = false;
  if (own_normal == glm::vec3(0) && !may_have_sheets) return;
  const std::size_t count = places[lane].neighbours.size();
  flattenAll(places[lane].neighbours);
  if (flat.size() == count) return;
  for (std::size_t i = 0; i < count; ++i) {
    fits.half_sq[i][lane] = kInfinity;
  }
  for (const FlatNeighbour& n : flat)
    fits.half_sq[n.index][lane] = 0.5f * glm::dot(n.beside, n.beside);
}

void SurfaceCells::measure() {
  Scratch& at = *scratch_;
  for (std::size_t lane = 0; lane < SurfaceFitLanes::kLanes; ++lane) {
    at.begin(lane);
    at.fits.coincident_half_sq[lane] =
        0.5f * (kCoincident * at.spacing) * (kCoincident * at.spacing);
    at.dropOthers();
  }
  fastestSurfaceFitKernel().measure(at.fits);
  at.has_measures = true;
}

// By those of the own sheet, which are flattened.
void SurfaceCells::Scratch::cutByNeighbours() {
  const float coincident_sq = (kCoincident * spacing) * (kCoincident * spacing);
  for (const FlatNeighbour& n : flat) {
    if (glm::dot(n.beside, n.beside) < coincident_sq) {
      ++sharers;
    } else if (polygon.cut(n.beside)) {
      cutters.push_back(n.beside);
      cutting.push_back(places[lane].neighbours[n.index]);
    }
  }
}

SurfaceCell SurfaceCells::cellOfNearest() {
  Scratch& at = *scratch_;
  at.begin(at.lane);
  at.flattenAll(at.places[at.lane].neighbours);
  at.cutByNeighbours();
  SurfaceCell cell = closed();
  if (at.is_apart[at.lane] || at.isLost()) {
    cell = at.cell(at.spacing * at.spacing, {.square = at.spacing * at.spacing / 6});
    cell.neighbour_spacing = at.spacing * at.unit;
  }
  cell.is_settled = false;
  return cell;
}

std::span<const Neighbour> SurfaceCells::cutters() {
  Scratch& at = *scratch_;
  at.bounding.clear();
  for (std::size_t i = 0; i < at.cutting.size(); ++i) {
    if (at.polygon.isOnSide(at.cutters[i])) at.bounding.push_back(at.cutting[i]);
  }
  return at.bounding;
}

bool SurfaceCells::isBeside(const Neighbour& place, const Neighbour& other) const {
  const FlatNeighbour flat = scratch_->flatten(other.offset - place.offset);
  return scratch_->mayShareSheet(other) && std::abs(flat.above) < kSteep * glm::length(flat.beside);
}

SurfaceCell SurfaceCells::cellOf(std::size_t lane) {
  Scratch& at = *scratch_;
  at.begin(lane);
  const CellPlace& place = at.places[lane];
  if (place.neighbours.empty()) return {};
  if (at.has_measures && at.fits.cell_is_cut[lane] > 0 &&
      at.isSettled(at.fits.cell_reach_sq[lane])) {
    const SurfaceFitLanes& fits = at.fits;
    at.sharers = fits.cell_sharers[lane];
    SurfaceCell cell =
        at.cell(fits.cell_area[lane],
                CellMoments::fromPlace({fits.cell_middle_u[lane], fits.cell_middle_v[lane]},
                                       fits.cell_square[lane], fits.cell_difference[lane],
                                       fits.cell_product[lane]));
    cell.is_settled = true;
    return cell;
  }
  at.frame = TangentFrame(at.normal);
  at.flattenAll(place.neighbours);
  at.cutByNeighbours();
  SurfaceCell cell = at.cell();
  cell.is_settled = !at.cutters.empty() && at.isSettled(at.polygon.reachSq());
  return cell;
}

float SurfaceCells::reach() const { return 2 * scratch_->polygon.reach() * scratch_->unit; }

bool SurfaceCells::isOpen() const { return scratch_->hasPlane() && !scratch_->cutters.empty(); }

bool SurfaceCells::isSparse() { return scratch_->isSparse(); }

// Surfels with a wrong normal agree by chance with others, far away, and with none beside them.
bool SurfaceCells::Scratch::isLost() const {
  const std::span<const Neighbour> neighbours = places[lane].neighbours;
  if (!is_lone[lane] || neighbours.size() < 3) return false;
  const float usual = glm::length(neighbours[2].offset) / unit;
  return cutters.empty() || nearestCutter(cutters) > kFarOff * usual;
}

bool SurfaceCells::isLost() const { return scratch_->isLost(); }

bool SurfaceCells::isOnRow() const {
  const Scratch& at = *scratch_;
  const std::span<const Neighbour> neighbours = at.places[at.lane].neighbours;
  return !neighbours.empty() && isRow(at.cutters, glm::length(neighbours.front().offset) / at.unit);
}

// How far the places that cut the cell are from others.
void SurfaceCells::Scratch::measureSpacing() {
  // The normal tells the sheet; without one a stray may have any
  const CellPlace& place = places[lane];
  const bool has_normal = own_normal != glm::vec3(0);
  sheet.resize(far_count);
  if (has_normal) {
    for (const FlatNeighbour& n : flat) sheet.push_back(place.neighbours[n.index]);
  } else {
    sheet.insert(sheet.end(), place.neighbours.begin(), place.neighbours.end());
  }
  const bool is_known = has_normal && !isLoose();
  neighbour_spacing = third_nearest.median(is_known ? cutting : sheet, sheet, unit);
}

// Whether places close by cannot tell the size of the cell: they are too few, or closer to each
// other than to the place.
bool SurfaceCells::Scratch::isSparse() {
  if (cutters.empty()) return true;
  measureSpacing();
  return sheet.size() <= 3 || nearestCutter(cutters) * unit > neighbour_spacing;
}

bool SurfaceCells::widen(float radius) {
  Scratch& at = *scratch_;
  if (!at.hasPlane() || !(radius > at.unit) || !at.was_touching) return false;
  if (!at.isSparse()) return false;
  at.open = kOpen * radius / at.unit;
  at.begin();
  at.cutByNeighbours();
  return true;
}

glm::vec3 SurfaceCells::farthestCorner() const {
  const Scratch& at = *scratch_;
  const std::span<const glm::vec2> corners = at.polygon.corners();
  const glm::vec2 corner = *std::max_element(corners.begin(), corners.end(), isNearer);
  return at.unit * (corner.x * at.frame.tangent + corner.y * at.frame.bitangent);
}

bool SurfaceCells::mayCut(const PlaceBounds& bounds) const {
  const Scratch& at = *scratch_;
  const bool is_known = at.own_normal != glm::vec3(0);
  if (is_known && bounds.mostCosine(at.own_normal) < kLeastCosine - kBoundsSlack) return false;
  const FlatNeighbour middle = at.flatten(bounds.centre);
  const float radius = bounds.radius / at.unit, beside = glm::length(middle.beside) + radius;
  const float above = std::abs(middle.above) - radius;
  const float slack = kBoundsSlack * (beside + above);
  return above <= kSteep * beside + slack && at.mayBeOwn(middle.above, radius + slack) &&
         !at.ends.areBefore(middle.beside, radius) && at.polygon.mayCut(middle.beside, radius);
}

bool SurfaceCells::wouldCut(const Neighbour& place) const {
  const Scratch& at = *scratch_;
  const FlatNeighbour flat = at.flatten(place.offset);
  return at.mayShareSheet(place) && std::abs(flat.above) < kSteep * glm::length(flat.beside) &&
         at.mayBeOwn(flat.above, 0) && !at.ends.areBefore(flat.beside, 0) &&
         at.polygon.wouldCut(flat.beside);
}

bool SurfaceCells::cut(const Neighbour& place) {
  Scratch& at = *scratch_;
  const FlatNeighbour flat = at.flatten(place.offset);
  if (!at.polygon.cut(flat.beside)) return false;
  at.cutters.push_back(flat.beside);
  at.cutting.push_back(place);
  at.sheet.resize(at.far_count);
  at.sheet.push_back(place);
  at.far_count = at.sheet.size();
  const float slope = flat.above / glm::length(flat.beside);
  at.slopes_sq.push_back(slope * slope);
  return true;
}

std::size_t SurfaceCells::endAt(std::span<const Neighbour> dense) {
  Scratch& at = *scratch_;
  const auto isDense = [&](const Neighbour& place) {
    return std::any_of(dense.begin(), dense.end(),
                       [&](const Neighbour& one) { return one.id == place.id; });
  };
  const float sharers = at.sharers;
  at.begin();
  at.sharers = sharers;
  std::sort(at.bounding.begin(), at.bounding.end(), [](const Neighbour& a, const Neighbour& b) {
    return glm::dot(a.offset, a.offset) < glm::dot(b.offset, b.offset);
  });
  for (const Neighbour& place : at.bounding) {
    if (!isDense(place)) cut(place);
  }
  for (const Neighbour& place : at.bounding) {
    const glm::vec2 end = at.flatten(place.offset).beside;
    // Halfway to what is twice as far away
    if (!isDense(place) || at.ends.areBefore(end, 0) || !at.polygon.cut(2.f * end)) continue;
    at.ends.add(end);
    at.cutters.push_back(2.f * end);
    at.cutting.push_back(place);
  }
  return at.ends.count();
}

SurfaceCell SurfaceCells::closed() {
  Scratch& at = *scratch_;
  at.was_touching = at.polygon.touches(at.open);
  const bool is_open =
      !at.cutters.empty() && (at.was_touching || at.isLoose() ||
                              at.polygon.reach() > kSpike * usualCutter(at.cutters, at.heights));
  if (is_open) {
    // One close by shares the cell rather than telling its size
    for (const glm::vec2& cutter : at.cutters) {
      if (glm::length(cutter) > kSharing * at.spacing) at.polygon.cut(-cutter);
    }
  }
  SurfaceCell cell = at.cell();
  cell.is_settled = !is_open;
  if (is_open) {
    at.measureSpacing();
    cell.neighbour_spacing = at.neighbour_spacing;
  }
  return cell;
}

SurfaceCell SurfaceCells::closedWide() {
  Scratch& at = *scratch_;
  SurfaceCell cell = at.cell();
  cell.is_settled = at.isFull(cell);
  return cell.is_settled ? cell : closed();
}

// Whether what cuts from farther away lies on a slope, as strays do.
bool SurfaceCells::Scratch::isLoose() const {
  const float sum = std::accumulate(slopes_sq.begin(), slopes_sq.end(), 0.f);
  return sum > kLooseSlope * kLooseSlope * float(slopes_sq.size());
}

// Whether places lie all around a cell that is cut by places near and far, as at the border of
// something dense. Across a hole in something dense cells are long.
bool SurfaceCells::Scratch::isFull(const SurfaceCell& cell) const {
  if (cutters.empty() || polygon.touches(open) || isLoose()) return false;
  return cell.long_side == glm::vec3(0) && polygon.isSurroundedBy(cutters);
}

SurfaceCell SurfaceCells::Scratch::cell() const {
  if (cutters.empty()) return {};
  // Of a line all that is known is a width: the piece is a square of it
  if (isLine() && polygon.touches(open)) {
    const float width = polygon.width(glm::normalize(cutters[0]));
    return cell(width * width, {.square = width * width / 6});
  }
  return cell(polygon.area(), polygon.moments());
}

SurfaceCell SurfaceCells::Scratch::cell(float area, const CellMoments& moments) const {
  SurfaceCell cell{.area = area / sharers * unit * unit, .sharers = sharers};
  // A disk's mean squared distance from its middle is half of its radius squared
  const float to_middle_sq = glm::dot(moments.middle, moments.middle);
  cell.radius = std::sqrt(2 * (moments.square + to_middle_sq)) * unit;
  const TangentFrame plane(normal);
  cell.middle = unit * (moments.middle.x * plane.tangent + moments.middle.y * plane.bitangent);
  const glm::vec2 side = sharers > 1 ? glm::vec2(0) : unit * moments.longSide(area);
  cell.long_side = side.x * plane.tangent + side.y * plane.bitangent;
  cell.sheet_thickness = sheet_thickness[lane];
  cell.is_lone = is_lone[lane];
  return cell;
}

}  // namespace surfeit
