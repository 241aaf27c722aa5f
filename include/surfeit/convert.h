// Converts clouds from one format to another, and merges, moves, crops and thins them on the way.
#pragma once

#include <array>
#include <cstdint>
#include <glm/vec3.hpp>
#include <optional>
#include <string>
#include <vector>

#include "surfeit/api.h"
#include "surfeit/camera_density.h"
#include "surfeit/job.h"
#include "surfeit/progress.h"
#include "surfeit/status.h"
#include "surfeit/up_axis.h"

namespace surfeit {

// Holds a position p when min <= p < max along every axis.
struct CropBox {
  glm::dvec3 min{0}, max{0};
};

// The steps for the records of every input, in this order: rename channels, filter, take every n-th
// record, move, crop, drop channels, set channels, thin by a grid or for cameras.
// `memory_bytes` bounds the memory of OpenVDB output, which is held until it is written, and of
// thinning by a grid, which sorts. All else takes some MiB, for clouds of any size. 0 stands for
// 2 GiB, or for three quarters of the memory that the job may hold where that is less. Only
// thinning by a grid writes temporary files. `threads` and `strict` have no effect.
struct ConvertOptions : JobOptions, ReadOptions {
  // Takes records 0, every, 2 every, ... of each input; at least 1. A record that stays stands for
  // `every` records: area and power (of photons) are multiplied by `every`; radius, pscale and
  // width by its root.
  std::uint64_t every = 1;

  // Thins all inputs together to one record per cell of a grid. The edge of a cell is in units of
  // the output, and the grid has a corner at 0. The record nearest to the middle of its cell stays;
  // of several, the first. It stands for all records of the cell: areas and powers are summed;
  // radius, pscale and width grow by the root of the ratio of the areas, or of the count where
  // there is no area. Records keep their order. Records without a finite position are left out, and
  // a note reports them. The inputs are read twice. Not together with `every`.
  std::optional<double> spacing{};

  // With cameras, places in units of the output: thins as `spacing` does, by cells whose edges are
  // the power of two nearest to the size of a surfel for the cameras; their up axis is that of the
  // output. Parts of a cloud that are coarser stay as they are. Neither together with `every` nor
  // `spacing`.
  CameraDensity density{};

  // The rows of an affine 3x4 matrix: x' = t[0] x + t[1] y + t[2] z + t[3]. All computations are in
  // double precision. Positions are points. Normals are turned by the inverse transpose and keep
  // their length, as do other directions (view, incident, bent_normal, illumination_direction).
  // Velocity and other triples NAME_x NAME_y NAME_z are vectors, except texture coordinates.
  // radius, pscale and width are multiplied by the cube root of |det|, area by its 2/3 power. Types
  // stay, except that integers become floats.
  std::array<double, 12> transform{1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0};
  // The axis to be up in the output. A quarter turn before the transform brings it there: from the
  // axis that the first input states, else from the other one of y and z.
  std::optional<UpAxis> up{};
  std::optional<CropBox> crop{};  // only positions in this box, in the coordinates of the output

  // Channels by name (docs/files.md), or single properties. `keep`: only these and the position;
  // `drop`: all but these. Only one of the two may be given.
  std::vector<std::string> keep{}, drop{};

  // Channel arithmetic on the records of the output, in this order: "radiosity *= 0.5 where group
  // == 3" (docs/files.md, "Channel arithmetic"). Types stay: integers take the nearest number that
  // they hold. Well-known channels that no input has may be set, too. A note tells what did not
  // fit.
  std::vector<std::string> assignments{};

  // A file of the output's format. The output takes from it the data that is not in rows: the
  // windows and attributes of a picture (.exr), the grid of a volume (.vdb), the camera of a .ptc,
  // the header of a .las. Empty: the input, if there is only one and it is not moved.
  std::string like{};
};

struct ConvertStats {
  std::uint64_t records = 0;                        // of all inputs
  std::uint64_t skipped_records = 0;                // left out by `every`
  std::uint64_t cropped_records = 0;                // left out by `crop`
  std::uint64_t thinned_records = 0;                // left out by `spacing` or `density`
  std::uint64_t placeless_records = 0;              // of the thinned: without a finite position
  std::uint64_t written_records = 0;                // handed to the writer
  std::uint64_t input_bytes = 0, output_bytes = 0;  // of the files
  std::vector<std::string> properties{};            // of a written record: "float x"
  std::uint64_t memory_bytes = 0;                   // the budget
  std::uint64_t temporary_bytes = 0;                // of rows that waited for the end (LAS, PDB)
};

// Writes `output` from the records of all inputs, one input after the other. The name of `output`
// tells its format; the contents of the inputs tell theirs (docs/files.md). The output has all
// properties of all inputs, in types that hold the values of each; a property that an input lacks
// is 0. The file appears under its name only when complete. Notes report absent properties, and
// data that the format cannot keep.
// Errors: kInvalidArgument (options, a name without a format that can be written, or rows that the
// format cannot hold), kCorruption naming file and record, kBudgetTooSmall, kIoError, kInterrupted.
SURFEIT_API Result<ConvertStats> convertClouds(const std::vector<std::string>& inputs,
                                               const std::string& output,
                                               const ConvertOptions& options, Progress& progress);

}  // namespace surfeit
