// Partitions of the sphere into cells, and how much of a cell of one lies in a cell of another.
//
// Directions are those of a frame whose third axis points up: height h = d[2], azimuth the angle
// from the first axis towards the second. All grids here are cut along meridians: on one meridian
// every border of a cell is a height that a formula gives. In a slice between two azimuths a border
// counts at its mean height, which is an integral with a closed form; so a slice holds of every
// cell the exact area, as long as no two borders cross within it, and d(area) = d(azimuth)
// d(height).
#pragma once

#include <array>
#include <cstddef>
#include <glm/vec3.hpp>
#include <glm/vec4.hpp>
#include <span>
#include <vector>

namespace surfeit {

inline constexpr double kTurn = 6.283185307179586476925;  // 2 pi

// In a slice, a cell reaches from the end of the one before it, at first 1, down to a height.
struct MeridianCut {
  double end;
  std::size_t cell;
};

// Immutable.
class SphereGrid {
 public:
  virtual ~SphereGrid() = default;
  virtual std::size_t cellCount() const = 0;
  // Appends the azimuths, 0..2 pi, at which slices must begin.
  virtual void appendBreaks(std::vector<double>& breaks) const = 0;
  // The cells from height 1 to -1 in the slice [begin, end) of azimuths, 0..2 pi, without a break
  // in it. Ends do not rise; the last is -1.
  virtual void cut(double begin, double end, std::vector<MeridianCut>& cuts) const = 0;
};

// A lat-long picture: rows from the top, columns from azimuth pi down to -pi.
class LatLongGrid final : public SphereGrid {
 public:
  LatLongGrid(int width, int height);
  // Height of the top of a row, or of the bottom of the one before; any place in between.
  static double heightAt(double row, int height);

  std::size_t cellCount() const override;
  void appendBreaks(std::vector<double>& breaks) const override;
  void cut(double begin, double end, std::vector<MeridianCut>& cuts) const override;

 private:
  int width_, height_;
  std::vector<double> row_ends_;
};

// The pixels of a raster cube (gather/rules/raster_geometry.h), of any resolution. Areas are exact
// up to kExactResolution; above, slices are too wide for borders that cross, to some thousandths of
// cells.
class CubeGrid final : public SphereGrid {
 public:
  static constexpr int kExactResolution = 64;
  explicit CubeGrid(int resolution) : resolution_(resolution) {}
  // Exact solid angle of a pixel.
  static double solidAngle(int resolution, int row, int column);

  std::size_t cellCount() const override;
  void appendBreaks(std::vector<double>& breaks) const override;
  void cut(double begin, double end, std::vector<MeridianCut>& cuts) const override;

 private:
  struct Slice;
  // Slope of line `i` of those with positive slopes.
  double line(int i) const { return (2 * i + 2 - resolution_ % 2) / double(resolution_); }
  void cutUpperFace(const Slice& slice, std::vector<MeridianCut>& cuts) const;
  void cutSideFace(const Slice& slice, std::vector<MeridianCut>& cuts) const;

  int resolution_;
};

// The sphere on a square, in cells of equal area (Clarberg 2008): the upper hemisphere is the
// square |x| + |y| <= 1 with 1 - h = (|x| + |y|)^2 and the azimuth's part of its quadrant |y| /
// (|x| + |y|); the lower one is the rest, mirrored at the sides of the first. Neighbours across an
// edge of the square are each other's mirror images. Cells are rows of rising y of columns of
// rising x.
class SquareGrid final : public SphereGrid {
 public:
  // `resolution`: cells along an edge; even.
  explicit SquareGrid(int resolution) : resolution_(resolution) {}
  // x and y of a unit direction, -1..1, to 1e-5.
  struct Point {
    float x, y;
  };
  static Point project(const glm::vec3& direction);

  std::size_t cellCount() const override;
  void appendBreaks(std::vector<double>& breaks) const override;
  void cut(double begin, double end, std::vector<MeridianCut>& cuts) const override;

 private:
  int resolution_;
};

// Adds the values of cells of `from`, which is turned by `rotation` (radians, from the first axis
// to the second), times the solid angles that they share with the cells of `to`: x, y, z; w is the
// solid angle alone. Slices are no wider than a thousandth of a turn.
std::vector<glm::dvec4> overlay(const SphereGrid& from, std::span<const glm::vec3> values,
                                double rotation, const SphereGrid& to);

}  // namespace surfeit
