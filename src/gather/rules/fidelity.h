// The numbers that decide how true a gather is: what it may leave out, how patches look and how
// they cover pixels. Beside them count the options of the caller, the kinds of nodes (octree/node)
// and what is interpolated (interpolation_limits.h). docs/algorithm.md has the rules, and
// bench/internal/sensitivity.cpp measures the worth of each number.
#pragma once

namespace surfeit {

struct Fidelity {
  // --- The cut (docs/algorithm.md, "Choosing the cut") ---

  // Radians, 0 to .1. What rises less above the horizon is dropped: a full circle of it covers the
  // square of this, .0001 of the hemisphere. (0: errors are the same, but a third more nodes are
  // visited, for .79 and .94 of the rate at dense and scattered receivers of the bunny.)
  float horizon_slope = 0.01f;

  // Part, 0 to 1, of the max solid angle that a node may fill which is not flat. Flat nodes are
  // tiles of a surface; of corners and thickets a receiver sees a part. (With 1 rates are 1.1 to
  // 1.3 times as high, but irradiance of the koala under a lamp is off by 4.2 % of its mean, with
  // 2/3 by 3.8, and of the light behind a ball of 50,000 disks .0042 leaks.)
  float uneven_share = 2.f / 3;

  // Part, 0 to .5, of the greatest solid angle by which a node fades into what is below it.
  // Without, results step from one receiver to the next, by 2 % of the light along a line in a box
  // (bench/line_steps.sh); errors are the same.
  float fading = 0.05f;

  // Pixels. No node is drawn as a larger patch: its own shape would be seen. So finer pixels
  // converge, whatever the max solid angle. (Covered of a closed shell of 20,000 disks at 32 and 64
  // pixels: .998 and .995; with .1 sr .991 and .982. bench/leaks)
  float most_node_pixels = 6.5f;

  // Times. A cone's max solid angle is this many times its share of the hemisphere. (light_bench,
  // glossy .2: error .030 with 4, .034 with 10, at 1.3 and .7 times the time of bleeding.)
  float cone_share = 10;
  // Weight at which a glossy lobe ends.
  float lobe_end = 0.01f;

  // --- What nodes look like ("Contributions") ---

  // Part, 0 to .1, of a node's area. One that shows less shows nothing: three bands cannot tell so
  // little from zero, and dividing power by it would make up bright specks.
  float least_visible_part = 0.01f;

  // Radians, 0 to 1: receivers of a packet that see a rough node up to so far aside of the packet's
  // centre take it as the centre sees it; so they do how bright a curved piece is. 0: none do.
  // (Irradiance at 400 receivers of a bunny under a point light: .0417 with 1e9, .0390, .0372,
  // .0362, .0360 with 1, .5, .25, .12 and by each for itself; times differ by 2 %.)
  float shared_look = 0.25f;

  // --- Things in a pixel ("Coverage", "Closing") ---

  // Radii of a packet, from its centre, within which patches are drawn to each receiver in the
  // order of its own distances. Patches in one direction of a receiver need 1 (OwnOrders); those
  // that lie beside each other need more. (Light of 100,000 receivers of a city of as many surfels
  // beside each of them alone, rms over the mean: 12.5 % with 0, 5.4 with 1, 1.6 with 1.5, 1.5 with
  // 2, for 1, 1.1, 1.3, 1.4 times the time.)
  float own_order = 1.5f;

  // Part of its outline, the ellipse with its covariance, that a flat node or facet fills for its
  // hull to be widened. One that fills less has gaps, as a fence has, and they stay open. (A
  // rectangle fills .95, a triangle or an L .83, two squares that touch at a corner .72, boards
  // with gaps as wide as they are .48.)
  float least_filled = 0.7f;

  // Standard deviations. Of n random samples of a surface, what a node fills scatters by 1 /
  // sqrt(n) of it. One that falls short of `least_filled` by less than so many of them may be a
  // surface. Two-sided samples may be leaves as well, and have no such benefit. (0, 1, 1.5: a plane
  // of random samples with noise of .2 spacings covers .045, .029, .020 less than it should. Fences
  // cover the same with all three, from 2 on .02 more.)
  float fill_doubt = 1.5f;

  // Part of half its side by which a patch is widened in the hull. (AO RMSE with .7, .75, .8, .9:
  // bunny, scattered .0054, .0046, .0042, .0037; city .0049, .0052, .0053, .0057.)
  float hull_widening = 0.75f;

  // Surfels. Hulls of nodes with more are left out, for what many show has an outline that the
  // hulls of its parts follow better. (Of random_scenes 0..399, 11 are off by more than .01 without
  // hulls of nodes, the worst by .0352; none with 64, nor with any number, the worst by .0095. With
  // any number, 2 % of the light behind a ball of 50,000 disks leaks at draft quality.)
  float most_in_hull = 64;

  // --- The near field ("The raster cube") ---

  // Times the area of a surfel that its soft disk covers, so that disks of a surface leave no gaps;
  // loose and translucent ones cover their area, and two-sided ones that even this does not fill
  // and that are no tiles (core/long_side.h).
  // (AO RMSE with disks that cover fully, 1, 1.6, 2: lion .0164, .0115, .0108, .0110; bunny .0050,
  // .0070, .0031, .0031.)
  float soft_disk_area = 1.7f;

  // --- Footprints ("The raster cube") ---

  // Cosine. A face on which a direction is farther aside gets nothing of what is there.
  float least_axis = 0.3f;
  // Spread over area that a patch has at least on a face: seen edge-on, it is no line.
  float least_spread = 1.f / 64;
};

// bench/sensitivity changes them; everywhere else they are constants.
#ifdef SURFEIT_CHANGES_FIDELITY  // bench/internal/CMakeLists.txt
inline Fidelity kFidelity;
#else
inline constexpr Fidelity kFidelity;
#endif

}  // namespace surfeit
