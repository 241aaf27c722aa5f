// Every number that decides how true a gather is, but the options of the caller: what it may leave
// out, how patches look and how they cover pixels. docs/algorithm.md has the rules that they belong
// to. bench/sensitivity measures what each is worth over three sets of scenes: those that errors
// are reported for, those that no number was chosen by, and scenes by chance. Percentages below are
// what it prints without the rule (or else with .7 and 1.4 times the number): changes of the RMSE
// of occlusion on the three sets, at 1 M surfels. docs/decisions.md lists what was deleted because
// it moved none of them by a twentieth.
#pragma once

namespace surfeit {

struct Fidelity {
  // --- The cut (docs/algorithm.md, "Choosing the cut") ---

  // Part, 0 to 1, of the max solid angle that a node may fill which is not flat. Flat nodes are
  // tiles of a surface; of corners and thickets a receiver sees a part. (+6, +3, +11 %)
  float uneven_share = 2.f / 3;

  // Times. Where directions weigh by the cosine, a node that is not flat may look larger by one
  // over the cosine of its highest point, up to this. (1: -1, -1, -2 %, for a quarter more
  // patches.)
  float most_coarser = 4;

  // Part, 0 to .5, of the greatest solid angle by which a node fades into what is below it.
  // Without, results step from one receiver to the next, by 2 % of the light along a line in a box
  // (bench/line_steps.sh); errors are the same.
  float fading = 0.05f;

  // Pixels. No node is drawn as a larger patch: its own shape would be seen. So finer pixels
  // converge, whatever the max solid angle. (Nothing at standard quality. Covered of a closed shell
  // of 20,000 disks at 32 and 64 pixels: .998 and .995; without .991 and .982. bench/leaks)
  float most_node_pixels = 6.5f;

  // Times. A cone's max solid angle is this many times its share of the hemisphere. (light_bench,
  // glossy .2: error .030 with 4, .034 with 10, at 1.3 and .7 times the time of bleeding.)
  float cone_share = 10;
  // Radians. Wider cones are a part of the cube: their outermost pixels would be too narrow.
  float widest_cone_raster = 1.05f;
  // Weight at which a glossy lobe ends.
  float lobe_end = 0.01f;

  // --- What nodes look like ("Contributions") ---

  // Part, 0 to .1, of a node's area. One that shows less shows nothing: three bands cannot tell so
  // little from zero, and dividing power by it makes bright specks. (Color +214, +17, 0 %)
  float least_visible_part = 0.01f;

  // Where between the least and the greatest area that its moments allow a rough node is, 0 to 1:
  // that of evenly spread normals, which follows from their moments. (+8, 0, 0 % with .9)
  float upwards = 0.64f;

  // Part, 0 to 1, of its outline that a rough node covers at most, the outline being an ellipse
  // with its covariance: a ball covers 3/4 of that, a rectangle .95. (+3, -1, +8 %)
  float filled_outline = 0.87f;

  // Times. Overlap of a rough node that shows more back than front: 1 where backs are 9/5 of the
  // fronts. (+11, -1, 0 %)
  float overlap_gain = 3.5f;

  // Outline of a thicket over that of its ellipse: that of a ball full of leaves. (.9: +7, +1, 0 %)
  float thicket_outline = 1.25f;

  // --- Hulls ("Closing") ---

  // Part of half its side by which a patch is widened in the hull. (0: +5, +27, +35 %)
  float hull_widening = 0.75f;
  // Part of a pixel from which on what is ray traced is of the hull: the nearer of all and nothing.
  float traced_hull = 0.5f;

  // --- The near field ("The raster cube") ---

  // Times. A two-sided surfel so many times as long as wide is a piece of a ribbon: hair or grass,
  // which lies before and behind others anywhere. (+8, -1, +1 %)
  float ribbon_elongation = 4;
  // Part of a disk, 0 to 1. So is one whose longer side is not known and that has less of its disk.
  // (None in the sets. Of ribbons spread at random .78 is covered without, where .63 is right; test
  // LeavesAndRibbonsCoverAsMuchAsWhatIsSpreadAtRandom.)
  float ribbon_part = 0.15f;
  // Part of its length for each radius of the near field within which a ribbon is ray traced.
  // (0: +36, +4, +2 %)
  float ribbon_radius = 0.25f;

  // Times the area of a surfel that its soft disk covers, so that disks of a surface leave no gaps;
  // two-sided ones lie alone and cover their area. (1: +92, +85 %)
  float soft_disk_area = 1.7f;

  // Part, 0 to 1, of the near field's distance. From there to its border a surfel is both, ray
  // traced and a patch. (.999: +1, +3 %)
  float whole_near = 0.875f;

  // Radii. A two-sided surfel whose middle is so far above the horizon has no bias: it is not of
  // the receiver's own surface. (The exact gather of random scenes changes by .01 without.)
  float bias_height = 0.05f;

  // Radii. A receiver without a normal is a sphere itself: closer spheres are its own surface, and
  // how far each sticks out is noise of the sampling.
  float sphere_clearance = 3;

  // --- Footprints ("The raster cube") ---

  // Cosine. A face on which a direction is farther aside gets nothing of what is there. (.2: +5,
  // +2, +3 %)
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
