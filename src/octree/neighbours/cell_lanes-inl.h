// Cells of many places at once, a place in each lane, for one instruction set (surface_fits.cpp).
#if defined(SURFEIT_CELL_LANES_INL_H_) == defined(HWY_TARGET_TOGGLE)
#ifdef SURFEIT_CELL_LANES_INL_H_
#undef SURFEIT_CELL_LANES_INL_H_
#else
#define SURFEIT_CELL_LANES_INL_H_
#endif

#include <hwy/highway.h>

#include "octree/neighbours/surface_fits-inl.h"
#include "octree/neighbours/surface_fits.h"

HWY_BEFORE_NAMESPACE();
namespace surfeit {
namespace HWY_NAMESPACE {
namespace {

// The cells of kStep places, from a lane on. The side of a cell that a neighbour n makes lies on
// the line n / 2 + t (-n.v, n.u), between the t where others' sides begin: no corners are kept,
// and nothing branches on one place.
class CellLanes {
 public:
  CellLanes(SurfaceFitLanes& lanes, std::size_t lane) : at_(lanes), lane_(lane) {}

  void run() {
    begin();
    for (std::size_t k = 0; k < sides_; ++k) addSide(k);
    const V area = hn::Mul(Splat(0.5f), twice_area_);
    Put(area, at_.cell_area + lane_);
    const V six = hn::Mul(Splat(6), area), twelve = hn::Mul(Splat(12), area);
    Put(hn::Div(middle_u_, six), at_.cell_middle_u + lane_);
    Put(hn::Div(middle_v_, six), at_.cell_middle_v + lane_);
    Put(hn::Div(squares_, twelve), at_.cell_square + lane_);
    Put(hn::Div(differences_, twelve), at_.cell_difference + lane_);
    Put(hn::Div(products_, twelve), at_.cell_product + lane_);
    Put(reach_sq_, at_.cell_reach_sq + lane_);
    Put(sharers_, at_.cell_sharers + lane_);
    Put(is_cut_, at_.cell_is_cut + lane_);
  }

 private:
  static constexpr std::size_t kFrame = 4;
  static constexpr float kFar = 1e18f;

  // The sides of the first square, as if of neighbours, then those of neighbours that count.
  void begin() {
    const float side = 2 * SurfaceFitLanes::kOpen;
    const float frame[kFrame][2] = {{side, 0}, {0, side}, {-side, 0}, {0, -side}};
    for (std::size_t k = 0; k < kFrame; ++k) {
      u_[k] = Splat(frame[k][0]), v_[k] = Splat(frame[k][1]);
      half_sq_[k] = Splat(0.5f * side * side);
    }
    sides_ = kFrame + at_.most_neighbours;
    const V coincident = At(at_.coincident_half_sq + lane_);
    for (std::size_t i = 0; i < at_.most_neighbours; ++i) {
      const V half_sq = At(at_.half_sq[i] + lane_);
      const M shares = hn::Lt(half_sq, coincident);
      const M counts = hn::And(hn::Not(shares), hn::Lt(half_sq, Splat(kFar)));
      sharers_ = hn::Add(sharers_, hn::IfThenElseZero(shares, Splat(1)));
      u_[kFrame + i] = hn::IfThenElseZero(counts, At(at_.beside_u[i] + lane_));
      v_[kFrame + i] = hn::IfThenElseZero(counts, At(at_.beside_v[i] + lane_));
      half_sq_[kFrame + i] = hn::IfThenElse(counts, half_sq, Splat(kFar));
    }
  }

  // Cuts the line of a neighbour by all others, and adds what is left to the sums.
  void addSide(std::size_t k) {
    const M counts = hn::Lt(half_sq_[k], Splat(kFar));
    V low = Splat(-kFar), high = hn::IfThenElse(counts, Splat(kFar), low);
    // Of two neighbours at one place the first has the side
    const V less = hn::Mul(Splat(1e-7f), half_sq_[k]);
    cutBy(0, k, k, less, low, high);
    cutBy(k + 1, sides_, k, hn::Neg(less), low, high);
    const M is_side = hn::Gt(high, low);
    if (hn::AllFalse(D(), is_side)) return;
    low = hn::IfThenElseZero(is_side, low), high = hn::IfThenElseZero(is_side, high);

    // Twice the triangle from the place to its two ends, and the squared lengths to these
    const V half_sq = half_sq_[k];
    const V twice = hn::IfThenElseZero(is_side, hn::Mul(half_sq, hn::Sub(high, low)));
    const V low_sq = hn::Mul(low, low), high_sq = hn::Mul(high, high);
    const V most_sq = hn::Max(low_sq, high_sq);
    const V ends = hn::Add(hn::Add(low_sq, hn::Mul(low, high)), high_sq);
    const V squares = hn::Mul(half_sq, hn::Add(Splat(1.5f), hn::Mul(Splat(2), ends)));
    const V far_sq = hn::Mul(half_sq, hn::Add(Splat(0.5f), hn::Mul(Splat(2), most_sq)));
    twice_area_ = hn::Add(twice_area_, twice);
    squares_ = hn::Add(squares_, hn::Mul(twice, squares));
    addShape(k, twice, hn::Add(low, high), ends);
    reach_sq_ = hn::Max(reach_sq_, hn::IfThenElseZero(is_side, far_sq));
    if (k >= kFrame) is_cut_ = hn::IfThenElse(is_side, Splat(1), is_cut_);
  }

  // What the triangle of `twice` the area adds to the other moments: its ends are at t that have
  // this sum, and squares with their product that add up to `ends`.
  void addShape(std::size_t k, V twice, V sum, V ends) {
    const V u = u_[k], v = v_[k];
    middle_u_ = hn::Add(middle_u_, hn::Mul(twice, hn::Sub(u, hn::Mul(v, sum))));
    middle_v_ = hn::Add(middle_v_, hn::Mul(twice, hn::Add(v, hn::Mul(u, sum))));
    const V rest = hn::Sub(Splat(0.75f), ends);
    const V u_v = hn::Mul(u, v), squares = hn::Sub(hn::Mul(u, u), hn::Mul(v, v));
    const V difference = hn::Sub(hn::Mul(squares, rest), hn::Mul(Splat(3), hn::Mul(u_v, sum)));
    const V product = hn::Add(hn::Mul(u_v, rest), hn::Mul(Splat(0.75f), hn::Mul(squares, sum)));
    differences_ = hn::Add(differences_, hn::Mul(twice, difference));
    products_ = hn::Add(products_, hn::Mul(twice, product));
  }

  // Keeps the part of the line of `k` that is nearer to the place than to others.
  void cutBy(std::size_t begin, std::size_t end, std::size_t k, V less, V& low, V& high) const {
    const V u = u_[k], v = v_[k];
    const V half_u = hn::Mul(Splat(0.5f), u), half_v = hn::Mul(Splat(0.5f), v);
    const V zero = hn::Zero(D()), far = Splat(kFar), near = Splat(-kFar);
    for (std::size_t j = begin; j < end; ++j) {
      // -0 would turn the sign of the quotient
      const V across = hn::Add(hn::Sub(hn::Mul(u, v_[j]), hn::Mul(v, u_[j])), zero);
      const V along = hn::Add(hn::Mul(half_u, u_[j]), hn::Mul(half_v, v_[j]));
      const V t = hn::Div(hn::Sub(hn::Sub(half_sq_[j], along), less), across);
      const M is_above = hn::Ge(across, zero);
      high = hn::Min(high, hn::IfThenElse(is_above, t, far));
      low = hn::Max(low, hn::IfThenElse(is_above, near, t));
      if (j % 4 == 3 && hn::AllTrue(D(), hn::Le(high, low))) return;
    }
  }

  SurfaceFitLanes& at_;
  const std::size_t lane_;
  std::size_t sides_ = 0;
  V u_[kFrame + SurfaceFitLanes::kMostNeighbours], v_[kFrame + SurfaceFitLanes::kMostNeighbours];
  V half_sq_[kFrame + SurfaceFitLanes::kMostNeighbours];
  V twice_area_ = hn::Zero(D()), squares_ = hn::Zero(D()), reach_sq_ = hn::Zero(D());
  V differences_ = hn::Zero(D()), products_ = hn::Zero(D());
  V middle_u_ = hn::Zero(D()), middle_v_ = hn::Zero(D());
  V sharers_ = Splat(1), is_cut_ = hn::Zero(D());
};

void MeasureCells(SurfaceFitLanes& lanes) {
  for (std::size_t lane = 0; lane < SurfaceFitLanes::kLanes; lane += kStep) {
    FindHeights(lanes, lane);
    CellLanes(lanes, lane).run();
  }
}

}  // namespace
}  // namespace HWY_NAMESPACE
}  // namespace surfeit
HWY_AFTER_NAMESPACE();

#endif  // include guard of this instruction set
