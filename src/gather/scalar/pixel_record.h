// What a raster remembers of its pixels beside what it integrates, for those who look at it
// (surfeit/cube.h). Gathers run without it.
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <limits>
#include <span>
#include <vector>

#include "surfeit/cube.h"

namespace surfeit {

struct PixelRecord {
  std::array<float, kCubeKinds> covered{};  // by what it was drawn as; gaps are not filled yet
  float total = 0;                          // the sum of these
  float depth = std::numeric_limits<float>::infinity();  // CubePixel::depth
  float new_layers = 0;                                  // sum of what each began of a new layer

  float layers() const { return total > 0 ? std::max(1.f, new_layers) : 0; }
  CubeKind kind() const {
    const auto most = std::max_element(covered.begin(), covered.end());
    return *most > 0 ? CubeKind(most - covered.begin()) : CubeKind::kNothing;
  }
};

// One thread at a time.
class PixelRecorder {
 public:
  // Forgets everything; so many pixels follow.
  void begin(std::size_t pixels) { records_.assign(pixels, {}); }
  // What is drawn from here on.
  void setKind(CubeKind kind) { kind_ = std::size_t(kind); }
  // It covers so much more of a pixel, and begins a new layer by a part of 0 to 1.
  void add(std::size_t pixel, float covered, float new_layer, float distance) {
    PixelRecord& record = records_[pixel];
    record.covered[kind_] += covered;
    record.total += covered;
    record.new_layers += new_layer;
    if (record.total >= kCubeFirstPart) record.depth = std::min(record.depth, distance);
  }
  // A layer at this distance is closed: it covers the pixel.
  void close(std::size_t pixel, float distance) {
    PixelRecord& record = records_[pixel];
    record.depth = std::min(record.depth, distance);
  }

  std::span<const PixelRecord> records() const { return records_; }

 private:
  std::size_t kind_ = 0;
  std::vector<PixelRecord> records_;
};

}  // namespace surfeit
