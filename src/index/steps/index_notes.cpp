#include "index/steps/index_notes.h"

#include <fmt/format.h>

#include <string>
#include <utility>
#include <vector>

#include "core/bounds.h"
#include "core/crs_comment.h"
#include "index/notes/radius_note.h"
#include "index/notes/stray_note.h"

namespace surfeit {
namespace {

void noteLikelyDegrees(const CloudTotals& totals, const glm::dvec3& origin, Progress& progress) {
  std::vector<glm::vec3> places;
  for (const Surfel& surfel : totals.sample) places.push_back(surfel.position);
  if (places.empty()) return;
  Bounds3d bounds = usualBounds(places);
  bounds.min += origin;
  bounds.max += origin;
  const std::string degrees = noteOfLikelyDegrees(bounds);
  if (!degrees.empty()) progress.note(degrees);
}

}  // namespace

void noteStrays(const CloudTotals& totals, const glm::dvec3& origin, bool is_origin_asked,
                Progress& progress) {
  std::vector<glm::vec3> places;
  for (const Surfel& surfel : totals.sample) places.push_back(surfel.position);
  const std::string strays = strayNote(places, totals.bounds, origin);
  if (!strays.empty()) progress.inform(strays);
  std::string loss = lossByStrays(places, totals.bounds, origin, totals.surfels, is_origin_asked);
  if (loss.empty()) loss = lossByDistance(places, totals.bounds, origin, totals.surfels);
  if (!loss.empty()) progress.note(loss);
}

// A gather computes with cubes of lengths in floats. (A sphere of 2,000 surfels of radii a 40th of
// its width: irradiances are right down to a width of 2e-12, a quarter of that at 2e-13, none at
// 2e-18.)
void noteSmallness(const CloudTotals& totals, Progress& progress) {
  constexpr float kLeastWidth = 1e-9f;
  const float width = totals.bounds.longestSide();
  if (!(width > 0 && width < kLeastWidth)) return;
  progress.note(fmt::format(
      "warning: the cloud is only {:.3g} wide: floats hold no cubes of such lengths, and "
      "what is gathered from clouds below {:g} may be wrong (convert --units km:mm makes "
      "it a million times as large)",
      width, kLeastWidth));
}

// A quantized scene has an albedo of 1 at most.
void noteBrightness(const CloudTotals& totals, const CloudReader& reader, bool full_precision,
                    Progress& progress) {
  if (totals.bright == 0) return;
  progress.note(fmt::format(
      "{} of {} surfels have an albedo above 1, up to {:.4g}, and so would reflect more light than "
      "they get: {}; {}convert --set \"albedo = min(albedo, 1)\" makes 1 the most",
      totals.bright, totals.surfels, totals.largest_albedo,
      full_precision ? "it is kept (--precision full)" : "it is 1 in the scene",
      reader.albedoAdvice()));
}

void noteIndexRules(const CloudTotals& totals, const CloudReader& reader,
                    const IndexOptions& options, Progress& progress) {
  for (const std::string& note : reader.notesOfFloats(totals)) progress.note(note);
  if (reader.crs().empty()) noteLikelyDegrees(totals, reader.origin(), progress);
  noteStrays(totals, reader.origin(), true, progress);
  noteSmallness(totals, progress);
  if (std::string radii = noteOfRadii(totals.sample, totals.surfels, reader.sizeNames());
      !radii.empty()) {
    progress.note(radii);
  }
  if (const std::string gaps = noteOfGaps(totals.sample, reader.sizeNames()); !gaps.empty()) {
    progress.inform(gaps);
  }
  noteBrightness(totals, reader, options.full_precision, progress);
  if (totals.missing_both > 0) {
    progress.note(
        fmt::format("{} surfels have neither radius nor area: both follow from the "
                    "cells among their neighbours, and disks stand in the middle of these",
                    totals.missing_both));
  }
  if (totals.covering > 0) {
    progress.note(fmt::format(
        "{} surfels have a coverage: it is multiplied by the area of the disk, or of the "
        "cell among their neighbours, whichever is smaller",
        totals.covering));
  }
  if (totals.missing_area > 0) {
    progress.note(fmt::format("{} surfels have no area: pi r^2 / {} is used", totals.missing_area,
                              options.disk_overlap));
  }
  if (totals.missing_radius > 0) {
    progress.note(fmt::format(
        "{} surfels have an area and no radius: the area stays; where the disk lies and how far it "
        "reaches follows from the cells among their neighbours, which takes time (convert --set "
        "\"radius = sqrt({} * area / 3.14159)\" makes disks around the places)",
        totals.missing_radius, options.disk_overlap));
  }
  if (totals.radius_from_area > 0) {
    progress.note(fmt::format("{} surfels have no radius: a disk of {} times the area is used",
                              totals.radius_from_area, options.disk_overlap));
  }
  if (totals.spheres == 0) return;
  if (options.normals) {
    progress.note(
        fmt::format("{} surfels have no normal: it follows from their neighbours", totals.spheres));
  } else {
    progress.note(
        fmt::format("warning: {} surfels have no normal: they are spheres, which look "
                    "the same from everywhere (--normals estimate finds some)",
                    totals.spheres));
  }
}

void noteRepeats(const IndexStats& stats, const IndexOptions& options, Progress& progress) {
  if (stats.repeated_surfels == 0) return;
  if (options.repeats == Repeats::kThin) {
    progress.inform(fmt::format("{} surfels repeat another at its place: they are left out",
                                stats.repeated_surfels));
  } else {
    progress.note(
        fmt::format("{} surfels repeat another at its place, and their areas count twice "
                    "(--overlap thin keeps one at a place, as tiles that overlap need)",
                    stats.repeated_surfels));
  }
}

void noteScatteredSurfels(const IndexStats& stats, Progress& progress) {
  if (stats.scattered_surfels == 0) return;
  progress.inform(
      fmt::format("{} surfels scatter about a surface: their disks stand on it, not at their "
                  "places (disks of a cloud with radius and area stay)",
                  stats.scattered_surfels));
}

void noteThinSurfels(const IndexStats& stats, const IndexOptions& options, Progress& progress) {
  if (stats.thin_surfels == 0) return;
  progress.inform(
      fmt::format("{} of {} surfels without a normal lie on no surface: they are {}",
                  stats.thin_surfels, stats.thin_surfels + stats.normals_found,
                  options.normals->thin_is_two_sided ? "seen from both sides" : "spheres"));
}

}  // namespace surfeit
