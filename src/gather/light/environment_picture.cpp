#include "gather/light/environment_picture.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <span>
#include <utility>

#include "core/spherical_harmonics.h"

namespace surfeit {
namespace {

// Visits the parts of cell `i` of `count` that lie in different cells of a coarser division of the
// same length, in order: (coarse cell, begin, end, whether the coarse cell ends there), with places
// in cells of the finer one.
template <typename Visit>
void forEachPart(int i, int count, int coarse_count, const Visit& visit) {
  // In units of which both kinds of cells have a whole number
  const std::int64_t fine = coarse_count, coarse = count, end = (i + 1) * fine;
  for (std::int64_t begin = i * fine; begin < end;) {
    const std::int64_t cell = begin / coarse, part_end = std::min(end, (cell + 1) * coarse);
    visit(int(cell), double(begin) / double(fine), double(part_end) / double(fine),
          part_end == (cell + 1) * coarse);
    begin = part_end;
  }
}

Status readLatLong(const LightRows& next, int width, int height, EnvironmentPicture& picture) {
  const int columns = std::min(width, EnvironmentPicture::kMaxColumns), coarse_rows = columns / 2;
  std::vector<glm::dvec3> row(static_cast<std::size_t>(columns));
  std::vector<glm::dvec3> sums(row.size(), glm::dvec3(0));  // of the coarse row that is not done
  picture.texels.resize(row.size() * std::size_t(coarse_rows));

  for (int i = 0; i < height; ++i) {
    SURFEIT_ASSIGN_OR_RETURN(const std::span<const glm::vec3> pixels, next());
    std::fill(row.begin(), row.end(), glm::dvec3(0));
    for (int j = 0; j < width; ++j) {
      forEachPart(j, width, columns, [&](int column, double begin, double end, bool) {
        const double azimuths = (end - begin) / width * kTurn;
        row[std::size_t(column)] += azimuths * glm::dvec3(pixels[std::size_t(j)]);
      });
    }
    forEachPart(i, height, coarse_rows, [&](int coarse, double begin, double end, bool is_done) {
      const double heights =
          LatLongGrid::heightAt(begin, height) - LatLongGrid::heightAt(end, height);
      const double texel = kTurn / columns *
                           (LatLongGrid::heightAt(coarse, coarse_rows) -
                            LatLongGrid::heightAt(coarse + 1, coarse_rows));
      for (std::size_t j = 0; j < row.size(); ++j) {
        sums[j] += heights * row[j];
        if (!is_done) continue;
        picture.power += sums[j];
        picture.texels[std::size_t(coarse) * row.size() + j] = glm::vec3(sums[j] / texel);
        sums[j] = glm::dvec3(0);
      }
    });
  }
  picture.grid = std::make_unique<LatLongGrid>(columns, coarse_rows);
  picture.columns = columns;
  return {};
}

// The cell of a CubeGrid that holds texel (row, column) of a face, counted as in the picture. The
// faces are OpenEXR's +x -x +y -y +z -z.
std::size_t cubeCell(int face, int row, int column, int edge) {
  const double right = (2 * column + 1.0) / edge - 1, up = 1 - (2 * row + 1.0) / edge;
  const glm::dvec3 faces[6] = {{1, up, right},   {-1, up, -right}, {right, 1, up},
                               {right, -1, -up}, {-right, up, 1},  {right, up, -1}};
  const glm::dvec3 exr = faces[face], direction(exr.z, exr.x, exr.y);  // A, B, up
  const int axis = (face / 2 + 1) % 3;
  const auto place = [&](int i) { return std::size_t((direction[(axis + i) % 3] + 1) / 2 * edge); };
  const std::size_t n = std::size_t(edge);
  return (std::size_t(2 * axis + face % 2) * n + place(2)) * n + place(1);
}

Status readCube(const LightRows& next, int edge, const std::string& path,
                EnvironmentPicture& picture) {
  // Texels of a whole number of pixels
  int step = 1;
  while (edge % step != 0 || edge / step > EnvironmentPicture::kMaxFaceEdge) ++step;
  const int coarse_edge = edge / step;
  if (edge > EnvironmentPicture::kMaxFaceEdge &&
      coarse_edge < EnvironmentPicture::kMaxFaceEdge / 4) {
    return Status::invalidArgument(
        fmt::format("{}: a cube map with faces of {} x {} pixels, expected at most {}, or {} to {} "
                    "times a whole "
                    "number",
                    path, edge, edge, EnvironmentPicture::kMaxFaceEdge,
                    EnvironmentPicture::kMaxFaceEdge / 4, EnvironmentPicture::kMaxFaceEdge));
  }

  picture.grid = std::make_unique<CubeGrid>(coarse_edge);
  picture.columns = 4 * coarse_edge;
  picture.texels.resize(picture.grid->cellCount());
  std::vector<glm::dvec3> sums(std::size_t(coarse_edge), glm::dvec3(0));
  for (int face = 0; face < 6; ++face) {
    for (int i = 0; i < edge; ++i) {
      SURFEIT_ASSIGN_OR_RETURN(const std::span<const glm::vec3> pixels, next());
      for (int j = 0; j < edge; ++j) {
        sums[std::size_t(j / step)] +=
            CubeGrid::solidAngle(edge, i, j) * glm::dvec3(pixels[std::size_t(j)]);
      }
      if ((i + 1) % step != 0) continue;
      for (int j = 0; j < coarse_edge; ++j) {
        glm::dvec3& sum = sums[std::size_t(j)];
        picture.texels[cubeCell(face, i / step, j, coarse_edge)] =
            glm::vec3(sum / CubeGrid::solidAngle(coarse_edge, i / step, j));
        picture.power += std::exchange(sum, glm::dvec3(0));
      }
    }
  }
  return {};
}

}  // namespace

Result<EnvironmentPicture> environmentPicture(int width, int height, bool is_cube_map,
                                              const LightRows& next, const std::string& path) {
  if (width < 1 || height < 1 || (is_cube_map ? height != 6 * width : width != 2 * height)) {
    return Status::invalidArgument(fmt::format(
        "{}: {} x {} pixels, expected {}", path, width, height,
        is_cube_map ? "a cube map, six times as high as wide"
                    : "a lat-long picture, twice as wide as high, or an OpenEXR cube map"));
  }
  EnvironmentPicture picture;
  SURFEIT_RETURN_IF_ERROR(is_cube_map ? readCube(next, width, path, picture)
                                      : readLatLong(next, width, height, picture));
  return picture;
}

}  // namespace surfeit
