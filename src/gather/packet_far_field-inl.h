// Makes a drawn canvas the far fields of packets; for one instruction set (see
// packet_kernel-inl.h).
#if defined(SURFEIT_PACKET_FAR_FIELD_INL_H_) == defined(HWY_TARGET_TOGGLE)
#ifdef SURFEIT_PACKET_FAR_FIELD_INL_H_
#undef SURFEIT_PACKET_FAR_FIELD_INL_H_
#else
#define SURFEIT_PACKET_FAR_FIELD_INL_H_
#endif

#include <hwy/highway.h>

#include <array>
#include <cstddef>
#include <cstring>

#include "gather/packet_fill-inl.h"
#include "gather/packet_kernel.h"
#include "gather/packet_lanes-inl.h"

HWY_BEFORE_NAMESPACE();
namespace surfeit {
namespace HWY_NAMESPACE {
namespace {

// One face of them.
class FarFace {
 public:
  FarFace(const PacketCanvas& canvas, std::size_t face)
      : canvas_(canvas),
        seen_(canvas.seen->faces[face]),
        size_(std::size_t(canvas.geometry->resolution())),
        face_(face),
        channels_(PacketCanvas::channels(*canvas.rules)),
        has_light_(canvas.rules->hasLight()) {
    for (std::size_t lane = 0; lane < canvas.receiver_count; lane += kStep) {
      pixels_[lane / kStep] = FaceLanes(canvas.pixels, canvas, face, lane, channels_);
      thickets_[lane / kStep] = FaceLanes(canvas.thickets, canvas, face, lane, 1);
      begins_[lane / kStep] = FaceLanes(canvas.begins, canvas, face, lane, 1);
    }
  }

  // Covers gaps, as in what is drawn for a packet: they would change from place to place. The
  // coverage comes in place of the room, and colors and thickets are scaled by how much it grew.
  void Fill() const {
    for (std::size_t lane = 0; lane < canvas_.receiver_count; lane += kStep) FillLanes(lane);
  }

  void Store(const FarFieldSlopes& slopes, FarPixel* pixels) const {
    const std::size_t count = canvas_.geometry->pixels().size();
    seen_.forEachPixel(size_, [&](std::size_t in_face) HWY_ATTR {
      StorePixel(in_face, slopes, pixels + face_ * size_ * size_ + in_face, count);
    });
  }

 private:
  // Of a pixel, FarPixel::Sight lane after lane: of the packets, and its change along two axes.
  static constexpr std::size_t kSightFloats = sizeof(FarPixel::Sight) / sizeof(float);
  static_assert(kSightFloats == 4);
  struct alignas(64) Sights {
    float of[3][kSightFloats * kPacketReceivers];
  };
  using LanesOfAll = std::array<FaceLanes, kPacketReceivers / kStep>;
  static void Copy(const float* lane, FarPixel::Sight& to) { std::memcpy(&to, lane, sizeof(to)); }
  // Of one receiver.
  static float ValueOf(const LanesOfAll& lanes, std::size_t in_face, std::size_t i,
                       std::size_t channel = 0) {
    return lanes[i / kStep].at(in_face)[channel * kStep + i % kStep];
  }

  void FillLanes(std::size_t lane) const {
    const D d;
    const V zero = hn::Zero(d), one = Splat(1), least = Splat(1e-20f);
    const FaceLanes &pixels = pixels_[lane / kStep], &thickets = thickets_[lane / kStep];
    const SurfaceFill fill(canvas_, seen_, bool(thickets));
    fill.Run([&](std::size_t i) HWY_ATTR {
      float* const pixel = pixels.at(i);
      const V total = hn::Sub(one, hn::Load(d, pixel + PacketCanvas::kOpen * kStep));
      hn::Store(total, d, pixel);
      return SurfaceFill::Sight{total, thickets ? hn::Load(d, thickets.at(i)) : zero};
    });
    seen_.forEachPixel(size_, [&](std::size_t i) HWY_ATTR {
      float* const pixel = pixels.at(i);
      const V total = hn::Load(d, pixel), filled = fill.Coverage(i);
      const V growth =
          hn::IfThenElse(hn::Gt(filled, total), hn::Div(filled, hn::Max(total, least)), one);
      hn::Store(filled, d, pixel);
      for (std::size_t c = PacketCanvas::kCoverageChannels; c < channels_; ++c) {
        hn::Store(hn::Mul(hn::Load(d, pixel + c * kStep), growth), d, pixel + c * kStep);
      }
      if (!thickets) return;
      float* const thicket = thickets.at(i);
      hn::Store(hn::Mul(hn::Load(d, thicket), growth), d, thicket);
    });
  }

  void StorePixel(std::size_t in_face, const FarFieldSlopes& slopes, FarPixel* out,
                  std::size_t stride) const {
    const std::size_t count = canvas_.receiver_count;
    if (IsUncovered(in_face)) {
      for (std::size_t i = 0; i < count; ++i) out[i * stride].clear();
      return;
    }
    Sights sights;
    for (std::size_t lane = 0; lane < count; lane += kStep) {
      has_light_ ? FindSights<4>(in_face, lane, slopes, sights)
                 : FindSights<1>(in_face, lane, slopes, sights);
    }
    for (std::size_t i = 0; i < count; ++i) {
      FarPixel& far = out[i * stride];
      Copy(sights.of[0] + kSightFloats * i, far.sight);
      Copy(sights.of[1] + kSightFloats * i, far.along[0]);
      Copy(sights.of[2] + kSightFloats * i, far.along[1]);
      const float coverage = ValueOf(pixels_, in_face, i);
      far.begin = coverage > 0 ? ValueOf(begins_, in_face, i) : slopes.distance;
      const float inverse = coverage > 0 ? 1 / coverage : 0;
      far.thicket = thickets_[0] ? inverse * ValueOf(thickets_, in_face, i) : 0;
      far.faded =
          canvas_.rules->fades() ? inverse * ValueOf(pixels_, in_face, i, channels_ - 1) : 0;
    }
  }

  // Of some lanes; of coverage alone, or of radiosities as well.
  template <std::size_t kChannels>
  HWY_INLINE void FindSights(std::size_t in_face, std::size_t lane, const FarFieldSlopes& slopes,
                             Sights& sights) const {
    const D d;
    const auto channel = [&](std::size_t c, std::size_t i) {
      return pixels_[i / kStep].at(in_face) +
             (c == 0 ? 0 : PacketCanvas::kCoverageChannels - 1 + c) * kStep + i % kStep;
    };
    V sums[2][4] = {{hn::Zero(d), hn::Zero(d), hn::Zero(d), hn::Zero(d)},
                    {hn::Zero(d), hn::Zero(d), hn::Zero(d), hn::Zero(d)}};
    for (std::size_t k = 0; k < canvas_.receiver_count; ++k) {
      const V along_u = hn::Load(d, slopes.of[0][k] + lane);
      const V along_v = hn::Load(d, slopes.of[1][k] + lane);
      for (std::size_t c = 0; c < kChannels; ++c) {
        const V seen = Splat(*channel(c, k));
        sums[0][c] = hn::MulAdd(seen, along_u, sums[0][c]);
        sums[1][c] = hn::MulAdd(seen, along_v, sums[1][c]);
      }
    }
    V values[4] = {hn::Zero(d), hn::Zero(d), hn::Zero(d), hn::Zero(d)};
    for (std::size_t c = 0; c < kChannels; ++c) values[c] = hn::Load(d, channel(c, lane));
    const auto store = [&](const V* v, std::size_t i) HWY_ATTR {
      hn::StoreInterleaved4(v[0], v[1], v[2], v[3], d, sights.of[i] + kSightFloats * lane);
    };
    store(values, 0);
    store(sums[0], 1);
    store(sums[1], 2);
  }

  bool IsUncovered(std::size_t in_face) const {
    for (std::size_t lane = 0; lane < canvas_.receiver_count; lane += kStep) {
      const V coverage = hn::Load(D(), pixels_[lane / kStep].at(in_face));
      if (!hn::AllTrue(D(), hn::Le(coverage, hn::Zero(D())))) return false;
    }
    return true;
  }

  const PacketCanvas& canvas_;
  const SeenPixels::Face& seen_;
  const std::size_t size_, face_, channels_;
  const bool has_light_;
  LanesOfAll pixels_, thickets_, begins_;
};

void FinishFarField(const PacketCanvas& canvas, const FarFieldSlopes& slopes, FarPixel* pixels) {
  for (std::size_t i = 0; i < std::size_t(canvas.geometry->faceCount()); ++i) {
    if (!(*canvas.is_face_used)[i]) continue;
    const FarFace face(canvas, i);
    face.Fill();
    face.Store(slopes, pixels);
  }
}

}  // namespace
}  // namespace HWY_NAMESPACE
}  // namespace surfeit
HWY_AFTER_NAMESPACE();

#endif  // per-target guard
