// Sums over the pixels of a packet's rasters; for one instruction set (see packet_kernel-inl.h).
#if defined(SURFEIT_PACKET_INTEGRAL_INL_H_) == defined(HWY_TARGET_TOGGLE)
#ifdef SURFEIT_PACKET_INTEGRAL_INL_H_
#undef SURFEIT_PACKET_INTEGRAL_INL_H_
#else
#define SURFEIT_PACKET_INTEGRAL_INL_H_
#endif

#include <hwy/highway.h>

#include <array>
#include <cstddef>
#include <span>

#include "gather/packet_kernel.h"
#include "gather/packet_lanes-inl.h"

HWY_BEFORE_NAMESPACE();
namespace surfeit {
namespace HWY_NAMESPACE {
namespace {

void FinishFarField(const PacketCanvas& canvas) {
  const D d;
  const V one = Splat(1);
  const std::size_t pixel_count = canvas.geometry->pixels().size();
  const std::size_t pixel_floats = PacketCanvas::pixelFloats(canvas.has_color);
  for (std::size_t i = 0; i < pixel_count; ++i) {
    if (!(*canvas.is_face_used)[i * RasterGeometry::kFaces / pixel_count]) continue;
    for (std::size_t lane = 0; lane < kPacketReceivers; lane += kStep) {
      float* const pixel = canvas.pixels + i * pixel_floats + lane;
      const V room = hn::Load(d, pixel), layer = hn::Load(d, pixel + kPacketReceivers);
      const V total = hn::Sub(one, hn::NegMulAdd(room, layer, room));
      hn::Store(total, d, pixel);
      if (!canvas.has_color) continue;
      const V inverse = hn::Div(one, hn::Max(total, Splat(1e-20f)));
      for (std::size_t c = 3 * kPacketReceivers; c < pixel_floats; c += kPacketReceivers) {
        hn::Store(hn::Mul(hn::Load(d, pixel + c), inverse), d, pixel + c);
      }
    }
  }
}

// Sums over the pixels for some of the receivers.
class Integral {
 public:
  Integral(const PacketCanvas& canvas, const SharedFarField* far, std::size_t lane)
      : canvas_(canvas), far_(far), lane_(lane), receivers_(*canvas.lanes, lane) {
    weight_sum_ = covered_ = red_ = green_ = blue_ = hn::Zero(D());
  }

  void Add(std::size_t face, std::size_t first, std::size_t end) {
    const bool has_near = (*canvas_.is_face_used)[face];
    const bool has_far = far_ != nullptr && (*far_->canvas->is_face_used)[face];
    const V spherical = hn::IfThenElseZero(receivers_.spherical, Splat(1));
    for (std::size_t i = first; i < end; ++i) {
      const RasterGeometry::Pixel& pixel = canvas_.geometry->pixels()[i];
      const V cosine = hn::Max(spherical, Dot(receivers_.normal, pixel.direction));
      const V weight = hn::Mul(cosine, Splat(pixel.solid_angle));
      weight_sum_ = hn::Add(weight_sum_, weight);
      if (has_near || has_far) AddPixel(i, weight, has_near, has_far);
    }
  }

  void Store(std::array<std::array<float, kPacketReceivers>, 4>& out) const {
    const D d;
    const V inverse = hn::Div(Splat(1), weight_sum_);
    hn::Store(hn::Mul(covered_, inverse), d, out[0].data() + lane_);
    hn::Store(hn::Mul(red_, inverse), d, out[1].data() + lane_);
    hn::Store(hn::Mul(green_, inverse), d, out[2].data() + lane_);
    hn::Store(hn::Mul(blue_, inverse), d, out[3].data() + lane_);
  }

 private:
  void AddPixel(std::size_t i, V weight, bool has_near, bool has_far) {
    const D d;
    const V zero = hn::Zero(d), one = Splat(1);
    const std::size_t pixel_floats = PacketCanvas::pixelFloats(canvas_.has_color);
    V room = one, layer = zero, end = zero;
    if (has_near) {
      const float* const near = canvas_.pixels + i * pixel_floats + lane_;
      room = hn::Load(d, near);
      layer = hn::Load(d, near + kPacketReceivers);
      end = hn::Load(d, near + 2 * kPacketReceivers);
      if (canvas_.has_color) {
        red_ = hn::MulAdd(weight, hn::Load(d, near + 3 * kPacketReceivers), red_);
        green_ = hn::MulAdd(weight, hn::Load(d, near + 4 * kPacketReceivers), green_);
        blue_ = hn::MulAdd(weight, hn::Load(d, near + 5 * kPacketReceivers), blue_);
      }
    }
    // The far field comes last, as one contribution: a surface that reaches it goes on there
    const float* far = nullptr;
    if (has_far) far = far_->canvas->pixels + i * pixel_floats + far_->lane;
    if (has_far && *far > 0) {
      const V amount = Splat(*far);
      const M is_new = hn::Gt(Splat(far_->distance), end);
      room = hn::IfThenElse(is_new, hn::NegMulAdd(room, layer, room), room);
      layer = hn::IfThenZeroElse(is_new, layer);
      const V after = hn::Min(hn::Add(layer, amount), one);
      if (canvas_.has_color) {
        const V added = hn::Mul(weight, hn::Mul(room, hn::Sub(after, layer)));
        red_ = hn::MulAdd(added, Splat(far[3 * kPacketReceivers]), red_);
        green_ = hn::MulAdd(added, Splat(far[4 * kPacketReceivers]), green_);
        blue_ = hn::MulAdd(added, Splat(far[5 * kPacketReceivers]), blue_);
      }
      layer = after;
    }
    const V total = hn::Sub(one, hn::NegMulAdd(room, layer, room));
    covered_ = hn::MulAdd(weight, total, covered_);
  }

  const PacketCanvas& canvas_;
  const SharedFarField* const far_;
  const std::size_t lane_;
  const Receivers receivers_;
  V weight_sum_, covered_, red_, green_, blue_;
};

// As ReceiverRaster::integrate.
void Integrate(const PacketCanvas& canvas, const SharedFarField* far,
               std::span<GatherResult> results) {
  const std::size_t face_pixels = canvas.geometry->pixels().size() / RasterGeometry::kFaces;
  alignas(64) std::array<std::array<float, kPacketReceivers>, 4> out;
  for (std::size_t lane = 0; lane < kPacketReceivers; lane += kStep) {
    Integral integral(canvas, far, lane);
    for (std::size_t face = 0; face < RasterGeometry::kFaces; ++face) {
      integral.Add(face, face * face_pixels, (face + 1) * face_pixels);
    }
    integral.Store(out);
  }
  for (std::size_t i = 0; i < results.size(); ++i) {
    results[i] = {out[0][i], {out[1][i], out[2][i], out[3][i]}};
  }
}

}  // namespace
}  // namespace HWY_NAMESPACE
}  // namespace surfeit
HWY_AFTER_NAMESPACE();

#endif  // per-target guard
