// Clouds of one format as clouds of another: merged, moved, cropped and thinned on the way.
#pragma once

#include <array>
#include <cstdint>
#include <glm/vec3.hpp>
#include <optional>
#include <string>
#include <vector>

#include "surfeit/api.h"
#include "surfeit/job.h"
#include "surfeit/progress.h"
#include "surfeit/status.h"
#include "surfeit/up_axis.h"

namespace surfeit {

// Holds a position p when min <= p < max along every axis.
struct CropBox {
  glm::dvec3 min{0}, max{0};
};

// What is done to the records of every input, in this order: channels are named, every n-th record
// is taken, it is moved, cropped, given the channels that are kept, and thinned by a grid.
// `memory_bytes` bounds what a format takes that must hold what it writes until the end (OpenVDB),
// and what thinning by a grid sorts in; all else takes some MiB, whatever the clouds' size. 0
// stands for 2 GiB, or three quarters of what the job may hold where that is less. Temporary files
// are of thinning by a grid. `filter` comes before all else but `channels`. `threads` and `strict`
// change nothing.
struct ConvertOptions : JobOptions, ReadOptions {
  // Takes records 0, every, 2 every, ... of each input; at least 1. Those stand for all: area and
  // power (of photons) are multiplied by it, radius, pscale and width by its root.
  std::uint64_t every = 1;

  // Thins all inputs together to one record per cell of a grid with this edge, in units of what is
  // written, counted from 0: the one nearest to the middle of its cell, the first of several. It
  // stands for all of them: areas and powers are summed, radius, pscale and width grow by the root
  // of the ratio of the areas, or of the count where there is no area. Records keep their order;
  // those without a finite position are left out, which a note tells. The inputs are read twice.
  // Not together with `every`.
  std::optional<double> spacing{};

  // The rows of an affine 3x4 matrix: x' = t[0] x + t[1] y + t[2] z + t[3]. All in double
  // precision. Positions are points. Normals are turned by the inverse transpose and keep their
  // length, as do other directions (view, incident, bent_normal, illumination_direction); velocity
  // and other triples NAME_x NAME_y NAME_z are vectors, but for texture coordinates. radius, pscale
  // and width are multiplied by the cube root of |det|, area by its 2/3 power. Types stay, except
  // that integers become floats.
  std::array<double, 12> transform{1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0};
  // What is to be up, by a quarter turn before the transform: from the axis that the first input
  // states, else from the other one of y and z.
  std::optional<UpAxis> up{};
  std::optional<CropBox> crop{};  // only these positions, as they are written

  // Channels by name (docs/files.md), or single properties. With `keep` only these and the
  // position; without those of `drop`. Only one of the two may be given.
  std::vector<std::string> keep{}, drop{};

  // A cloud of the output's format that it takes from what rows do not carry: the windows and
  // attributes of a picture (.exr), the grid of a volume (.vdb), the camera of a .ptc, the header
  // of a .las. Empty: the input, where there is only one, which is not moved.
  std::string like{};
};

struct ConvertStats {
  std::uint64_t records = 0;                        // of all inputs
  std::uint64_t skipped_records = 0;                // left out by `every`
  std::uint64_t cropped_records = 0;                // left out by `crop`
  std::uint64_t thinned_records = 0;                // left out by `spacing`
  std::uint64_t placeless_records = 0;              // of these, without a finite position
  std::uint64_t written_records = 0;                // handed to the writer
  std::uint64_t input_bytes = 0, output_bytes = 0;  // of the files
  std::vector<std::string> properties;              // of a record that is written: "float x"
};

// Writes `output`, whose format is told by its name, from the records of all inputs, one after the
// other; their formats are told by what they hold (docs/files.md). The output has all properties of
// all inputs, of types that hold the values of each; what an input lacks is 0. It appears under its
// name only when complete. Notes tell of what is absent, and what the formats cannot keep.
// Errors: kInvalidArgument (options, a name of no format that is written, or rows that it cannot
// hold), kCorruption naming file and record, kBudgetTooSmall, kIoError, kInterrupted.
SURFEIT_API Result<ConvertStats> convertClouds(const std::vector<std::string>& inputs,
                                               const std::string& output,
                                               const ConvertOptions& options, Progress& progress);

}  // namespace surfeit
