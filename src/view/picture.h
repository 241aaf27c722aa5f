// A picture in memory, as the renderer leaves it and the encoders take it.
#pragma once

#include <glm/vec3.hpp>
#include <limits>
#include <vector>

namespace surfeit {

struct Picture {
  struct Pixel {
    glm::vec3 color{0};  // scene-linear (or data), times alpha
    float alpha = 0;     // part of the pixel that the cloud covers
    float depth = std::numeric_limits<float>::infinity();  // along the view; nearest in the pixel
  };

  int width = 0, height = 0;
  std::vector<Pixel> pixels;  // rows from the top

  const Pixel& at(int x, int y) const {
    return pixels[std::size_t(y) * std::size_t(width) + std::size_t(x)];
  }
};

}  // namespace surfeit
