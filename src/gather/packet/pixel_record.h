// What the pixels of one receiver got, and from what, beside what the raster integrates: for those
// who look at it (surfeit/cube.h). Gathers run without it.
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <glm/vec3.hpp>
#include <limits>
#include <vector>

#include "surfeit/cube.h"

namespace surfeit {

// What is in a pixel of a raster.
struct PixelContent {
  glm::vec3 direction{0};             // CubePixel::direction
  float weight = 0;                   // CubePixel::weight
  glm::vec3 environment{0};           // pi times the radiance of what is behind all of it
  float coverage = 0, occlusion = 0;  // occlusion: with falloff
  glm::vec3 radiosity{0};             // times the coverage; zero without light
  glm::vec3 open{1};                  // 1 less the coverage, by color
};

// Adds what was drawn for a color: of coverage and occlusion their means over the colors.
inline void addColor(const PixelContent& drawn, int color, PixelContent& sum) {
  sum.direction = drawn.direction;
  sum.weight = drawn.weight;
  sum.environment = drawn.environment;
  sum.coverage += drawn.coverage / 3;
  sum.occlusion += drawn.occlusion / 3;
  sum.radiosity[color] = drawn.radiosity[color];
  sum.open[color] = drawn.open[color];
}

struct PixelRecord {
  std::array<float, kCubeKinds> covered{};  // by what it was drawn as; gaps are not filled yet
  float total = 0;                          // the sum of these
  float depth = std::numeric_limits<float>::infinity();  // CubePixel::depth
  float things = 0;  // that lie behind each other and cover some of it

  CubeKind kind() const {
    const auto most = std::max_element(covered.begin(), covered.end());
    return *most > 0 ? CubeKind(most - covered.begin()) : CubeKind::kNothing;
  }
};

// Looks at the pixels after each patch is drawn. One thread at a time.
class PixelRecorder {
 public:
  // Forgets everything; so many pixels follow.
  void begin(std::size_t pixels) { pixels_.assign(pixels, {}); }
  // A pixel before anything is drawn: so much of it is open.
  void clear(std::size_t pixel, float open) { pixels_[pixel].open = open; }
  // What comes belongs to another thing.
  void beginThing(std::size_t pixel) { pixels_[pixel].is_new = true; }
  // Something of this kind, at this distance, was drawn: now so much of the pixel is open.
  void look(std::size_t pixel, CubeKind kind, float distance, float open) {
    Pixel& was = pixels_[pixel];
    if (!(open < was.open)) return;
    PixelRecord& record = was.record;
    if (was.is_new) ++record.things;
    was.is_new = false;
    record.covered[std::size_t(kind)] += was.open - open;
    record.total += was.open - open;
    if (record.total >= kCubeFirstPart) record.depth = std::min(record.depth, distance);
    was.open = open;
  }
  // The last thing, at this distance, is closed: it covers the pixel.
  void close(std::size_t pixel, float distance) {
    PixelRecord& record = pixels_[pixel].record;
    record.depth = std::min(record.depth, distance);
    pixels_[pixel].open = 0;
  }

  const PixelRecord& record(std::size_t pixel) const { return pixels_[pixel].record; }
  static constexpr std::size_t kPixelBytes = sizeof(PixelRecord) + 2 * sizeof(float);

 private:
  struct Pixel {
    PixelRecord record;
    float open = 0;
    bool is_new = true;  // nothing of the last thing has covered yet
  };
  std::vector<Pixel> pixels_;
};

}  // namespace surfeit
