// The things that lie behind each other in the pixels of a packet's rasters, and how their hulls
// close them; for one instruction set (see packet_kernel-inl.h).
#if defined(SURFEIT_PACKET_THINGS_INL_H_) == defined(HWY_TARGET_TOGGLE)
#ifdef SURFEIT_PACKET_THINGS_INL_H_
#undef SURFEIT_PACKET_THINGS_INL_H_
#else
#define SURFEIT_PACKET_THINGS_INL_H_
#endif

#include <hwy/highway.h>
// Needs the instruction set that the former chose
#include <hwy/contrib/math/math-inl.h>

#include <algorithm>
#include <cmath>
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

// Translucent tiles: how many layers they are, that times their opacities, and their optical depth.
template <typename T>
struct TileLayers {
  T count, hidden, depth;
};

// What of all of a pixel such a patch covers: so many layers. `soft_part`: of a disk as it is ray
// traced, its area over what it covers; else 1. None of what is opaque or alone.
inline TileLayers<float> TileLayersOf(const Patch& patch, float soft_part) {
  if (!(patch.clear > 0)) return {0, 0, 0};
  const float opacity = 1 - patch.clear;
  const float count = soft_part * (patch.isNode() ? patch.layers / patch.opacity : 1 / opacity);
  return {count, count * opacity, -count * std::log(patch.clear)};
}

// What shows through so many layers, at least one. Of one layer opacities add up, several multiply.
// Areas of tiles scatter: a second layer counts from half of it on, and wholly from three quarters.
inline V ShownThrough(const TileLayers<V>& layers) {
  const D d;
  const V one = Splat(1), zero = hn::Zero(d);
  const V opacity = hn::Div(layers.hidden, hn::Max(layers.count, Splat(1e-30f)));
  const V through_one = hn::Max(zero, hn::Sub(one, opacity));
  const V several = hn::MulAdd(Splat(4), layers.count, Splat(-6));
  if (hn::AllFalse(d, hn::Gt(several, zero))) return through_one;
  const V part = hn::Min(one, hn::Max(zero, several));
  const V through_all = hn::Exp(d, hn::Neg(layers.depth));
  return hn::MulAdd(part, hn::Sub(through_all, through_one), through_one);
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
                    lanes[PacketCanvas::kOpen * kStep]);
  }
  void BeginThing(std::size_t pixel, M lanes) const {
    if (HasFirst(lanes)) recorder_->beginThing(first_pixel_ + pixel);
  }
  void Close(std::size_t pixel, M lanes, V begin, V end) const {
    if (!HasFirst(lanes)) return;
    recorder_->close(first_pixel_ + pixel, 0.5f * (hn::GetLane(begin) + hn::GetLane(end)));
  }

 private:
  static bool HasFirst(M lanes) { return (LaneBits(lanes) & 1) != 0; }

  PixelRecorder* recorder_ = nullptr;
  std::size_t first_pixel_ = 0;
};

// Of one face. `kChannels` values of color and fade follow those of coverage in a pixel.
template <std::size_t kChannels>
class FaceThings {
 public:
  // Places in a pixel: samples of the hull of the last thing, and in the upper half of all things
  // before it; where the last thing begins and ends in depth; what was left before it; samples that
  // the things before it hold; where these end; and the color before it. Where something is
  // translucent, of the last thing those samples of the hull that are opaque, and its TileLayers.
  static constexpr std::size_t kHull = PacketCanvas::kCoverageChannels + kChannels;
  static constexpr std::size_t kBegin = kHull + 1, kEnd = kHull + 2, kRestBefore = kHull + 3;
  static constexpr std::size_t kHeld = kHull + 4, kEndBefore = kHull + 5;
  static constexpr std::size_t kColorBefore = kHull + 6, kOpaque = kColorBefore + kChannels;
  static constexpr std::size_t kLayers = kOpaque + 1, kHidden = kOpaque + 2, kDepth = kOpaque + 3;
  static_assert(kOpaque ==
                PacketCanvas::kCoverageChannels + PacketCanvas::kThingChannels + 2 * kChannels);

  FaceThings() = default;
  // `is_translucent`: something of what is drawn may be.
  FaceThings(const FaceLanes& pixels, const SeenPixels::Face& seen, int resolution,
             bool is_translucent, FaceRecorder recorder)
      : pixels_(pixels),
        seen_(&seen),
        resolution_(resolution),
        is_translucent_(is_translucent),
        recorder_(recorder) {}

  // Something between these depths meets the pixel in lanes of `meets`: it belongs to the last
  // thing there, or to a new one behind it.
  HWY_INLINE void Meet(std::size_t at, M meets, V depth_begin, V depth_end) const {
    const D d;
    float* const pixel = pixels_.at(at);
    const V end = hn::Load(d, pixel + kEnd * kStep);
    const M begins = hn::And(meets, hn::Gt(depth_begin, end));
    if (!hn::AllFalse(d, begins)) Begin(at, begins, depth_begin, end);
    hn::Store(hn::IfThenElse(meets, hn::Max(end, depth_end), end), d, pixel + kEnd * kStep);
  }

  // Adds samples to the hull of the last thing. `widening` in samples.
  HWY_INLINE void AddHull(std::size_t at, VU samples, VU widening, bool is_opaque) const {
    const D d;
    const DU du;
    float* const pixel = pixels_.at(at);
    hn::Store(hn::BitCast(d, hn::Or(HullOf(pixel), samples)), d, pixel + kHull * kStep);
    // The widening is in the lowest bits of the beginning
    const VU begin = hn::BitCast(du, hn::Load(d, pixel + kBegin * kStep));
    const auto has_some = hn::Ne(samples, hn::Zero(du));
    const VU widest =
        hn::Max(hn::And(begin, SplatU(kWidening)), hn::IfThenElseZero(has_some, widening));
    hn::Store(hn::BitCast(d, hn::Or(hn::AndNot(SplatU(kWidening), begin), widest)), d,
              pixel + kBegin * kStep);
    if (!is_translucent_ || !is_opaque) return;
    hn::Store(hn::BitCast(d, hn::Or(OpaqueOf(pixel), samples)), d, pixel + kOpaque * kStep);
  }

  // Adds this part of these tiles to the last thing. What shows through it then.
  HWY_INLINE V AddTiles(std::size_t at, V part, const TileLayers<float>& tiles) const {
    const D d;
    float* const pixel = pixels_.at(at);
    TileLayers<V> layers = LayersOf(pixel);
    layers.count = hn::MulAdd(part, Splat(tiles.count), layers.count);
    layers.hidden = hn::MulAdd(part, Splat(tiles.hidden), layers.hidden);
    layers.depth = hn::MulAdd(part, Splat(tiles.depth), layers.depth);
    hn::Store(layers.count, d, pixel + kLayers * kStep);
    hn::Store(layers.hidden, d, pixel + kHidden * kStep);
    hn::Store(layers.depth, d, pixel + kDepth * kStep);
    return ShownThrough(layers);
  }

  // Closes the last things of all pixels.
  void CloseAll() const {
    const D d;
    seen_->forEachPixel(std::size_t(resolution_), [&](std::size_t at) HWY_ATTR {
      const float* const pixel = pixels_.at(at);
      const M lanes = hn::And(BringSome(pixel), IsWhole(hn::Or(HeldOf(pixel), HullOf(pixel))));
      if (!hn::AllFalse(d, lanes)) CloseThing(at, lanes, hn::Load(d, pixel + kEnd * kStep));
    });
  }

  static VU HeldOf(const float* pixel) {
    return hn::BitCast(DU(), hn::Load(D(), pixel + kHeld * kStep));
  }

 private:
  static constexpr std::uint32_t kWidening = 7;  // bits

  // A thing in these lanes, behind the last one, which ends at `end`.
  HWY_NOINLINE void Begin(std::size_t at, M lanes, V depth_begin, V end) const {
    const D d;
    const DU du;
    float* const pixel = pixels_.at(at);
    const VU hull = HullOf(pixel);
    const VU own =
        hn::IfThenElseZero(hn::RebindMask(du, lanes), hn::And(hull, SplatU(kHullSamples)));
    if (!hn::AllTrue(du, hn::Eq(own, hn::Zero(du)))) {
      const VU held = CloseThing(at, lanes, end);
      hn::Store(hn::BitCast(d, held), d, pixel + kHeld * kStep);
    }
    if (recorder_) recorder_.BeginThing(at, lanes);
    const auto is_new = hn::RebindMask(du, lanes);
    const VU before = hn::AndNot(SplatU(kHullSamples), hn::Or(hull, hn::ShiftLeft<16>(hull)));
    hn::Store(hn::BitCast(d, hn::IfThenElse(is_new, before, hull)), d, pixel + kHull * kStep);
    if (is_translucent_) {
      for (const std::size_t i : {kOpaque, kLayers, kHidden, kDepth}) {
        float* const last = pixel + i * kStep;
        hn::Store(hn::IfThenZeroElse(lanes, hn::Load(d, last)), d, last);
      }
    }
    Move(pixel, lanes, kEnd, kEndBefore);
    Move(pixel, lanes, PacketCanvas::kOpen, PacketCanvas::kRoom);
    Move(pixel, lanes, PacketCanvas::kRest, kRestBefore);
    for (std::size_t c = 0; c < kChannels; ++c) {
      Move(pixel, lanes, PacketCanvas::kCoverageChannels + c, kColorBefore + c);
    }
    const V begin = hn::Load(d, pixel + kBegin * kStep);
    const V new_begin = hn::BitCast(d, hn::AndNot(SplatU(kWidening), hn::BitCast(du, depth_begin)));
    hn::Store(hn::IfThenElse(lanes, new_begin, begin), d, pixel + kBegin * kStep);
  }
  static void Move(float* pixel, M lanes, std::size_t from, std::size_t to) {
    const D d;
    const V moved = hn::Load(d, pixel + from * kStep), was = hn::Load(d, pixel + to * kStep);
    hn::Store(hn::IfThenElse(lanes, moved, was), d, pixel + to * kStep);
  }
  static VU HullOf(const float* pixel) {
    return hn::BitCast(DU(), hn::Load(D(), pixel + kHull * kStep));
  }
  static VU OpaqueOf(const float* pixel) {
    return hn::BitCast(DU(), hn::Load(D(), pixel + kOpaque * kStep));
  }
  static TileLayers<V> LayersOf(const float* pixel) {
    const D d;
    return {hn::Load(d, pixel + kLayers * kStep), hn::Load(d, pixel + kHidden * kStep),
            hn::Load(d, pixel + kDepth * kStep)};
  }
  // Closes the last thing, which ends at `end`, in those of these lanes where its hull is whole.
  // Returns the samples that it and the things before it hold; translucent tiles hold none.
  VU CloseThing(std::size_t at, M lanes, V end) const {
    const D d;
    const DU du;
    const float* const pixel = pixels_.at(at);
    const M some = hn::And(lanes, BringSome(pixel));
    const auto holds = [&](bool is_opaque) HWY_ATTR {
      const VU own = is_opaque ? OpaqueOf(pixel) : hn::And(HullOf(pixel), SplatU(kHullSamples));
      const VU counts = hn::IfThenElseZero(hn::RebindMask(du, lanes), own);
      if (hn::AllTrue(du, hn::Eq(counts, hn::Zero(du)))) return HeldOf(pixel);
      return hn::Or(HeldOf(pixel), Narrowed(at, counts, end, is_opaque));
    };
    const VU held = holds(is_translucent_);
    const M is_whole = hn::And(some, IsWhole(held));
    if (!hn::AllFalse(d, is_whole)) Close(at, is_whole, hn::Zero(d));
    if (!is_translucent_) return held;
    const M is_shown_through = hn::AndNot(is_whole, hn::And(some, IsWhole(holds(false))));
    if (hn::AllFalse(d, is_shown_through)) return held;
    Close(at, is_shown_through, ShownThrough(LayersOf(pixel)));
    return held;
  }
  // Lanes whose last thing covers some of what is still open.
  static M BringSome(const float* pixel) {
    const D d;
    const V open = hn::Load(d, pixel + PacketCanvas::kOpen * kStep);
    const V rest = hn::Load(d, pixel + PacketCanvas::kRest * kStep);
    const V before = hn::Load(d, pixel + kRestBefore * kStep);
    return hn::And(hn::Gt(before, rest), hn::Gt(open, hn::Zero(d)));
  }
  static M IsWhole(VU hull) {
    const DU du;
    return hn::RebindMask(D(), hn::Eq(hn::AndNot(hull, SplatU(kHullSamples)), hn::Zero(du)));
  }

  // Of these samples of the last thing in the pixel, or of what is opaque of it, those around which
  // it has all others, as far as anything there was widened. In neighbours, things count that reach
  // from where it begins to `end`.
  VU Narrowed(std::size_t at, VU own, V end, bool is_opaque) const {
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
        masks[x] = x == 1 && y == 1
                       ? own
                       : OfNeighbour(column + x - 1, row + y - 1, begin, end, is_opaque);
      }
      rows[y] = NarrowedAcross(masks, widening);
    }
    return NarrowedAlong(rows, widening);
  }
  // What is not looked at lacks none, nor what is covered.
  VU OfNeighbour(int column, int row, V begin, V end, bool is_opaque) const {
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
    const VU hull = HullOf(other), last = is_opaque ? OpaqueOf(other) : hn::And(hull, all);
    const VU found =
        hn::Or(hn::IfThenElseZero(hn::RebindMask(DU(), has_last), last),
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

  // What is closed belongs to what the last thing has brought. `clear` of it stays open.
  void Close(std::size_t at, M lanes, V clear) const {
    const D d;
    const V one = Splat(1);
    float* const pixel = pixels_.at(at);
    const V rest = hn::Load(d, pixel + PacketCanvas::kRest * kStep);
    const V before = hn::Load(d, pixel + kRestBefore * kStep);
    const V brought = hn::IfThenElse(lanes, hn::Sub(before, rest), one);
    const V left = hn::Min(rest, hn::Mul(clear, before));
    const V scale = hn::Div(hn::IfThenElseZero(lanes, hn::Sub(rest, left)), brought);
    if (recorder_) {
      recorder_.Close(at, lanes, hn::Load(d, pixel + kBegin * kStep),
                      hn::Load(d, pixel + kEnd * kStep));
    }
    float* const open_at = pixel + PacketCanvas::kOpen * kStep;
    const V open = hn::Load(d, open_at), room = hn::Load(d, pixel + PacketCanvas::kRoom * kStep);
    hn::Store(hn::IfThenElse(lanes, hn::Min(open, hn::Mul(clear, room)), open), d, open_at);
    hn::Store(hn::IfThenElse(lanes, left, rest), d, pixel + PacketCanvas::kRest * kStep);
    for (std::size_t c = 0; c < kChannels; ++c) {
      float* const to = pixel + (PacketCanvas::kCoverageChannels + c) * kStep;
      const V all = hn::Load(d, to), early = hn::Load(d, pixel + (kColorBefore + c) * kStep);
      hn::Store(hn::MulAdd(scale, hn::Sub(all, early), all), d, to);
    }
  }

  FaceLanes pixels_;
  const SeenPixels::Face* seen_ = nullptr;
  int resolution_ = 0;
  bool is_translucent_ = false;
  FaceRecorder recorder_;
};

}  // namespace
}  // namespace HWY_NAMESPACE
}  // namespace surfeit
HWY_AFTER_NAMESPACE();

#endif  // per-target guard
