#include "sample/meshes/obj_vertex_colors.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "sample/meshes/texture.h"

namespace surfeit {
namespace {

constexpr double kLargestLight = 16;  // of clouds, too (docs/files.md)
constexpr float kNone = std::numeric_limits<float>::quiet_NaN();

}  // namespace

void ObjVertexColors::addVertex(std::span<const double> numbers) {
  const std::uint64_t vertex = vertices_++;
  const bool has_color = numbers.size() >= 6;
  if (numbers.size() == 4 && numbers[3] != 1) ++weighted_;
  if (!has_color && colors_.empty()) return;
  colors_.resize(vertex, glm::vec3(kNone));  // of those before the first that has one
  if (!has_color) {
    colors_.emplace_back(kNone);
    return;
  }
  ++colored_;
  glm::vec3 color(0);
  for (int i = 0; i < 3; ++i) {
    const double value = numbers[3 + std::size_t(i)];
    if (value < 0) ++below_0_;
    color[i] = float(std::max(value, 0.0));
    largest_ = std::max(largest_, value);
    are_wholes_ = are_wholes_ && value == std::floor(value);
  }
  colors_.push_back(color);
  if (numbers.size() < 7) return;
  ++with_alpha_;
  least_alpha_ = std::min(least_alpha_, numbers[6]);
}

double ObjVertexColors::white() const {
  if (largest_ <= 1 || (!are_wholes_ && largest_ <= kLargestLight)) return 1;
  return are_wholes_ && largest_ > 255 ? 65535 : 255;
}

glm::vec3 ObjVertexColors::linear(std::size_t vertex) const {
  const glm::vec3 srgb = colors_[vertex] / float(white());
  if (std::isnan(srgb.x)) return glm::vec3(1);
  return {linearFromSrgb(srgb.x), linearFromSrgb(srgb.y), linearFromSrgb(srgb.z)};
}

std::vector<std::string> ObjVertexColors::notes() const {
  std::vector<std::string> notes;
  if (zbrush_lines_ > 0 && colored_ == 0) {
    notes.push_back(fmt::format(
        "{} lines with colors of ZBrush (#MRGB) are not read: save the colors with the vertices (v "
        "x y z r g b), or the mesh as PLY",
        zbrush_lines_));
  }
  if (weighted_ > 0) {
    notes.push_back(
        fmt::format("{} vertices have a fourth number other than 1, a weight of free-form curves "
                    "and surfaces, which is not used: places stand as they are",
                    weighted_));
  }
  if (colored_ == 0) return notes;
  if (white() > 1) {
    notes.push_back(
        fmt::format("colors of vertices are 0-{} (the largest is {:g}): read as sRGB of {} bits",
                    white(), largest_, white() > 255 ? 16 : 8));
  } else if (largest_ > 1) {
    notes.push_back(fmt::format(
        "colors of vertices reach {0:g}, which is more than white (1), and reflect more light than "
        "they get: divide all by {0:g}",
        largest_));
  }
  if (colored_ < vertices_) {
    notes.push_back(
        fmt::format("{} of {} vertices have no color: they are white, others keep "
                    "theirs (give all of them one, or none)",
                    vertices_ - colored_, vertices_));
  }
  if (below_0_ > 0) {
    notes.push_back(
        fmt::format("{} values of colors of vertices are below 0: read as 0", below_0_));
  }
  if (with_alpha_ > 0 && least_alpha_ < white()) {
    notes.push_back(fmt::format(
        "the alpha of {} vertices is not read (the least is {:g}): d or map_d in a material makes "
        "surfaces translucent",
        with_alpha_, least_alpha_));
  }
  return notes;
}

}  // namespace surfeit
