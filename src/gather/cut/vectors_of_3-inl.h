// Vectors of the plain three dimensions, one in each lane; for one instruction set.
#if defined(SURFEIT_VECTORS_OF_3_INL_H_) == defined(HWY_TARGET_TOGGLE)
#ifdef SURFEIT_VECTORS_OF_3_INL_H_
#undef SURFEIT_VECTORS_OF_3_INL_H_
#else
#define SURFEIT_VECTORS_OF_3_INL_H_
#endif

#include <hwy/highway.h>

#include <glm/vec3.hpp>

HWY_BEFORE_NAMESPACE();
namespace surfeit {
namespace HWY_NAMESPACE {
namespace {

template <typename V>
struct VectorsOf3 {
  V x, y, z;
};

namespace hn = hwy::HWY_NAMESPACE;

template <typename V>
HWY_INLINE V Dot(const VectorsOf3<V>& a, const VectorsOf3<V>& b) {
  return hn::MulAdd(a.x, b.x, hn::MulAdd(a.y, b.y, hn::Mul(a.z, b.z)));
}
// With the same one in all lanes.
template <typename V>
HWY_INLINE V Dot(const VectorsOf3<V>& a, const glm::vec3& b) {
  const hn::DFromV<V> d;
  return Dot(a, VectorsOf3<V>{hn::Set(d, b.x), hn::Set(d, b.y), hn::Set(d, b.z)});
}

}  // namespace
}  // namespace HWY_NAMESPACE
}  // namespace surfeit
HWY_AFTER_NAMESPACE();

#endif  // per-target guard
