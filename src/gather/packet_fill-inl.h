// Closes gaps within surfaces in the rasters of a packet; for one instruction set (see
// packet_kernel-inl.h). RasterCube::fill is the definition.
#if defined(SURFEIT_PACKET_FILL_INL_H_) == defined(HWY_TARGET_TOGGLE)
#ifdef SURFEIT_PACKET_FILL_INL_H_
#undef SURFEIT_PACKET_FILL_INL_H_
#else
#define SURFEIT_PACKET_FILL_INL_H_
#endif

#include <hwy/highway.h>

#include <cstddef>
#include <limits>

#include "gather/coverage_rules.h"
#include "gather/packet_kernel.h"
#include "gather/packet_lanes-inl.h"

HWY_BEFORE_NAMESPACE();
namespace surfeit {
namespace HWY_NAMESPACE {
namespace {

// The coverages of one face for kStep receivers, in the canvas' scratch space: of the rows that
// count.
class SurfaceFill {
 public:
  SurfaceFill(const PacketCanvas& canvas, const SeenPixels::Face& seen, bool has_thickets)
      : seen_(seen),
        row_begin_(seen.row_begin),
        row_end_(seen.row_end),
        size_(canvas.geometry->resolution()),
        has_thickets_(has_thickets),
        coverage_(canvas.fill_scratch),
        rows_(coverage_ + planeFloats()),
        surface_(rows_ + planeFloats()) {}

  // Takes the pixels that count: look(pixel) answers the coverage and what thickets have of it.
  // Then fills.
  template <typename Look>
  HWY_INLINE void Run(const Look& look) const {
    const V zero = hn::Zero(D());
    for (int row = row_begin_; row < row_end_; ++row) {
      const auto [begin, end] = seen_.rows[std::size_t(row)];
      for (int column = 0; column < size_; ++column) {
        const auto pixel = std::size_t(row * size_ + column);
        Sight sight = {zero, zero};
        if (column >= begin && column < end) sight = look(pixel);
        hn::Store(sight.coverage, D(), coverage_ + pixel * kStep);
        if (has_thickets_) hn::Store(SurfacePart(sight), D(), surface_ + pixel * kStep);
      }
    }
    FillRows();
  }

  struct Sight {
    V coverage, thicket;
  };
  V Coverage(std::size_t pixel) const { return hn::Load(D(), coverage_ + pixel * kStep); }

 private:
  // The part of what covers a pixel that is no thicket.
  static V SurfacePart(const Sight& sight) {
    const V least = Splat(std::numeric_limits<float>::min());
    return hn::Sub(Splat(1), hn::Div(sight.thicket, hn::Max(sight.coverage, least)));
  }

  void FillRows() const {
    for (const FillPass& pass : kFillPasses) {
      for (int row = row_begin_; row < row_end_; ++row) SumRow(row);
      for (int row = row_begin_; row < row_end_; ++row) FillRow(row, pass);
    }
  }

  std::size_t planeFloats() const { return std::size_t(size_) * std::size_t(size_) * kStep; }
  float* At(float* values, int row, int column) const {
    return values + std::size_t(row * size_ + column) * kStep;
  }

  // Sums of three neighbours along a row.
  void SumRow(int row) const {
    const D d;
    V before = hn::Zero(d), here = hn::Load(d, At(coverage_, row, 0));
    for (int column = 0; column < size_; ++column) {
      V after = hn::Zero(d);
      if (column + 1 < size_) after = hn::Load(d, At(coverage_, row, column + 1));
      hn::Store(hn::Add(hn::Add(here, before), after), d, At(rows_, row, column));
      before = here;
      here = after;
    }
  }

  void FillRow(int row, const FillPass& pass) const {
    const D d;
    const V zero = hn::Zero(d), one = Splat(1);
    const bool has_above = row > row_begin_, has_below = row + 1 < row_end_;
    const float part_scale = 1 / (pass.end - pass.begin);
    constexpr float kSeenScale = 1 / (kFilledWhole - kFilledFrom);
    for (int column = 0; column < size_; ++column) {
      const V coverage = hn::Load(d, At(coverage_, row, column));
      V box = hn::Load(d, At(rows_, row, column));
      if (has_above) box = hn::Add(box, hn::Load(d, At(rows_, row - 1, column)));
      if (has_below) box = hn::Add(box, hn::Load(d, At(rows_, row + 1, column)));
      const int columns = 1 + (column > 0) + (column + 1 < size_);
      const int count = columns * (1 + has_above + has_below) - 1;
      const V around = hn::Mul(hn::Sub(box, coverage), Splat(1 / float(count)));
      const V part = hn::Mul(hn::Sub(around, Splat(pass.begin)), Splat(part_scale));
      const V seen = hn::Mul(hn::Sub(coverage, Splat(kFilledFrom)), Splat(kSeenScale));
      V filled = hn::Mul(hn::Min(one, hn::Max(zero, part)), hn::Min(one, hn::Max(zero, seen)));
      if (has_thickets_) filled = hn::Mul(filled, hn::Load(d, At(surface_, row, column)));
      hn::Store(hn::MulAdd(filled, hn::Sub(one, coverage), coverage), d,
                At(coverage_, row, column));
    }
  }

  const SeenPixels::Face& seen_;
  const int row_begin_, row_end_, size_;
  const bool has_thickets_;
  float *const coverage_, *const rows_, *const surface_;
};

}  // namespace
}  // namespace HWY_NAMESPACE
}  // namespace surfeit
HWY_AFTER_NAMESPACE();

#endif  // per-target guard
