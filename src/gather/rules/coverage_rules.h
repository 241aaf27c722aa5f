// Numbers that say how contributions cover pixels; docs/algorithm.md, "Coverage" and "The raster
// cube", has their measured effect. The scalar rasters and the packet kernel share them.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>

#include "core/spherical_harmonics.h"

namespace surfeit {

// How far before and behind its middle a contribution meets others of its layer: hardly more than
// it extends, by its variance along the direction, so that tiles of one surface meet whether they
// are seen head-on or aslant, and no rounding decides; and at least a part of its radius. Less
// tears surfaces apart, more joins what is apart (AO RMSE and bias with 1.1 and 1 times as far:
// bunny .0031 and -.0019, .0039 and -.0027; city .0061 and +.0034, .0058 and +.0028).
inline float layerReach(float radius, float variance) {
  constexpr float kLeastReach = 0.55f, kDepthReach = 1.05f;
  return std::max(kLeastReach * radius, kDepthReach * std::sqrt(std::max(0.f, 3 * variance)));
}
// Of a disk, seen at an angle with this cosine; of a sphere that of a disk along the direction.
inline float layerReachOfDisk(float radius, float cosine) {
  return layerReach(radius, 0.25f * radius * radius * (1 - cosine * cosine));
}

// What begins farther than its layer ends begins a new one: in part where the gap is narrower than
// this many times its reach (layerReach), or else results would step from one receiver to the next
// where the gap closes. (Largest jumps of irradiance along lines on the wall and the back of a box,
// bench/line_steps.sh at .11 sr, without: .25 and .50 %, so .10 and .37. AO RMSE of spheres at
// standard and draft quality with 0, .5, 1: .0041, .0041, .0042; .0083, .0085, .0089.)
inline constexpr float kLayerGap = 0.5f;
// And what no more than touches a pixel hardly says how far its layer reaches there: a patch says
// so in full where it covers this part of the pixel or has this part of its area, and that of an
// area of kLeastTouched where it is smaller, or traced. (Without, jumps on the wall and the back
// are .19 and .41 %; more than .05 tears tiles of slanted planes apart.)
inline constexpr float kTouch = 0.02f, kLeastTouched = 0.05f;
inline float inverseLayerGap(float reach) { return 1 / std::max(kLayerGap * reach, 1e-30f); }
inline float newLayerPart(float gap, float reach) {
  return std::clamp(gap * inverseLayerGap(reach), 0.f, 1.f);
}
// `area`: what a patch covers in all, in pixels; 0 of what is traced.
inline float touchPart(float amount, float area) {
  return std::min(1.f, amount / (kTouch * std::clamp(area, kLeastTouched, 1.f)));
}

// What lies behind a half-covered pixel shows beside what covers it. How much of it does depends on
// where in the pixel either is. What lies anywhere hides each other at random; but outlines of what
// stands on the same ground rise from the same side, and the smaller lies behind the larger. This
// part of surfaces counts as such, the rest as lying anywhere, and so do leaves, hair, particles,
// and rough nodes, of which nobody knows. (Of 4,000 flames a twelfth of the light was lost, test
// HotSpots. AO RMSE and bias of packets with .13 sr, 14 pixels and fills from .86 on, with 0, .3
// and 1: city .0059 and +.0028, .0053 and +.0018, .0053 and -.0008; lion on a plane .0044 and
// +.0014, .0038 and
// +.0003, .0046 and -.0024; spheres .0055 and +.0025, .0045 and -.0007, .0128 and -.0097. Leaves,
// if they count as well, with .5: -.03 of bias.)
inline constexpr float kNested = 0.3f;
inline float nestedPart(bool is_surface, float thicket) {
  return is_surface ? kNested * (1 - thicket) : 0;
}

// What a layer leaves open that covers `layer` of a pixel, of which `room` was open before it.
inline float openBehind(float room, float layer, float nested) {
  const float rest = 1 - layer, apart = room * rest;
  return apart + nested * (std::min(room, rest) - apart);
}

// What lies where in a pixel counts by its own weight there. Of what was open, and of the weight
// that was left, this part of the weight goes to what covers `covered`, the middle of which weighs
// `weight` beside the middle of the pixel. What lies by itself takes its own; what takes all that
// is open, all that is left: that tells what the middle of a patch that is half hidden does not.
inline float takenWeight(float covered, float open, float rest, float weight) {
  if (!(covered > 0)) return 0;
  const float part = covered / open;
  return std::clamp(covered * (1 - part) * weight + part * part * rest, 0.f, rest);
}

// What hides, hides: patches have exact areas, and these scatter around what a pixel of a surface
// holds, so sums alone would let through what lies behind. So a pixel also knows which of its 4 by
// 4 samples lie within the hull, the union of the patches, each widened (docs/algorithm.md,
// "Closing"). Where the hull, narrowed again by as much, holds the pixel, a surface goes on there,
// and what is left open before its layer ends is closed. Holes narrower than twice the widening
// close so; outlines stay where they are, and areas, and with them power, are not touched.
inline constexpr int kHullSide = 4;  // samples along a pixel
inline constexpr std::uint32_t kHullSamples = 0xffff;
// Patches are widened by this part of half their side, at least by 1 sample and at most by a pixel;
// spheres, two-sided surfels and rough nodes, which may stand alone, are not. (AO RMSE and bias
// with .7, .75, .8, .9: scattered receivers around the bunny .0054 and -.0012, .0046 and -.0011,
// .0042 and -.0010, .0037 and -.0009; city .0049 and +.0026, .0052 and +.0028, .0053 and +.0030,
// .0057 and +.0033; behind a ball .0000 of the light arrives, and of 400 random scenes 99 % are
// within .027 to .028, with all. With rough nodes widened, spheres .0128. bench/versus_embree,
// bench/leaks)
inline constexpr float kHullWidening = 0.75f;
inline int hullWidening(float half_width, float half_height) {  // in samples
  const float widening = kHullWidening * float(kHullSide) * std::sqrt(half_width * half_height);
  return int(std::clamp(widening + 0.5f, 1.f, float(kHullSide)));
}
// In pixels. Samples are of the hull as a whole or not at all: half of one is to spare, or else
// rounding would tear tiles apart. (What stands alone has none: small balls would grow.)
inline float hullWider(float widening) { return (widening + 0.5f) / float(kHullSide); }
// What is ray traced tells of the middle of a pixel alone, so it is of the hull in all of a pixel
// or in none, whichever is nearer.
inline constexpr float kTracedHull = 0.5f;

// Samples are bits, column by column: 4 column + row.
constexpr std::uint32_t hullSample(int column, int row) { return 1u << (kHullSide * column + row); }

// Samples of the neighbour in direction (x, y) that lie within `widening` samples of the pixel.
constexpr std::uint32_t hullBorder(int x, int y, int widening) {
  std::uint32_t samples = 0;
  for (int row = 0; row < kHullSide; ++row) {
    for (int column = 0; column < kHullSide; ++column) {
      const int dx = x < 0 ? kHullSide - column : x > 0 ? column + 1 : 0;
      const int dy = y < 0 ? kHullSide - row : y > 0 ? row + 1 : 0;
      if (dx <= widening && dy <= widening) samples |= hullSample(column, row);
    }
  }
  return samples;
}

// The samples [begin, end) of 4 in a row or column that starts at `at`, of what reaches from `low`
// to `high`; all in pixels.
struct HullRun {
  int begin, end;
  static HullRun of(float low, float high, float at) {
    const float scale = float(kHullSide);
    return {int(std::clamp(std::ceil(scale * (low - at)), 0.f, scale)),
            int(std::clamp(std::floor(scale * (high - at)), 0.f, scale))};
  }
  std::uint32_t columns() const {
    return begin < end ? (1u << kHullSide * end) - (1u << kHullSide * begin) : 0u;
  }
  std::uint32_t rows() const { return begin < end ? ((1u << end) - (1u << begin)) * 0x1111u : 0u; }
};

// Two-sided surfels that no plane holds together, rough nodes of them and nodes of several facets,
// are thickets: leaves, or hair. They lie before and behind each other anywhere, so nodes hide
// behind their own layer as behind others, layers of facets and of pieces of ribbons reach this
// part as far, and gaps between all of them are open. (docs/gather_steps.md has the errors without
// each.)
inline constexpr float kThicketReach = 0.15f;

// The outline of a thicket, over that of an ellipse with its covariance: a ball full of leaves has
// as much, and then what a thicket covers does not depend on how large its nodes are. (AO bias of
// leaves with nodes of .05, .1 and .4 sr, nothing shared: with 1.25 +.0024, +.0008, -.0002; with
// 0.95 .0000, -.0028, -.0084.)
inline constexpr float kThicketOutline = 1.25f;

// What things of this area hide of an outline, spread in it at random (Beer and Lambert).
inline float thicketOpacity(float area, float outline) { return 1 - std::exp(-area / outline); }

// A receiver without a normal is itself a sphere of a cloud without normals. Spheres of its own
// surface, closer than this many of their radii, do not count: they overlap it at random depths,
// and how much each sticks out is noise of the sampling (speckle), not occlusion.
inline constexpr float kSphereClearance = 3;

// A face on which a direction lies farther out than 1 / this gets nothing of what is there.
inline constexpr float kLeastAxis = 0.3f;

// Rays through the middles of pixels tell what a near surfel covers, of a patch the area does: a
// thin one differs by parts of a pixel. So from the border of the near field to kWholeNear of that
// distance it is both, in parts that add up. (Largest step of irradiance along the floor of a box,
// below a sphere, where levels hardly change: .90 % of its mean at a hard border, .67 % so;
// bench/line_steps.sh --max-solid-angle 0.002.)
inline constexpr float kWholeNear = 0.875f;
// Finite and positive, for a surfel may be at a receiver; then it is near at any setting.
inline float nearBorderSq(float near_distance) {
  return std::clamp(near_distance * near_distance, std::numeric_limits<float>::min(),
                    std::numeric_limits<float>::max());
}
// How much of what is so far away is ray traced; `border_sq`: nearBorderSq.
inline float nearPart(float distance_sq, float border_sq) {
  return std::clamp((1 - distance_sq / border_sq) / (1 - kWholeNear * kWholeNear), 0.f, 1.f);
}

// The least spread of a disk on a face: keeps one that is seen edge-on from becoming a line.
inline constexpr float kLeastSpread = 1.f / 64;

// Area over squared distance that the second-order terms of a footprint count at most.
inline constexpr float kMostExtent = 1;

// What the bias of rays counts for a two-sided surfel whose middle is this many of its radii above
// the horizon of the receiver: disks of the receiver's own surface have their middles in its plane,
// or beneath. What rises higher crosses it or hangs over it, and would be looked through; what is
// one-sided turns its back then, and has the whole bias (without, color of the lion on a plane at
// final quality 1.03 instead of .95 %). AO RMSE and color of leaves .0081 and 1.7 %, with a full
// bias .0110 and 2.4 %; .02 to .1 radii do the same.
inline constexpr float kBiasHeight = 0.05f;
inline float biasPart(float height_in_radii) {
  return std::clamp(1 - height_in_radii / kBiasHeight, 0.f, 1.f);
}

// The disk of a surfel circumscribes its piece of the surface, or is spread out as far: that of a
// cell 27 times as long as wide (rows of a scan) has this times the root of the area as radius,
// sqrt((1 + a^2) / (3 a)). For a longer sliver it says nothing about where the surface is, so disks
// count as no wider.
inline constexpr float kLargestRadius = 3.f;
inline float effectiveRadius(float radius, float area) {
  return std::min(radius, kLargestRadius * std::sqrt(area));
}

// A two-sided surfel that has less than this part of its disk is a piece of a ribbon, hair or
// grass, and a thicket by itself; but it does not overlap, for pieces of one ribbon lie side by
// side. (AO RMSE and bias of hair .0201 and +.0006, without this .0226 and +.0082.)
inline constexpr float kRibbonPart = 0.15f;
static_assert(kRibbonPart * kPi * kLargestRadius * kLargestRadius > 1,
              "effective radii tell the same");
inline bool looksLikeRibbon(float radius, float area) {
  return area < kRibbonPart * kPi * radius * radius;
}
// Where the longer side is known, it is one when so many times as long as wide. (Hair, with 2, 4,
// 8: .0084 and +.0023, .0085 and +.0026, .0093 and +.0039; leaves, whose pieces are shorter, .0069,
// and .0096 if they were pieces of ribbons.)
inline constexpr float kRibbonElongation = 3;

// Such a piece meets others of its layer this part of what it extends before and behind its middle,
// and a little of its width, so that no rounding decides. With all of it, the pieces of one ribbon
// that leads away from the receiver would be of one layer, but other ribbons as well. (Hair at 40
// pixels with .15, .5, .7, 1: color .89, .73, .70, .75 %; bias of AO at 16 pixels +.0007, +.0012,
// +.0017, +.0050.)
inline constexpr float kRibbonReach = 0.5f;
inline constexpr float kRibbonDepth = 0.02f;
// Of a ribbon's width the rays begin this part of the bias above the receiver: its pieces are flat,
// and another ribbon may pass as close. (With the whole bias one receiver of 2,048 looks through
// such a one: AO RMSE .0076 instead of .0070.)
inline constexpr float kRibbonBias = 1.f / 3;
// Ribbons grow in tufts, side by side: this part of them hides as if behind the same side of a
// pixel (kNested), the more, the larger the pixels are. (AO bias of hair at 16
// pixels with 0, .04, .12: +.0034, +.0027, +.0012; at 40 pixels +.0026, and +.0009 with .05.)
inline float ribbonNested(float pixels_per_slope) {
  return std::min(kNested, 1 / std::max(pixels_per_slope, 1.f));
}

// What the soft disks of the near field cover, over the surfels' areas: more than 1, so that they
// leave no gaps where the pieces are irregular. With 1 surfaces have holes, with 2 thin things
// cover too much. (AO RMSE with disks that cover fully, 1, 1.6, 2: lion on a plane .0164, .0115,
// .0108, .0110; bunny .0050, .0070, .0031, .0031.) Two-sided ones are of leaves, ribbons and hair,
// which lie alone. (Hair, AO RMSE and bias: .0491 and +.0402 with 1.6, .0407 and +.0302 with 1.)
inline constexpr float kSoftDiskArea = 1.7f, kTwoSidedSoftDiskArea = 1;

// Coverage in the middle of a soft disk, which falls off as 1 - (distance / radius)^2 and is
// limited to 1, such that the whole disk covers that many times `area`.
inline float softDiskPeak(float radius, float area, bool is_two_sided) {
  const float covered = (is_two_sided ? kTwoSidedSoftDiskArea : kSoftDiskArea) * area;
  const float share = std::min(0.95f, covered / (kPi * radius * radius));
  return share < 0.5f ? 2 * share : 1 / (2 * (1 - share));
}

// A rough node covers at most this part of its outline, which is that of an ellipse with its
// covariance: a ball covers 3/4 of that, a rectangle 0.95. (AO bias with .8, .87, 1: lion on a
// plane -.0002, +.0017, +.0029; bunny -.0035, -.0027, -.0024; Sponza -.0039, -.0027, -.0023.)
inline constexpr float kFilledOutline = 0.87f;

// What a rough node looks like from close by differs from its projected area by no more than this
// part: beyond, first order says nothing.
inline constexpr float kMostTurn = 0.3f;

// A node that is seen mostly from behind shows fronts that face each other: folds, bumps and
// leaves, which hide each other instead of lying side by side. Overlap grows from 0 where fronts
// and backs are equal (anything closed) to 1 where backs are 9/5 of the fronts. (AO bias of packets
// with 0.1 sr and 16 pixels, with a gain of 4 and 10: lion on a plane +.0002, -.0014; spheres
// +.0014, +.0008.)
inline float overlapOf(float front_area, float back_area) {
  constexpr float kGain = 3.5f;
  return std::clamp(kGain * (back_area - front_area) / (back_area + front_area), 0.f, 1.f);
}

}  // namespace surfeit
