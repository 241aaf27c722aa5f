// Quadrics through places, in lanes, for one instruction set (surface_fits.cpp).
#if defined(SURFEIT_QUADRIC_LANES_INL_H_) == defined(HWY_TARGET_TOGGLE)
#ifdef SURFEIT_QUADRIC_LANES_INL_H_
#undef SURFEIT_QUADRIC_LANES_INL_H_
#else
#define SURFEIT_QUADRIC_LANES_INL_H_
#endif

#include <hwy/highway.h>

#include "core/spherical_harmonics.h"
#include "octree/neighbours/surface_fits.h"

HWY_BEFORE_NAMESPACE();
namespace surfeit {
namespace HWY_NAMESPACE {
namespace {

namespace hn = hwy::HWY_NAMESPACE;

using D = hn::CappedTag<float, SurfaceFitLanes::kLanes>;
using V = hn::Vec<D>;
using M = hn::Mask<D>;
constexpr std::size_t kStep = hn::MaxLanes(D());

inline V Splat(float value) { return hn::Set(D(), value); }
inline V At(const float* lanes) { return hn::Load(D(), lanes); }
inline void Put(V value, float* lanes) { hn::Store(value, D(), lanes); }
inline V Product(V a, V b, V c) { return hn::Mul(hn::Mul(a, b), c); }

// Places that lie this far off their surface, in spacings, are noisy.
constexpr float kNoisy = 0.1f;

struct Quadric {
  V height, slope_u, slope_v;  // at the origin
  V noise;                     // what lies off it, root mean square
};

// What a place counts where the nearest count most: (1 - d^2)^4.
inline V NarrowWeight(V distance_sq) {
  const V near = hn::Max(hn::Sub(Splat(1), distance_sq), hn::Zero(D()));
  const V square = hn::Mul(near, near);
  return hn::Mul(square, square);
}

// The quadric of least squares through places (u, v) of some height, and through the origin.
class QuadricSums {
 public:
  QuadricSums() : s_(Splat(1)) {}

  void add(V u, V v, V h, V weight) {
    const V wu = hn::Mul(weight, u), wv = hn::Mul(weight, v), wh = hn::Mul(weight, h);
    const V wuu = hn::Mul(wu, u), wuv = hn::Mul(wu, v), wvv = hn::Mul(wv, v);
    const V uu = hn::Mul(u, u), uv = hn::Mul(u, v), vv = hn::Mul(v, v);
    sum(s_, weight), sum(u_, wu), sum(v_, wv), sum(uu_, wuu), sum(uv_, wuv), sum(vv_, wvv);
    sum(uuu_, hn::Mul(wuu, u)), sum(uuv_, hn::Mul(wuu, v));
    sum(uvv_, hn::Mul(wvv, u)), sum(vvv_, hn::Mul(wvv, v));
    sum(u4_, hn::Mul(wuu, uu)), sum(u3v_, hn::Mul(wuu, uv)), sum(u2v2_, hn::Mul(wuu, vv));
    sum(uv3_, hn::Mul(wuv, vv)), sum(v4_, hn::Mul(wvv, vv));
    sum(h_, wh), sum(hu_, hn::Mul(wh, u)), sum(hv_, hn::Mul(wh, v)), sum(hh_, hn::Mul(wh, h));
    sum(huu_, hn::Mul(wh, uu)), sum(huv_, hn::Mul(wh, uv)), sum(hvv_, hn::Mul(wh, vv));
  }

  // By L D L^T, of a matrix that is positive definite when its diagonal is a little larger.
  Quadric solve() const {
    V matrix[kTerms][kTerms] = {
        {s_, uu_, uv_, vv_, u_, v_},          {uu_, u4_, u3v_, u2v2_, uuu_, uuv_},
        {uv_, u3v_, u2v2_, uv3_, uuv_, uvv_}, {vv_, u2v2_, uv3_, v4_, uvv_, vvv_},
        {u_, uuu_, uuv_, uvv_, uu_, uv_},     {v_, uuv_, uvv_, vvv_, uv_, vv_}};
    V right[kTerms] = {h_, huu_, huv_, hvv_, hu_, hv_};
    V trace = s_;
    for (int i = 1; i < kTerms; ++i) trace = hn::Add(trace, matrix[i][i]);
    const V more = hn::Mul(Splat(1e-6f), trace);
    for (int i = 0; i < kTerms; ++i) matrix[i][i] = hn::Add(matrix[i][i], more);
    V explained = hn::Zero(D());
    for (int i = 0; i < kTerms; ++i) {
      const V pivot = hn::Max(matrix[i][i], hn::Mul(Splat(1e-3f), more));  // 0 but for rounding
      const V per_pivot = hn::Div(Splat(1), pivot);
      explained = hn::Add(explained, hn::Mul(hn::Mul(right[i], right[i]), per_pivot));
      for (int j = i + 1; j < kTerms; ++j) {
        const V factor = hn::Mul(matrix[i][j], per_pivot);
        for (int k = j; k < kTerms; ++k) {
          matrix[j][k] = hn::Sub(matrix[j][k], hn::Mul(factor, matrix[i][k]));
        }
        right[j] = hn::Sub(right[j], hn::Mul(factor, right[i]));
      }
      matrix[i][i] = per_pivot;
    }
    V found[kTerms];
    for (int i = kTerms - 1; i >= 0; --i) {
      V rest = right[i];
      for (int j = i + 1; j < kTerms; ++j) rest = hn::Sub(rest, hn::Mul(matrix[i][j], found[j]));
      found[i] = hn::Mul(rest, matrix[i][i]);
    }
    const V off = hn::Max(hn::Sub(hh_, explained), hn::Zero(D()));
    return {found[0], found[4], found[5], hn::Sqrt(hn::Div(off, s_))};
  }

 private:
  static constexpr int kTerms = 6;

  static void sum(V& to, V value) { to = hn::Add(to, value); }

  // Sums of u^i v^j, and of these times the height
  V s_, u_ = hn::Zero(D()), v_ = u_, uu_ = u_, uv_ = u_, vv_ = u_;
  V uuu_ = u_, uuv_ = u_, uvv_ = u_, vvv_ = u_;
  V u4_ = u_, u3v_ = u_, u2v2_ = u_, uv3_ = u_, v4_ = u_;
  V h_ = u_, hu_ = u_, hv_ = u_, huu_ = u_, huv_ = u_, hvv_ = u_, hh_ = u_;
};

// How high above places the surface lies that their sheets scatter about, by the neighbours in the
// own planes' frames. Zero where they hardly scatter, or all around.
inline void FindHeights(SurfaceFitLanes& lanes, std::size_t lane) {
  const V spacing = hn::Sqrt(hn::Div(Splat(kPi), hn::Add(At(lanes.count + lane), Splat(1))));
  const V least = hn::Mul(Splat(kNoisy), spacing), most = hn::Mul(Splat(kThinThickness), spacing);
  Put(hn::Zero(D()), lanes.surface_height + lane);
  if (hn::AllFalse(D(), hn::Gt(At(lanes.highest + lane), least))) return;
  QuadricSums sums;
  for (std::size_t i = 0; i < lanes.most_neighbours; ++i) {
    const M counts = hn::Lt(At(lanes.half_sq[i] + lane), hn::Inf(D()));
    sums.add(At(lanes.beside_u[i] + lane), At(lanes.beside_v[i] + lane), At(lanes.above[i] + lane),
             hn::IfThenElseZero(counts, Splat(1)));
  }
  const Quadric found = sums.solve();
  const M scatters = hn::And(hn::Ge(found.noise, least), hn::Lt(found.noise, most));
  Put(hn::IfThenElseZero(scatters, found.height), lanes.surface_height + lane);
}

}  // namespace
}  // namespace HWY_NAMESPACE
}  // namespace surfeit
HWY_AFTER_NAMESPACE();

#endif  // include guard of this instruction set
