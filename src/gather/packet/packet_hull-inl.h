// The hulls of what is drawn, and the closing of layers by them, in the rasters of a packet; for
// one instruction set (see packet_kernel-inl.h).
#if defined(SURFEIT_PACKET_HULL_INL_H_) == defined(HWY_TARGET_TOGGLE)
#ifdef SURFEIT_PACKET_HULL_INL_H_
#undef SURFEIT_PACKET_HULL_INL_H_
#else
#define SURFEIT_PACKET_HULL_INL_H_
#endif

#include <hwy/highway.h>

#include <algorithm>
#include <cstddef>
#include <cstdint>

#include "gather/packet/packet_kernel.h"
#include "gather/packet/packet_lanes-inl.h"
#include "gather/packet/pixel_record.h"
#include "gather/rules/coverage_rules.h"

HWY_BEFORE_NAMESPACE();
namespace surfeit {
namespace HWY_NAMESPACE {
namespace {

using DU = hn::RebindToUnsigned<D>;
using DI = hn::RebindToSigned<D>;
using VU = hn::Vec<DU>;
inline VU SplatU(std::uint32_t value) { return hn::Set(DU(), value); }

// Samples of one column of a pixel, in all of them.
inline VU InEveryColumn(VU column) {
  column = hn::Or(column, hn::ShiftLeft<kHullSide>(column));
  return hn::Or(column, hn::ShiftLeft<2 * kHullSide>(column));
}

// What the first receiver of a vector sees on a face, told to a recorder if there is one.
class FaceRecorder {
 public:
  FaceRecorder() = default;
  FaceRecorder(const PacketCanvas& canvas, std::size_t face, std::size_t lane)
      : recorder_(lane == 0 ? canvas.recorder : nullptr),
        first_pixel_(face * canvas.geometry->facePixels()) {}
  explicit operator bool() const { return recorder_ != nullptr; }

  void Clear(std::size_t pixel, V open) const {
    recorder_->clear(first_pixel_ + pixel, hn::GetLane(open));
  }
  void Look(std::size_t pixel, CubeKind kind, V distance, const float* lanes) const {
    recorder_->look(first_pixel_ + pixel, kind, hn::GetLane(distance),
                    lanes[PacketCanvas::kRoom * kStep], lanes[PacketCanvas::kOpen * kStep]);
  }
  void Close(std::size_t pixel, M lanes, V begin, V end) const {
    const D d;
    if (!(hn::GetLane(hn::VecFromMask(d, hn::RebindMask(d, lanes))) != 0)) return;
    recorder_->close(first_pixel_ + pixel, 0.5f * (hn::GetLane(begin) + hn::GetLane(end)));
  }

 private:
  PixelRecorder* recorder_ = nullptr;
  std::size_t first_pixel_ = 0;
};

// Of one face. `kChannels` values of color and fade follow those of coverage in a pixel.
template <std::size_t kChannels>
class FaceHull {
 public:
  // Places in a pixel: samples of the hull of the last thing, and in the upper half of all things
  // before it; where the last thing begins and ends in depth; what was left before the last layer,
  // negative once that layer was asked for its hull; samples that the things before the last one
  // hold; where these end.
  static constexpr std::size_t kHull = PacketCanvas::kCoverageChannels + kChannels;
  static constexpr std::size_t kBegin = kHull + 1, kEnd = kHull + 2, kRestBefore = kHull + 3;
  static constexpr std::size_t kKept = kHull + 4, kEndBefore = kHull + 5;
  static constexpr std::size_t kColorBefore = kHull + 6, kAll = kColorBefore + kChannels;
  static_assert(kAll ==
                PacketCanvas::kCoverageChannels + PacketCanvas::kHullChannels + 2 * kChannels);

  FaceHull() = default;
  FaceHull(const FaceLanes& pixels, const SeenPixels::Face& seen, int resolution,
           FaceRecorder recorder)
      : pixels_(pixels), seen_(&seen), resolution_(resolution), recorder_(recorder) {}

  // Adds samples of lanes that have some. `widening` in samples. False: the pixel is open to
  // nobody.
  HWY_INLINE bool Add(std::size_t at, VU samples, VU widening, V depth_begin, V depth_end) const {
    const D d;
    const DU du;
    float* const pixel = pixels_.at(at);
    const V open = hn::Load(d, pixel + PacketCanvas::kOpen * kStep);
    const M is_open = hn::Gt(open, hn::Zero(d));
    if (hn::AllFalse(d, is_open)) return false;
    const M counts = hn::And(hn::RebindMask(d, hn::Ne(samples, hn::Zero(du))), is_open);
    if (hn::AllFalse(d, counts)) return true;
    samples = hn::IfThenElseZero(hn::RebindMask(du, counts), samples);
    const V end = hn::Load(d, pixel + kEnd * kStep), begin = hn::Load(d, pixel + kBegin * kStep);
    VU hull = hn::BitCast(du, hn::Load(d, pixel + kHull * kStep));
    const M is_new = hn::And(counts, hn::Gt(depth_begin, end));
    if (!hn::AllFalse(d, is_new)) Keep(at, is_new, end);
    const VU moved = hn::AndNot(SplatU(kHullSamples), hn::Or(hull, hn::ShiftLeft<16>(hull)));
    hull = hn::Or(hn::IfThenElse(hn::RebindMask(du, is_new), moved, hull), samples);
    hn::Store(hn::BitCast(d, hull), d, pixel + kHull * kStep);
    hn::Store(hn::IfThenElse(counts, hn::Max(end, depth_end), end), d, pixel + kEnd * kStep);
    // The widening is in the lowest bits of the beginning
    const VU before = hn::And(hn::BitCast(du, begin), SplatU(kWidening));
    const VU widest = hn::Max(before, hn::IfThenElseZero(hn::RebindMask(du, counts), widening));
    const VU place = hn::BitCast(du, hn::IfThenElse(is_new, depth_begin, begin));
    hn::Store(hn::BitCast(d, hn::Or(hn::AndNot(SplatU(kWidening), place), widest)), d,
              pixel + kBegin * kStep);
    return true;
  }

  // What comes before something is drawn that begins layers of their own in lanes of `ends`, and
  // new ones in lanes of `begins`.
  HWY_INLINE void Turn(std::size_t at, M ends, M begins) const {
    const D d;
    float* const pixel = pixels_.at(at);
    const V before = hn::Load(d, pixel + kRestBefore * kStep);
    V rest = hn::Load(d, pixel + PacketCanvas::kRest * kStep);
    const M has_layer = hn::And(ends, hn::Gt(before, rest));
    if (!hn::AllFalse(d, has_layer)) Close(at, has_layer);
    rest = hn::Load(d, pixel + PacketCanvas::kRest * kStep);
    begins = hn::And(begins, hn::Ne(before, rest));
    if (hn::AllFalse(d, begins)) return;
    hn::Store(hn::IfThenElse(begins, rest, hn::Load(d, pixel + kRestBefore * kStep)), d,
              pixel + kRestBefore * kStep);
    for (std::size_t c = 0; c < kChannels; ++c) {
      float* const to = pixel + (kColorBefore + c) * kStep;
      const float* const from = pixel + (PacketCanvas::kCoverageChannels + c) * kStep;
      hn::Store(hn::IfThenElse(begins, hn::Load(d, from), hn::Load(d, to)), d, to);
    }
  }

  // Closes the last layers of all pixels.
  void CloseAll() const {
    const D d;
    seen_->forEachPixel(std::size_t(resolution_), [&](std::size_t at) HWY_ATTR {
      const float* const pixel = pixels_.at(at);
      const V open = hn::Load(d, pixel + PacketCanvas::kOpen * kStep);
      const V rest = hn::Load(d, pixel + PacketCanvas::kRest * kStep);
      const V before = hn::Load(d, pixel + kRestBefore * kStep);
      const M has_layer = hn::And(hn::Gt(before, rest), hn::Gt(open, hn::Zero(d)));
      if (!hn::AllFalse(d, has_layer)) Close(at, has_layer);
    });
  }

 private:
  static constexpr std::uint32_t kWidening = 7;  // bits

  // Before another thing begins in these lanes: what the last one, which ends at `end`, holds.
  HWY_NOINLINE void Keep(std::size_t at, M lanes, V end) const {
    const D d;
    const DU du;
    float* const pixel = pixels_.at(at);
    const V end_before = hn::Load(d, pixel + kEndBefore * kStep);
    hn::Store(hn::IfThenElse(lanes, end, end_before), d, pixel + kEndBefore * kStep);
    const VU own = hn::And(HullOf(pixel), SplatU(kHullSamples));
    lanes = hn::And(lanes, hn::RebindMask(d, hn::Ne(own, hn::Zero(du))));
    if (hn::AllFalse(d, lanes)) return;
    const VU held = hn::IfThenElseZero(hn::RebindMask(du, lanes), Narrowed(at, own, end));
    const VU kept = hn::BitCast(du, hn::Load(d, pixel + kKept * kStep));
    hn::Store(hn::BitCast(d, hn::Or(kept, held)), d, pixel + kKept * kStep);
  }
  static VU HullOf(const float* pixel) {
    return hn::BitCast(DU(), hn::Load(D(), pixel + kHull * kStep));
  }

  // Those of these lanes where the hulls of the things drawn up to the end of the pixel's last
  // layer, each narrowed again by itself, hold the pixel.
  M Held(std::size_t at, M lanes) const {
    const D d;
    const DU du;
    const float* const pixel = pixels_.at(at);
    const V end = hn::Load(d, pixel + PacketCanvas::kEnd * kStep);
    const VU kept = hn::BitCast(du, hn::Load(d, pixel + kKept * kStep));
    const M counts = hn::Le(hn::Load(d, pixel + kBegin * kStep), end);
    const VU last = hn::And(HullOf(pixel), SplatU(kHullSamples));
    const VU own = hn::IfThenElseZero(hn::RebindMask(du, counts), last);
    lanes = hn::And(lanes, Holds(hn::Or(kept, own)));
    if (hn::AllFalse(d, lanes)) return lanes;
    return hn::And(lanes, Holds(hn::Or(kept, Narrowed(at, own, end))));
  }
  static M Holds(VU hull) {
    const DU du;
    return hn::RebindMask(D(), hn::Eq(hn::AndNot(hull, SplatU(kHullSamples)), hn::Zero(du)));
  }

  // Of these samples of the last thing in the pixel, those around which it has all others, as far
  // as anything there was widened. In neighbours, things count that reach from where it begins to
  // `end`.
  VU Narrowed(std::size_t at, VU own, V end) const {
    const D d;
    const DU du;
    const float* const pixel = pixels_.at(at);
    const V begin = hn::Load(d, pixel + kBegin * kStep);
    const VU widening = hn::And(hn::BitCast(du, begin), SplatU(kWidening));
    const int column = int(at) % resolution_, row = int(at) / resolution_;
    VU rows[3];
    for (int y = 0; y < 3; ++y) {
      VU masks[3];
      for (int x = 0; x < 3; ++x) {
        masks[x] = x == 1 && y == 1 ? own : OfNeighbour(column + x - 1, row + y - 1, begin, end);
      }
      rows[y] = NarrowedAcross(masks, widening);
    }
    return NarrowedAlong(rows, widening);
  }
  // What is not looked at lacks none, nor what is covered.
  VU OfNeighbour(int column, int row, V begin, V end) const {
    const D d;
    const VU all = SplatU(kHullSamples);
    if (row < seen_->row_begin || row >= seen_->row_end) return all;
    const SeenPixels::Columns& columns = seen_->rows[std::size_t(row)];
    if (column < columns.begin || column >= columns.end) return all;
    const float* const other = pixels_.at(std::size_t(row * resolution_ + column));
    const M is_full = hn::Le(hn::Load(d, other + PacketCanvas::kOpen * kStep), hn::Zero(d));
    const V last_begin = hn::Load(d, other + kBegin * kStep);
    const V last_end = hn::Load(d, other + kEnd * kStep);
    const V end_before = hn::Load(d, other + kEndBefore * kStep);
    // The last thing there may be farther away, or nearer; then those before it tell
    const M is_later = hn::Gt(last_begin, end), is_near = hn::Ge(last_end, begin);
    const M has_last = hn::AndNot(is_later, is_near);
    const M has_before = hn::Or(is_later, hn::Ge(end_before, begin));
    const VU hull = HullOf(other);
    const VU found =
        hn::Or(hn::IfThenElseZero(hn::RebindMask(DU(), has_last), hn::And(hull, all)),
               hn::IfThenElseZero(hn::RebindMask(DU(), has_before), hn::ShiftRight<16>(hull)));
    return hn::IfThenElse(hn::RebindMask(DU(), is_full), all, found);
  }

  // Of three pixels in a row, the samples of the middle one that have all within `widening`
  // columns.
  static VU NarrowedAcross(const VU (&pixels)[3], VU widening) {
    const VU all = SplatU(kHullSamples);
    VU held = pixels[1];
    for (int k = 1; k <= kHullSide; ++k) {
      const auto counts = hn::Gt(widening, SplatU(std::uint32_t(k - 1)));
      if (hn::AllFalse(DU(), counts)) break;
      const int by = k * kHullSide, rest = kHullSide * kHullSide - by;
      const VU before =
          hn::Or(hn::ShiftLeftSame(pixels[1], by), hn::ShiftRightSame(pixels[0], rest));
      const VU after =
          hn::Or(hn::ShiftRightSame(pixels[1], by), hn::ShiftLeftSame(pixels[2], rest));
      held = hn::And(held, hn::IfThenElse(counts, hn::And(before, after), all));
    }
    return hn::And(held, all);
  }
  // The same of three pixels in a column, and rows.
  static VU NarrowedAlong(const VU (&pixels)[3], VU widening) {
    VU held = pixels[1];
    const VU all = SplatU(kHullSamples);
    for (int k = 1; k <= kHullSide; ++k) {
      const auto counts = hn::Gt(widening, SplatU(std::uint32_t(k - 1)));
      if (hn::AllFalse(DU(), counts)) break;
      const int rest = kHullSide - k;
      const std::uint32_t high = (0xfu << k & 0xfu) * 0x1111u, low = (0xfu >> k) * 0x1111u;
      const VU before = hn::Or(hn::And(hn::ShiftLeftSame(pixels[1], k), SplatU(high)),
                               hn::AndNot(SplatU(high), hn::ShiftRightSame(pixels[0], rest)));
      const VU after = hn::Or(hn::And(hn::ShiftRightSame(pixels[1], k), SplatU(low)),
                              hn::AndNot(SplatU(low), hn::ShiftLeftSame(pixels[2], rest)));
      held = hn::And(held, hn::IfThenElse(counts, hn::And(before, after), all));
    }
    return hn::And(held, all);
  }

  // Of the lanes whose layers cover something. What is closed belongs to what its layer has
  // brought.
  void Close(std::size_t at, M lanes) const {
    const D d;
    const V zero = hn::Zero(d), one = Splat(1);
    float* const pixel = pixels_.at(at);
    const V rest = hn::Load(d, pixel + PacketCanvas::kRest * kStep);
    const V before = hn::Load(d, pixel + kRestBefore * kStep);
    hn::Store(hn::IfThenElse(lanes, hn::Neg(before), before), d, pixel + kRestBefore * kStep);
    lanes = Held(at, lanes);
    if (hn::AllFalse(d, lanes)) return;
    const V layer = hn::IfThenElse(lanes, hn::Sub(before, rest), one);
    const V scale = hn::Div(hn::IfThenElseZero(lanes, rest), layer);
    if (recorder_)
      recorder_.Close(at, lanes, hn::Load(d, pixel + kBegin * kStep),
                      hn::Load(d, pixel + PacketCanvas::kEnd * kStep));
    for (const std::size_t i : {PacketCanvas::kOpen, PacketCanvas::kRest}) {
      float* const left = pixel + i * kStep;
      hn::Store(hn::IfThenElse(lanes, zero, hn::Load(d, left)), d, left);
    }
    for (std::size_t c = 0; c < kChannels; ++c) {
      float* const to = pixel + (PacketCanvas::kCoverageChannels + c) * kStep;
      const V all = hn::Load(d, to), early = hn::Load(d, pixel + (kColorBefore + c) * kStep);
      hn::Store(hn::MulAdd(scale, hn::Sub(all, early), all), d, to);
    }
  }

  FaceLanes pixels_;
  const SeenPixels::Face* seen_ = nullptr;
  int resolution_ = 0;
  FaceRecorder recorder_;
};

}  // namespace
}  // namespace HWY_NAMESPACE
}  // namespace surfeit
HWY_AFTER_NAMESPACE();

#endif  // per-target guard
