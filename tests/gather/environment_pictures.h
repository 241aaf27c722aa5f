// Pictures of environments for tests, and their files.
#pragma once

#include <OpenEXR/ImfChannelList.h>
#include <OpenEXR/ImfEnvmapAttribute.h>
#include <OpenEXR/ImfFrameBuffer.h>
#include <OpenEXR/ImfHeader.h>
#include <OpenEXR/ImfOutputFile.h>
#include <OpenEXR/ImfStandardAttributes.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <functional>
#include <glm/vec3.hpp>
#include <string>
#include <vector>

#include "io/test_directory.h"

namespace surfeit {

struct TestPicture {
  int width, height;
  std::vector<glm::vec3> pixels;
  bool is_cube_map = false;

  TestPicture(int picture_width, int picture_height,
              const std::function<glm::vec3(int, int)>& valueAt)
      : width(picture_width), height(picture_height) {
    for (int row = 0; row < height; ++row) {
      for (int column = 0; column < width; ++column) pixels.push_back(valueAt(column, row));
    }
  }
  glm::vec3& at(int column, int row) { return pixels[std::size_t(row * width + column)]; }
  const glm::vec3& at(int column, int row) const {
    return pixels[std::size_t(row * width + column)];
  }
  // The pixel of a lat-long picture turned by `rotation` in a direction with axes A, B, up
  // (gather/light/environment_map.h).
  const glm::vec3& lookup(const glm::dvec3& d, double rotation) const {
    constexpr double kTurnExact = 6.28318530717958647692;
    const double turns = .5 - (std::atan2(d.y, d.x) - rotation) / kTurnExact;
    const double polar = std::acos(d.z / std::sqrt(d.x * d.x + d.y * d.y + d.z * d.z));
    return at(std::min(int((turns - std::floor(turns)) * width), width - 1),
              std::min(int(2 * polar / kTurnExact * height), height - 1));
  }
};

// Direction of a place in a lat-long picture, 0..1 from its upper left corner.
inline glm::dvec3 latLongDirection(double across, double down) {
  constexpr double kPiOfTest = 3.14159265358979323846;
  const double azimuth = kPiOfTest * (1 - 2 * across), polar = kPiOfTest * down;
  return {std::sin(polar) * std::cos(azimuth), std::sin(polar) * std::sin(azimuth),
          std::cos(polar)};
}

// A cube map of a function of direction with axes A, B, up, by the drawing in ImfEnvmap.h: x, y and
// z of OpenEXR are B, up and A.
inline TestPicture smoothCubePicture(int edge,
                                     const std::function<glm::vec3(const glm::dvec3&)>& light) {
  TestPicture picture(edge, 6 * edge, [&](int x, int y) {
    const double s = (2 * x + 1.) / edge - 1, t = 1 - (2 * (y % edge) + 1.) / edge;
    glm::dvec3 d;
    switch (y / edge) {
      case 0:
        d = {1, t, s};
        break;
      case 1:
        d = {-1, t, -s};
        break;
      case 2:
        d = {s, 1, t};
        break;
      case 3:
        d = {s, -1, -t};
        break;
      case 4:
        d = {-s, t, 1};
        break;
      default:
        d = {s, t, -1};
        break;
    }
    d /= std::sqrt(d.x * d.x + d.y * d.y + d.z * d.z);
    return light({d.z, d.x, d.y});
  });
  picture.is_cube_map = true;
  return picture;
}

// Scan lines of floats, without compression.
inline void writeExr(const TestPicture& picture, const std::string& path) {
  Imf::Header header(picture.width, picture.height);
  header.compression() = Imf::NO_COMPRESSION;
  if (picture.is_cube_map) Imf::addEnvmap(header, Imf::ENVMAP_CUBE);
  Imf::FrameBuffer buffer;
  char* const first = reinterpret_cast<char*>(const_cast<glm::vec3*>(picture.pixels.data()));
  for (const auto& [name, offset] : {std::pair("R", 0), {"G", 4}, {"B", 8}}) {
    header.channels().insert(name, Imf::Channel(Imf::FLOAT));
    buffer.insert(name, Imf::Slice(Imf::FLOAT, first + offset, sizeof(glm::vec3),
                                   sizeof(glm::vec3) * std::size_t(picture.width)));
  }
  Imf::OutputFile file(path.c_str(), header, 0);
  file.setFrameBuffer(buffer);
  file.writePixels(picture.height);
}

}  // namespace surfeit
