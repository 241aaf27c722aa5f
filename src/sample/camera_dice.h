// Cuts a mesh for cameras (surfeit/camera_density.h; course notes 2010, "Point Generation").
//
// A triangle is halved at its longest edge, and the halves again, until a piece has at most sqrt(2)
// times the area that the cameras allow at its place. So pieces are always halves of halves of the
// same triangle: a camera that moves changes a few of them, and all others stay where they are.
//
// A triangle of less than 1 / sqrt(2) of that area is kept or left out by its number and that area
// alone ("Russian roulette"), and when kept has the area that makes up for those that are left out.
// Neighbours in the file have numbers that differ, so that of any 2^k of them about the right part
// stays. A long one may be kept in part.
#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include "sample/dice.h"
#include "sample/meshes/mesh.h"
#include "sample/surfel_maker.h"
#include "surfels/camera_spacing.h"

namespace surfeit {

// A piece of a triangle, by the halvings that lead to it.
struct CameraPiece {
  std::uint32_t triangle = 0;
  std::uint64_t path = 1;  // a leading one, then a bit for each halving
  double area = 0;
  Micropolygon polygon;
};

// In [0, 1): of the 2^k numbers from m 2^k on, each part of a length of 2^-k has one.
double rouletteNumber(std::uint64_t index);

// Immutable; safe from any thread. Mesh and spacing must outlive it.
class CameraDice {
 public:
  CameraDice(const Mesh& mesh, const CameraSpacing& spacing) : mesh_(mesh), spacing_(spacing) {}

  CameraPiece whole(std::uint32_t triangle) const;

  // Whether the piece is one surfel, or is to be halved.
  bool isSmall(const CameraPiece& piece) const;
  void halve(const CameraPiece& piece, CameraPiece (&halves)[2]) const;

  // At least as many as the piece will give.
  double mostPieces(const CameraPiece& piece) const;

  // Appends the parts of a small piece that become surfels: one, of a sliver several, and of a
  // triangle that is smaller than a surfel perhaps none.
  void appendParts(const CameraPiece& piece, std::vector<PiecePart>& parts) const;

 private:
  double allowedArea(const CameraPiece& piece) const;

  const Mesh& mesh_;
  const CameraSpacing& spacing_;
};

// All surfels of the mesh for the cameras, triangles along the curve. Dice and maker must outlive
// it.
std::unique_ptr<SurfelTasks> makeCameraTasks(const CameraDice& dice, const SurfelMaker& maker,
                                             std::vector<std::uint32_t> triangle_order);

}  // namespace surfeit
