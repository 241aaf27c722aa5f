// Colors of the vertices of an OBJ file: what stands behind their places.
#pragma once

#include <cstddef>
#include <cstdint>
#include <glm/vec3.hpp>
#include <limits>
#include <span>
#include <string>
#include <vector>

namespace surfeit {

// Colors are sRGB from 0 to 1, or codes: whole numbers above 1, and all numbers when some are above
// 16. Takes no memory for vertices until one of them has a color.
class ObjVertexColors {
 public:
  // The numbers of the next vertex: x y z, perhaps with r g b, perhaps with alpha. A fourth number
  // alone is a weight.
  void addVertex(std::span<const double> numbers);
  // A line of colors in a comment (#MRGB), as ZBrush writes them.
  void addZBrushLine() { ++zbrush_lines_; }

  bool empty() const { return colors_.empty(); }
  // Scene-linear color of a vertex that addVertex() took; white where it has none.
  glm::vec3 linear(std::size_t vertex) const;
  // What of them is guessed, missing or not read.
  std::vector<std::string> notes() const;

 private:
  double white() const;

  std::vector<glm::vec3> colors_;  // as written; x is NaN where there is none
  std::uint64_t vertices_ = 0, colored_ = 0, below_0_ = 0, with_alpha_ = 0, zbrush_lines_ = 0,
                weighted_ = 0;
  double largest_ = 0, least_alpha_ = std::numeric_limits<double>::infinity();
  bool are_wholes_ = true;
};

}  // namespace surfeit
