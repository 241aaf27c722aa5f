// Hair and other curves as ribbons of triangles (docs/surfels.md, "Hair and curves").
#pragma once

#include <cstdint>
#include <functional>
#include <glm/vec3.hpp>
#include <span>
#include <string>
#include <vector>

#include "sample/meshes/mesh_builder.h"
#include "surfeit/progress.h"
#include "surfeit/sample.h"
#include "surfeit/status.h"

namespace surfeit {

// A corner of a curve.
struct CurvePoint {
  glm::dvec3 position{0};
  double width = 0;  // diameter of the strand
  glm::vec3 color{1};
};

// Area of the strand as seen from the side: length times width.
double curveArea(std::span<const CurvePoint> points);

// Chooses which strands stand for all: of runs of equal length one each, by a hash, so that strands
// that were made in an order are thinned alike.
class StrandChoice {
 public:
  // Keeps `kept` of `count` strands; 0, or as many as there are: all.
  StrandChoice(std::uint64_t count, std::uint64_t kept);

  bool keepsAll() const { return kept_ == count_; }
  bool keeps(std::uint64_t strand) const;
  std::uint64_t keptCount() const { return kept_; }

 private:
  std::uint64_t count_, kept_;
};

// Appends strands to a mesh. A strand is one ribbon that does not twist, turned about the strand by
// a hash of its number, pi / 2 times as wide as the strand: so strands at all angles look on the
// average as wide as round ones. One thread at a time.
class CurveRibbons {
 public:
  // `material` is an index into the mesh's materials, and has two sides. With colors, the mesh has
  // one for every vertex so far.
  CurveRibbons(MeshBuilder& builder, std::uint32_t material, bool has_colors, std::string path)
      : builder_(builder), material_(material), has_colors_(has_colors), path_(std::move(path)) {}

  // Strand number `strand` with widths times `growth`. Corners at one place become one.
  // kCorruption, naming the strand, when a value is not finite.
  Status add(std::span<const CurvePoint> points, std::uint64_t strand, double growth);

  // Strands without length, which have no area.
  std::uint64_t pointlike() const { return pointlike_; }

 private:
  MeshBuilder& builder_;
  std::uint32_t material_;
  bool has_colors_;
  std::string path_;
  std::vector<CurvePoint> points_;
  std::uint64_t pointlike_ = 0;
};

// Takes strand number `strand`; the points last as long as the call.
using StrandVisit = std::function<Status(std::uint64_t strand, std::span<const CurvePoint> points)>;

// Appends all strands of a file, or those that stand for them (CurveOptions::strands), as ribbons
// of a material of their own, whose albedo is the color of the points. `for_each` visits every
// strand in order, and is called twice. Notes tell of strands without length. kCorruption where all
// strands together have no area, naming --curve-width; else the failures of `for_each`.
Status addStrands(const std::string& path, std::uint64_t count, const CurveOptions& options,
                  const std::function<Status(const StrandVisit& visit)>& for_each,
                  MeshBuilder& builder, Progress& progress);

}  // namespace surfeit
