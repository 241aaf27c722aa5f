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
  // Places in a pixel. What was left before the last layer is negative once that layer was asked
  // for its hull.
  static constexpr std::size_t kHull = PacketCanvas::kCoverageChannels + kChannels;
  static constexpr std::size_t kBegin = kHull + 1, kEnd = kHull + 2, kRestBefore = kHull + 3;
  static constexpr std::size_t kColorBefore = kHull + 4, kAll = kColorBefore + kChannels;
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

  // Samples of what begins no farther than `distance`.
  static VU UpTo(const float* pixel, V distance) {
    const D d;
    const DU du;
    const VU hull = hn::BitCast(du, hn::Load(d, pixel + kHull * kStep));
    const VU before = hn::ShiftRight<16>(hull);
    const M all = hn::Le(hn::Load(d, pixel + kBegin * kStep), distance);
    return hn::IfThenElse(hn::RebindMask(du, all), hn::Or(before, hull), before);
  }

  // Those of these lanes where the hull of what was drawn up to the end of the pixel's last layer,
  // narrowed again, holds the pixel: all of its own samples are of the hull, and those of its
  // neighbours that are as near as the hull was widened. What is not looked at lacks none, nor what
  // is covered.
  M Held(std::size_t at, M lanes) const {
    const D d;
    const DU du;
    const float* const pixel = pixels_.at(at);
    const V end = hn::Load(d, pixel + PacketCanvas::kEnd * kStep);
    lanes = hn::And(lanes, Holds(UpTo(pixel, end), SplatU(kHullSamples)));
    if (hn::AllFalse(d, lanes)) return lanes;
    const VU widening =
        hn::And(hn::BitCast(du, hn::Load(d, pixel + kBegin * kStep)), SplatU(kWidening));
    const Borders borders(widening);
    const int column = int(at) % resolution_, row = int(at) / resolution_;
    for (int y = -1; y <= 1; ++y) {
      const int other_row = row + y;
      if (other_row < seen_->row_begin || other_row >= seen_->row_end) continue;
      const SeenPixels::Columns& columns = seen_->rows[std::size_t(other_row)];
      for (int x = -1; x <= 1; ++x) {
        const int other_column = column + x;
        if ((x == 0 && y == 0) || other_column < columns.begin || other_column >= columns.end) {
          continue;
        }
        const float* const other = pixels_.at(std::size_t(other_row * resolution_ + other_column));
        const M is_full = hn::Le(hn::Load(d, other + PacketCanvas::kOpen * kStep), hn::Zero(d));
        const M holds = Holds(UpTo(other, end), borders.Of(x, y));
        lanes = hn::And(lanes, hn::Or(is_full, holds));
        if (hn::AllFalse(d, lanes)) return lanes;
      }
    }
    return lanes;
  }
  static M Holds(VU hull, VU samples) {
    const DU du;
    return hn::RebindMask(D(), hn::Eq(hn::AndNot(hull, samples), hn::Zero(du)));
  }

  // Samples of the neighbour in direction (x, y) that lie within `widening` samples of the pixel.
  struct Borders {
    VU columns[3], rows[3];

    explicit Borders(VU widening) {
      const VU all = SplatU(kHullSamples), column = SplatU((1u << kHullSide) - 1);
      const VU rest = hn::Sub(SplatU(kHullSide), widening);
      columns[0] = hn::And(all, hn::Shl(all, hn::ShiftLeft<2>(rest)));
      columns[1] = rows[1] = all;
      columns[2] = hn::AndNot(hn::Shl(all, hn::ShiftLeft<2>(widening)), all);
      rows[0] = InEveryColumn(hn::And(column, hn::Shl(column, rest)));
      rows[2] = InEveryColumn(hn::AndNot(hn::Shl(column, widening), column));
    }
    VU Of(int x, int y) const { return hn::And(columns[x + 1], rows[y + 1]); }
  };

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
