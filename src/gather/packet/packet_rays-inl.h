// What rays from some receivers meet of near spheres, disks and pieces of ribbons; for one
// instruction set (see packet_kernel-inl.h).
#if defined(SURFEIT_PACKET_RAYS_INL_H_) == defined(HWY_TARGET_TOGGLE)
#ifdef SURFEIT_PACKET_RAYS_INL_H_
#undef SURFEIT_PACKET_RAYS_INL_H_
#else
#define SURFEIT_PACKET_RAYS_INL_H_
#endif

#include <hwy/highway.h>

#include <glm/geometric.hpp>
#include <glm/vec3.hpp>

#include "core/ribbon.h"
#include "gather/packet/packet_lanes-inl.h"

HWY_BEFORE_NAMESPACE();
namespace surfeit {
namespace HWY_NAMESPACE {
namespace {

// How much of a ray's pixel the sphere covers, all or nothing.
inline V SphereAmount(const Patch& patch, const glm::vec3& ray, const V3& centre, V centre_sq) {
  const V along = Dot(centre, ray);
  const V power = hn::Sub(centre_sq, Splat(patch.radius * patch.radius));
  const M hit = hn::And(hn::Gt(along, hn::Zero(D())), hn::Ge(hn::Mul(along, along), power));
  return hn::IfThenElseZero(hit, Splat(1));
}

// How far along the ray its plane is; `normal`: of the world, or in the frames of the lanes.
inline V PlaneDistance(const glm::vec3& normal, const glm::vec3& ray, V c_n) {
  const float d_n = glm::dot(ray, normal);
  return hn::Mul(c_n, Splat(1 / (d_n != 0 ? d_n : 1e-20f)));
}
inline V PlaneDistance(const V3& normal, const glm::vec3& ray, V c_n) {
  const V d_n = Dot(normal, ray);
  return hn::Div(c_n, hn::IfThenElse(hn::Eq(d_n, hn::Zero(D())), Splat(1e-20f), d_n));
}

// How much of the ray's pixel the soft disk covers; zero where the ray misses it.
template <typename Vector>
V DiskAmount(const Patch& patch, const Vector& normal, const glm::vec3& ray, const V3& centre,
             V c_n, V centre_sq) {
  const V t = PlaneDistance(normal, ray, c_n);
  const V along = Dot(centre, ray);
  const V miss_sq = hn::MulAdd(t, hn::NegMulAdd(Splat(2), along, t), centre_sq);
  const V part_sq = hn::Mul(miss_sq, Splat(1 / (patch.radius * patch.radius)));
  const V peak = Splat(patch.soft_peak);
  const V amount = hn::Min(Splat(1), hn::NegMulAdd(peak, part_sq, peak));
  return hn::IfThenElseZero(hn::Gt(t, hn::Zero(D())), hn::Max(amount, hn::Zero(D())));
}

// The rectangle of a ribbon: pixels by the part of them that lies within. Axes are vectors of the
// world, or in the frames of the lanes.
template <typename Vector>
class RibbonRays {
  static constexpr float kLeastSineSq = 1e-6f;

 public:
  // `centre`: from where rays begin; `c_n`: it times the normal.
  RibbonRays(const V3& centre, V c_n, const Vector& normal, const Vector& along,
             const Vector& across, const Ribbon& ribbon, float half_pixel)
      : normal_(normal),
        along_{along, Dot(centre, along), Splat(0.5f * ribbon.length)},
        across_{across, Dot(centre, across), Splat(0.5f * ribbon.width)},
        c_n_(c_n),
        half_pixel_(Splat(half_pixel)) {}

  // How much of the pixel around the ray lies within.
  V Amount(const glm::vec3& ray) const {
    const V t = PlaneDistance(normal_, ray, c_n_);
    const V size = hn::Mul(t, half_pixel_);
    const V amount = hn::Mul(Part(along_, ray, t, size), Part(across_, ray, t, size));
    return hn::IfThenElseZero(hn::Gt(t, hn::Zero(D())), amount);
  }

 private:
  struct Side {
    Vector axis;
    V middle, half;
  };
  static V Cosine(const glm::vec3& axis, const glm::vec3& ray) {
    return Splat(glm::dot(axis, ray));
  }
  static V Cosine(const V3& axis, const glm::vec3& ray) { return Dot(axis, ray); }

  // How much of a pixel lies within a side. What covers `size` across a ray reaches the farther
  // along the side, the smaller its angle to the ray.
  static V Part(const Side& side, const glm::vec3& ray, V t, V size) {
    const V one = Splat(1), cosine = Cosine(side.axis, ray);
    const V sine_sq = hn::Max(hn::NegMulAdd(cosine, cosine, one), Splat(kLeastSineSq));
    const V foot = hn::Mul(size, InverseSqrt(sine_sq));
    const V x = hn::MulSub(t, cosine, side.middle);
    const V within = hn::Sub(hn::Min(hn::Add(x, foot), side.half),
                             hn::Max(hn::Sub(x, foot), hn::Neg(side.half)));
    const V part = hn::Div(within, hn::Max(hn::Add(foot, foot), Splat(1e-30f)));
    return hn::Min(one, hn::Max(hn::Zero(D()), part));
  }

  Vector normal_;
  Side along_, across_;
  V c_n_, half_pixel_;
};

}  // namespace
}  // namespace HWY_NAMESPACE
}  // namespace surfeit
HWY_AFTER_NAMESPACE();

#endif  // per-target guard
