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

#include "gather/packet/packet_kernel.h"
#include "gather/packet/packet_lanes-inl.h"
#include "gather/packet/packet_things-inl.h"
#include "gather/rules/coverage_rules.h"

HWY_BEFORE_NAMESPACE();
namespace surfeit {
namespace HWY_NAMESPACE {
namespace {

// How some of the receivers' pixels are covered.
struct Cover {
  V depth_begin, depth_end;  // within which it meets others
  M is_lit;
  bool is_all_lit;
  bool is_alone;  // it belongs to no thing
  bool has_hull;
  bool is_solid;  // its hull is widened
  V opacity;
  TileLayers<float> layers;  // TileLayersOf
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

// The part of a pixel that is in these samples.
HWY_INLINE V PartOf(VU samples) {
  const auto count = hn::BitCast(DI(), hn::PopulationCount(samples));
  return hn::Mul(Splat(1.f / (kHullSide * kHullSide)), hn::ConvertTo(D(), count));
}

// Of a pixel of which the things before leave `room` open, and hold the part `held` of the samples:
// how much is open where something is, of which the part `behind` lies behind these samples. What
// is open lies beside them, as far as it has a place there.
HWY_INLINE V RoomAt(V behind, V held, V room) {
  const V zero = hn::Zero(D()), one = Splat(1), tiny = Splat(1e-6f);
  const V closed = hn::Sub(one, room);
  const V inside = hn::Max(zero, hn::Sub(one, hn::Div(closed, hn::Max(held, tiny))));
  const V beside = hn::Div(hn::NegMulAdd(held, inside, room), hn::Max(hn::Sub(one, held), tiny));
  return hn::Min(one, hn::Max(zero, hn::MulAdd(behind, hn::Sub(inside, beside), beside)));
}

// What is left open of a pixel of which something covers so much: at least `least`, unless it is
// alone.
HWY_INLINE V LeftOpen(float* pixel, V amount, V open, const Cover& cover, V room, V least) {
  const D d;
  if (cover.is_alone) {  // before all others, and behind them
    const V clear = hn::Sub(Splat(1), amount);
    hn::Store(hn::Mul(room, clear), d, pixel + PacketCanvas::kRoom * kStep);
    return hn::Mul(open, clear);
  }
  return hn::Max(hn::Min(open, least), hn::NegMulAdd(room, amount, open));
}

// Covers so much of a pixel where `amount` is positive, but leaves `least` of it open. `weight`: of
// the middle of what covers it, over that of its own.
template <typename Kind>
HWY_INLINE void CoverPixel(float* pixel, V amount, V weight, const Cover& cover, V room, V least) {
  const D d;
  float* const open_at = pixel + PacketCanvas::kOpen * kStep;
  const V open = hn::Load(d, open_at);
  const V left = LeftOpen(pixel, amount, open, cover, room, least);
  const V covered = hn::IfThenElseZero(hn::Gt(amount, hn::Zero(d)), hn::Sub(open, left));
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
