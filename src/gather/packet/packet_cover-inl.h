// Pixels of a packet's rasters: which of them count, and how one is covered; for one instruction
// set (see packet_kernel-inl.h).
#if defined(SURFEIT_PACKET_COVER_INL_H_) == defined(HWY_TARGET_TOGGLE)
#ifdef SURFEIT_PACKET_COVER_INL_H_
#undef SURFEIT_PACKET_COVER_INL_H_
#else
#define SURFEIT_PACKET_COVER_INL_H_
#endif

#include <hwy/highway.h>
// Needs the instruction set that the former chose
#include <hwy/contrib/math/math-inl.h>

#include <algorithm>
#include <array>
#include <bit>
#include <cstdint>
#include <glm/vec3.hpp>
#include <iterator>

#include "gather/packet/packet_hull-inl.h"
#include "gather/packet/packet_kernel.h"
#include "gather/packet/packet_lanes-inl.h"
#include "gather/rules/coverage_rules.h"

HWY_BEFORE_NAMESPACE();
namespace surfeit {
namespace HWY_NAMESPACE {
namespace {

// How some of the receivers' pixels are covered.
struct Cover {
  V depth_begin, depth_end;
  V hull_begin, hull_end;  // within which it may touch others
  V inverse_gap;  // one over the gap in depth that is all new
  M is_lit;
  bool is_all_lit;
  float overlap, nested;
  bool has_hull;  // it is no thicket
  bool is_solid;  // and its hull is widened
  V opacity;
  float own;  // the part of its own that overlaps
  glm::vec3 radiosity;
  const float* lights;  // instead of it, PacketLights of these lanes; null: none
  V fade;               // only when something fades
};

// How occlusion at a distance counts.
inline V FadeAt(const GatherRules& rules, V distance) {
  const D d;
  const GatherWeights& weights = rules.weights;
  if (weights.falloff_mode == GatherWeights::FalloffMode::kExponential) {
    return hn::Exp(d, hn::Mul(Splat(-weights.falloff), distance));
  }
  const float inverse = 1 / rules.quality.max_distance;
  const V rest = hn::NegMulAdd(distance, Splat(inverse), Splat(1));
  const V power = hn::Mul(Splat(weights.falloff), hn::Log(d, hn::Max(rest, Splat(1e-30f))));
  return hn::IfThenElseZero(hn::Gt(rest, Splat(1e-30f)), hn::Exp(d, power));
}

// What a kernel for one kind of raster draws.
template <bool kHasColor, bool kHasFade, bool kHasFrame>
struct BrushKind {
  static constexpr bool kColor = kHasColor, kFade = kHasFade;
  static constexpr bool kFrame = kHasFrame;  // the raster of a cone, in a frame of each lane
  static constexpr std::size_t kChannels = (kColor ? 3 : 0) + (kFade ? 1 : 0);
};

// Covers so much of a pixel where `amount` is positive. A layer with less room ends at exactly 1,
// and the pixel is exactly full then. Without kOverlaps, nothing hides behind its own layer.
// `place`: that of the pixel, which the hull is asked about; `weight`: of the middle of what covers
// it, over that of its own. False: the pixel was open to nobody.
template <typename Kind, bool kOverlaps>
HWY_INLINE bool CoverPixel(float* pixel, std::size_t place, V amount, V weight, const Cover& cover,
                           const FaceHull<Kind::kChannels>& hull) {
  const D d;
  const V zero = hn::Zero(d), one = Splat(1);
  const M is_open = hn::Gt(hn::Load(d, pixel + PacketCanvas::kOpen * kStep), zero);
  if (hn::AllFalse(d, is_open)) return false;
  const M is_drawn = hn::And(hn::Gt(amount, zero), is_open);
  if (hn::AllFalse(d, is_drawn)) return true;
  float* const room_at = pixel + PacketCanvas::kRoom * kStep;
  float* const layer_at = pixel + PacketCanvas::kLayer * kStep;
  float* const end_at = pixel + PacketCanvas::kEnd * kStep;
  float* const open_at = pixel + PacketCanvas::kOpen * kStep;
  const V end = hn::Load(d, end_at);
  V room = hn::Load(d, room_at), before = hn::Load(d, layer_at);

  // A gap in depth begins a new layer, by and by
  const V gap = hn::Mul(hn::Sub(cover.depth_begin, end), cover.inverse_gap);
  const V is_new = hn::IfThenElseZero(is_drawn, hn::Min(one, hn::Max(zero, gap)));
  const M ends = hn::And(is_drawn, hn::Ge(gap, one));
  if (!hn::AllFalse(d, hn::Gt(is_new, zero))) {
    hull.Turn(place, ends, hn::And(is_drawn, hn::Gt(is_new, zero)));
  }
  const V open = hn::Load(d, open_at);
  room = hn::MulAdd(is_new, hn::Sub(open, room), room);
  before = hn::NegMulAdd(is_new, before, before);
  hn::Store(room, d, room_at);
  hn::Store(hn::IfThenElse(is_drawn, hn::Max(end, cover.depth_end), end), d, end_at);

  // The slope of s - s^2 / 2 in the middle of what is added leaves out what hides behind the layer;
  // what of a thicket hides behind itself is left out of its opacity
  V counts = amount;
  if constexpr (kOverlaps) {
    const V middle = hn::Min(one, hn::MulAdd(Splat(cover.own), amount, before));
    counts = hn::Mul(amount, hn::NegMulAdd(middle, Splat(cover.overlap), one));
  }
  const V layer = hn::Min(one, hn::Add(before, counts));
  hn::Store(layer, d, layer_at);
  const V left = hn::Min(open, OpenBehind(room, layer, Splat(cover.nested)));
  const V covered = hn::IfThenElseZero(hn::Gt(amount, zero), hn::Sub(open, left));
  hn::Store(hn::Sub(open, covered), d, open_at);
  float* const rest_at = pixel + PacketCanvas::kRest * kStep;
  const V rest = hn::Load(d, rest_at);
  const V taken = TakenWeight(covered, open, rest, weight);
  hn::Store(hn::Sub(rest, taken), d, rest_at);
  if constexpr (Kind::kChannels > 0) {
    V added = taken;
    float* at = pixel + PacketCanvas::kCoverageChannels * kStep;
    if constexpr (Kind::kFade) {
      float* const fade_at = at + (Kind::kChannels - 1) * kStep;
      hn::Store(hn::MulAdd(added, cover.fade, hn::Load(d, fade_at)), d, fade_at);
    }
    if constexpr (Kind::kColor) {
      if (!cover.is_all_lit) added = hn::IfThenElseZero(cover.is_lit, added);
      for (int c = 0; c < 3; ++c, at += kStep) {
        const V color = cover.lights == nullptr ? Splat(cover.radiosity[c])
                                                : hn::Load(d, cover.lights + c * kPacketReceivers);
        hn::Store(hn::MulAdd(added, color, hn::Load(d, at)), d, at);
      }
    }
  }
  return true;
}

// Pixels of a face, half open.
struct PixelRange {
  int column_begin, column_end, row_begin, row_end;
  bool isEmpty() const { return column_begin >= column_end || row_begin >= row_end; }
};

// The pixels that rectangles [x0, x1] x [y0, y1], in pixels within the face, reach in lanes of
// `active`, in rows that count.
inline PixelRange RangeOf(M active, V x0, V x1, V y0, V y1, int resolution,
                          const SeenPixels::Face& seen) {
  const D d;
  const V far_away = Splat(float(resolution));
  PixelRange range;
  range.column_begin = int(hn::GetLane(hn::MinOfLanes(d, hn::IfThenElse(active, x0, far_away))));
  range.row_begin = int(hn::GetLane(hn::MinOfLanes(d, hn::IfThenElse(active, y0, far_away))));
  const float x_end = hn::GetLane(hn::MaxOfLanes(d, hn::IfThenElseZero(active, x1)));
  const float y_end = hn::GetLane(hn::MaxOfLanes(d, hn::IfThenElseZero(active, y1)));
  range.column_end = std::min(resolution, int(x_end) + 1);
  range.row_begin = std::max(range.row_begin, seen.row_begin);
  range.row_end = std::min(seen.row_end, int(y_end) + 1);
  return range;
}

// The pixels of a face that may be open to some receiver, as bits of rows: nothing else is drawn.
class OpenPixels {
 public:
  void Begin(const SeenPixels::Face& seen) {
    for (int row = seen.row_begin; row < seen.row_end; ++row) {
      const SeenPixels::Columns& columns = seen.rows[std::size_t(row)];
      rows_[std::size_t(row)] = Bits(columns.begin, columns.end);
    }
  }
  // Calls draw(pixel, column) for those of a row of the range until it says that one is not open.
  template <typename Draw>
  HWY_INLINE void DrawRow(const PixelRange& range, int row, int resolution, const Draw& draw) {
    std::uint64_t& open = rows_[std::size_t(row)];
    std::uint64_t left = open & Bits(range.column_begin, range.column_end);
    for (; left != 0; left &= left - 1) {
      const int column = std::countr_zero(left);
      if (!draw(std::size_t(row * resolution + column), column)) open &= ~(left & -left);
    }
  }

 private:
  static std::uint64_t Bits(int begin, int end) {
    return begin < end ? ~std::uint64_t{0} >> (64 - (end - begin)) << begin : 0;
  }
  static_assert(RasterGeometry::kMaxResolution <= 64);
  std::array<std::uint64_t, RasterGeometry::kMaxResolution> rows_;
};

void FindSeenPixels(const PacketCanvas& canvas, SeenPixels& seen) {
  const RasterGeometry& geometry = *canvas.geometry;
  const int size = geometry.resolution();
  const bool is_all_seen = canvas.rules->hasConeRaster();  // not a half space of the world
  const auto isSeen = [&](const glm::vec3& direction) HWY_ATTR {
    if (is_all_seen) return true;
    for (std::size_t lane = 0; lane < canvas.receiver_count; lane += kStep) {
      const Receivers receivers(*canvas.lanes, lane);
      const M above = hn::Gt(Dot(receivers.normal, direction), hn::Zero(D()));
      if (!hn::AllFalse(D(), hn::Or(receivers.spherical, above))) return true;
    }
    return false;
  };
  for (int i = 0; i < geometry.faceCount(); ++i) {
    SeenPixels::Face& face = seen.faces[std::size_t(i)];
    face.row_begin = face.row_end = 0;
    // What half spaces have of a row, and pixels between
    const RasterGeometry::Pixel* row = geometry.pixels().data() + i * size * size;
    for (int y = 0; y < size; ++y, row += size) {
      int begin = 0, end = size;
      while (begin < size && !isSeen(row[begin].direction)) ++begin;
      face.rows[std::size_t(y)] = {std::uint8_t(size), 0};
      if (begin == size) continue;
      while (!isSeen(row[end - 1].direction)) --end;
      face.rows[std::size_t(y)] = {std::uint8_t(begin), std::uint8_t(end)};
      if (face.isEmpty()) face.row_begin = y;
      face.row_end = y + 1;
    }
  }
}

}  // namespace
}  // namespace HWY_NAMESPACE
}  // namespace surfeit
HWY_AFTER_NAMESPACE();

#endif  // per-target guard
