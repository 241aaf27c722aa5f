// Fits in lanes, for one instruction set (surface_fits.cpp).
#if defined(SURFEIT_SURFACE_FITS_INL_H_) == defined(HWY_TARGET_TOGGLE)
#ifdef SURFEIT_SURFACE_FITS_INL_H_
#undef SURFEIT_SURFACE_FITS_INL_H_
#else
#define SURFEIT_SURFACE_FITS_INL_H_
#endif

#include <hwy/highway.h>

#include "core/spherical_harmonics.h"
#include "octree/neighbours/quadric_lanes-inl.h"
#include "octree/neighbours/surface_fits.h"

HWY_BEFORE_NAMESPACE();
namespace surfeit {
namespace HWY_NAMESPACE {
namespace {

// Places on a line have this part of their variance, at most, across it.
constexpr float kLineFlatness = 1e-4f;
// A plane is fitted again where what lies off it is more than this part of the spacing; then
// neighbours so many spacings off it count half.
constexpr float kThick = 0.1f, kHalfWeight = 0.2f;
constexpr int kSheetPasses = 6;

struct Vector3 {
  V x, y, z;
};
inline V Dot(const Vector3& a, const Vector3& b) {
  return hn::Add(hn::Add(hn::Mul(a.x, b.x), hn::Mul(a.y, b.y)), hn::Mul(a.z, b.z));
}
inline Vector3 Times(const Vector3& a, V factor) {
  return {hn::Mul(a.x, factor), hn::Mul(a.y, factor), hn::Mul(a.z, factor)};
}
inline Vector3 Where(M mask, const Vector3& yes, const Vector3& no) {
  return {hn::IfThenElse(mask, yes.x, no.x), hn::IfThenElse(mask, yes.y, no.y),
          hn::IfThenElse(mask, yes.z, no.z)};
}

// As core/tangent_frame.h.
struct Frame {
  Vector3 tangent, bitangent;

  explicit Frame(const Vector3& n) {
    const V one = Splat(1), sign = hn::CopySign(one, n.z);
    const V a = hn::Neg(hn::Div(one, hn::Add(sign, n.z))), b = Product(n.x, n.y, a);
    const V signed_x = hn::Mul(sign, n.x);
    tangent = {hn::Add(one, Product(signed_x, n.x, a)), hn::Mul(sign, b), hn::Neg(signed_x)};
    bitangent = {b, hn::Add(sign, Product(n.y, n.y, a)), hn::Neg(n.y)};
  }
};

// Jacobi's rotation in the plane of two axes, which takes their covariance away; `p_other` and
// `q_other` are their covariances with the third.
inline void Rotate(V& pp, V& qq, V& pq, V& p_other, V& q_other, Vector3& p_axis, Vector3& q_axis) {
  const M is_done = hn::Le(hn::Abs(pq), Splat(1e-20f));
  const V one = Splat(1);
  const V cotangent = hn::Div(hn::Sub(qq, pp), hn::IfThenElse(is_done, one, hn::Add(pq, pq)));
  const V root = hn::Sqrt(hn::Add(hn::Mul(cotangent, cotangent), one));
  const V tangent = hn::IfThenZeroElse(
      is_done, hn::Div(hn::CopySign(one, cotangent), hn::Add(hn::Abs(cotangent), root)));
  const V c = hn::Div(one, hn::Sqrt(hn::Add(hn::Mul(tangent, tangent), one)));
  const V s = hn::Mul(tangent, c);
  const V moved = hn::Mul(tangent, pq);
  pp = hn::Sub(pp, moved);
  qq = hn::Add(qq, moved);
  pq = hn::Zero(D());
  const auto turn = [&](V& p, V& q) {
    const V before = p;
    p = hn::Sub(hn::Mul(c, p), hn::Mul(s, q));
    q = hn::Add(hn::Mul(s, before), hn::Mul(c, q));
  };
  turn(p_other, q_other);
  turn(p_axis.x, q_axis.x);
  turn(p_axis.y, q_axis.y);
  turn(p_axis.z, q_axis.z);
}

struct Plane {
  Vector3 normal;
  V thickness, confidence;
  M is_line;
};

// The plane across the axis of the least variance. `sum`: of the weights.
inline Plane PlaneOf(V xx, V yy, V zz, V xy, V yz, V zx, V sum) {
  const D d;
  const V zero = hn::Zero(d), one = Splat(1);
  Vector3 a{one, zero, zero}, b{zero, one, zero}, c{zero, zero, one};
  constexpr int kSweeps = 4;  // until floats change no more
  for (int sweep = 0; sweep < kSweeps; ++sweep) {
    Rotate(xx, yy, xy, zx, yz, a, b);
    Rotate(xx, zz, zx, xy, yz, a, c);
    Rotate(yy, zz, yz, xy, zx, b, c);
  }
  const V least = hn::Min(hn::Min(xx, yy), zz), most = hn::Max(hn::Max(xx, yy), zz);
  const V middle = hn::Max(hn::Min(xx, yy), hn::Min(hn::Max(xx, yy), zz));
  const V all = hn::Add(hn::Add(xx, yy), zz);
  Plane plane;
  plane.normal = Where(hn::Le(xx, least), a, Where(hn::Le(yy, least), b, c));
  plane.normal = Times(plane.normal, hn::Div(one, hn::Sqrt(Dot(plane.normal, plane.normal))));
  plane.thickness = hn::Sqrt(hn::Div(hn::Max(least, zero), sum));
  const V confidence = hn::Sub(one, hn::Div(hn::Mul(Splat(3), least), all));
  plane.confidence = hn::IfThenElseZero(hn::Gt(all, zero), hn::Min(hn::Max(confidence, zero), one));
  plane.is_line = hn::Not(hn::Gt(middle, hn::Mul(Splat(kLineFlatness), most)));
  return plane;
}

// kStep places, from a lane on.
class Fit {
 public:
  Fit(SurfaceFitLanes& lanes, std::size_t lane) : at_(lanes), lane_(lane) {}

  void run() {
    begin();
    const V spacing = hn::Sqrt(hn::Div(Splat(kPi), hn::Add(At(at_.count + lane_), Splat(1))));
    const Plane plane = fitSheet(spacing);
    Put(plane.normal.x, at_.normal_x + lane_);
    Put(plane.normal.y, at_.normal_y + lane_);
    Put(plane.normal.z, at_.normal_z + lane_);
    Put(plane.thickness, at_.thickness + lane_);
    Put(plane.confidence, at_.confidence + lane_);
    Put(hn::IfThenElseZero(plane.is_line, Splat(1)), at_.is_line + lane_);
    fitQuadric(plane, spacing);
    flatten(plane);
  }

 private:
  // Offsets in units of the farthest, and weights of 1; neighbours beyond a lane's weigh nothing.
  void begin() {
    const V per_unit = hn::Div(Splat(1), At(at_.unit + lane_)), count = At(at_.count + lane_);
    for (std::size_t i = 0; i < at_.most_neighbours; ++i) {
      const M is_there = hn::Lt(Splat(float(i)), count);
      for (SurfaceFitLanes::Lanes* const column : {at_.x, at_.y, at_.z}) {
        float* const to = column[i] + lane_;
        Put(hn::IfThenElseZero(is_there, hn::Mul(At(to), per_unit)), to);
      }
      Put(hn::IfThenElseZero(is_there, Splat(1)), at_.weight[i] + lane_);
    }
  }

  Vector3 offset(std::size_t i) const {
    return {At(at_.x[i] + lane_), At(at_.y[i] + lane_), At(at_.z[i] + lane_)};
  }

  // The plane through the neighbours and the place itself, each with its weight.
  Plane fitPlane() const {
    const V zero = hn::Zero(D());
    V sum = Splat(1), x = zero, y = zero, z = zero;
    V xx = zero, yy = zero, zz = zero, xy = zero, yz = zero, zx = zero;
    for (std::size_t i = 0; i < at_.most_neighbours; ++i) {
      const Vector3 p = offset(i);
      const V weight = At(at_.weight[i] + lane_);
      const Vector3 w = Times(p, weight);
      sum = hn::Add(sum, weight);
      x = hn::Add(x, w.x), y = hn::Add(y, w.y), z = hn::Add(z, w.z);
      xx = hn::Add(xx, hn::Mul(w.x, p.x)), xy = hn::Add(xy, hn::Mul(w.x, p.y));
      yy = hn::Add(yy, hn::Mul(w.y, p.y)), yz = hn::Add(yz, hn::Mul(w.y, p.z));
      zz = hn::Add(zz, hn::Mul(w.z, p.z)), zx = hn::Add(zx, hn::Mul(w.z, p.x));
    }
    const Vector3 mean = Times({x, y, z}, hn::Div(Splat(1), sum));
    return PlaneOf(hn::Sub(xx, hn::Mul(x, mean.x)), hn::Sub(yy, hn::Mul(y, mean.y)),
                   hn::Sub(zz, hn::Mul(z, mean.z)), hn::Sub(xy, hn::Mul(x, mean.y)),
                   hn::Sub(yz, hn::Mul(y, mean.z)), hn::Sub(zx, hn::Mul(z, mean.x)), sum);
  }

  // The plane of the place's own sheet, where several lie close to each other: what lies off it
  // counts the less, again and again (Cauchy's weights).
  Plane fitSheet(V spacing) {
    Plane plane = fitPlane();
    const M is_thick = hn::Gt(plane.thickness, hn::Mul(Splat(kThick), spacing));
    if (hn::AllFalse(D(), is_thick)) return plane;
    const V per_width = hn::Div(Splat(1), hn::Mul(Splat(kHalfWeight), spacing));
    const V count = At(at_.count + lane_), one = Splat(1);
    for (int pass = 0; pass < kSheetPasses; ++pass) {
      const Vector3 across = Times(plane.normal, per_width);
      for (std::size_t i = 0; i < at_.most_neighbours; ++i) {
        const V above = Dot(offset(i), across);
        const V weight = hn::Div(one, hn::Add(one, hn::Mul(above, above)));
        const V all = hn::IfThenElse(is_thick, weight, one);
        Put(hn::IfThenElseZero(hn::Lt(Splat(float(i)), count), all), at_.weight[i] + lane_);
      }
      const Plane again = fitPlane();
      plane.normal = Where(is_thick, again.normal, plane.normal);
      plane.is_line = hn::Or(hn::And(is_thick, again.is_line), hn::AndNot(is_thick, plane.is_line));
    }
    return plane;
  }

  // The quadric over a plane that fits the neighbours and the place best (jets of order 2: Cazals
  // and Pouget 2005): places on one side alone do not turn it as they turn a plane. Neighbours
  // count by their weight and, with `is_narrow`, the less, the farther they are.
  Quadric quadric(const Vector3& normal, const Frame& frame, bool is_narrow) const {
    QuadricSums sums;
    for (std::size_t i = 0; i < at_.most_neighbours; ++i) {
      const Vector3 p = offset(i);
      V weight = At(at_.weight[i] + lane_);
      if (is_narrow) weight = hn::Mul(weight, NarrowWeight(Dot(p, p)));
      sums.add(Dot(p, frame.tangent), Dot(p, frame.bitangent), Dot(p, normal), weight);
    }
    return sums.solve();
  }

  // The normal of the surface at the place. Where there is no noise the nearest tell it best.
  void fitQuadric(const Plane& plane, V spacing) {
    Vector3 normal = plane.normal;
    if (at_.with_quadrics) {
      const Frame frame(plane.normal);
      Quadric found = quadric(plane.normal, frame, false);
      const M is_quiet = hn::Lt(found.noise, hn::Mul(Splat(kNoisy), spacing));
      if (!hn::AllFalse(D(), is_quiet)) {
        const Quadric narrow = quadric(plane.normal, frame, true);
        found.slope_u = hn::IfThenElse(is_quiet, narrow.slope_u, found.slope_u);
        found.slope_v = hn::IfThenElse(is_quiet, narrow.slope_v, found.slope_v);
      }
      const Vector3 u = Times(frame.tangent, found.slope_u);
      const Vector3 v = Times(frame.bitangent, found.slope_v);
      const Vector3 turned{hn::Sub(hn::Sub(normal.x, u.x), v.x),
                           hn::Sub(hn::Sub(normal.y, u.y), v.y),
                           hn::Sub(hn::Sub(normal.z, u.z), v.z)};
      const V length = hn::Sqrt(Dot(turned, turned));
      // Not where the slopes are no numbers, or too large
      const M is_found = hn::And(hn::Gt(length, hn::Zero(D())), hn::Lt(length, Splat(1e18f)));
      const M is_turned = hn::AndNot(plane.is_line, is_found);
      normal = Where(is_turned, Times(turned, hn::Div(Splat(1), length)), normal);
    }
    Put(normal.x, at_.surface_x + lane_);
    Put(normal.y, at_.surface_y + lane_);
    Put(normal.z, at_.surface_z + lane_);
  }

  // The neighbours beside the place and above it, by its own normal.
  void flatten(const Plane& plane) {
    const Vector3 own{At(at_.own_x + lane_), At(at_.own_y + lane_), At(at_.own_z + lane_)};
    const M is_given = hn::Gt(Dot(own, own), hn::Zero(D()));
    const Vector3 normal = Where(is_given, own, plane.normal);
    Put(normal.x, at_.own_x + lane_), Put(normal.y, at_.own_y + lane_);
    Put(normal.z, at_.own_z + lane_);
    const Frame frame(normal);
    const V count = At(at_.count + lane_);
    V highest = hn::Zero(D());
    for (std::size_t i = 0; i < at_.most_neighbours; ++i) {
      const Vector3 p = offset(i);
      const V above = Dot(p, normal), u = Dot(p, frame.tangent), v = Dot(p, frame.bitangent);
      const V half_sq = hn::Mul(Splat(0.5f), hn::Add(hn::Mul(u, u), hn::Mul(v, v)));
      Put(u, at_.beside_u[i] + lane_);
      Put(v, at_.beside_v[i] + lane_);
      Put(hn::IfThenElse(hn::Lt(Splat(float(i)), count), half_sq, hn::Inf(D())),
          at_.half_sq[i] + lane_);
      Put(above, at_.above[i] + lane_);
      highest = hn::Max(highest, hn::Abs(above));
    }
    Put(highest, at_.highest + lane_);
  }

  SurfaceFitLanes& at_;
  const std::size_t lane_;
};

void FitSurfaces(SurfaceFitLanes& lanes) {
  for (std::size_t lane = 0; lane < SurfaceFitLanes::kLanes; lane += kStep) Fit(lanes, lane).run();
}

}  // namespace
}  // namespace HWY_NAMESPACE
}  // namespace surfeit
HWY_AFTER_NAMESPACE();

#endif  // include guard of this instruction set
