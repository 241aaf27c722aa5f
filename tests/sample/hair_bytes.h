// Hair as the tests of strands need it, and as a .hair file.
#pragma once

#include <cstddef>
#include <cstdint>
#include <glm/geometric.hpp>
#include <glm/vec3.hpp>
#include <random>
#include <string>
#include <vector>

namespace surfeit {

// What a .hair file holds; empty arrays are left out of it.
struct Hair {
  std::vector<std::uint16_t> segments;
  std::vector<glm::vec3> points;
  std::vector<float> thickness, transparency;
  std::vector<glm::vec3> colors;
  std::uint32_t strands = 0, default_segments = 0;
  float default_thickness = 0.01f, default_transparency = 0;
  glm::vec3 default_color{1};

  std::string bytes() const {
    std::string file = "HAIR";
    const auto put = [&file](const void* data, std::size_t size) {
      file.append(static_cast<const char*>(data), size);
    };
    const auto putNumber = [&put](std::uint32_t number) { put(&number, 4); };
    putNumber(strands);
    putNumber(std::uint32_t(points.size()));
    putNumber(2u | (segments.empty() ? 0u : 1u) | (thickness.empty() ? 0u : 4u) |
              (transparency.empty() ? 0u : 8u) | (colors.empty() ? 0u : 16u));
    putNumber(default_segments);
    put(&default_thickness, 4);
    put(&default_transparency, 4);
    put(&default_color, 12);
    file.resize(128);
    put(segments.data(), 2 * segments.size());
    put(points.data(), 12 * points.size());
    put(thickness.data(), 4 * thickness.size());
    put(transparency.data(), 4 * transparency.size());
    put(colors.data(), 12 * colors.size());
    return file;
  }
};

// Strands in all directions, of 4 segments that bend a little.
inline Hair tuft(std::uint32_t strands, double length = 1, float width = 0.02f) {
  Hair hair;
  hair.strands = strands;
  hair.default_thickness = width;
  std::mt19937 random(4);
  std::normal_distribution<double> normal;
  const auto vector = [&] { return glm::dvec3(normal(random), normal(random), normal(random)); };
  for (std::uint32_t i = 0; i < strands; ++i) {
    hair.segments.push_back(4);
    glm::dvec3 at = 3.0 * vector(), along = glm::normalize(vector());
    for (int k = 0; k <= 4; ++k) {
      hair.points.push_back(at);
      at += 0.25 * length * along;
      along = glm::normalize(along + 0.1 * vector());
    }
  }
  return hair;
}

}  // namespace surfeit
