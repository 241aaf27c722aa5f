// Draws batches of rows into a framebuffer, with all threads of the current TBB arena.
//
// The picture is cut into bands of rows. Each batch is first projected, record by record; then each
// band draws the surfels that touch it in the order of the batch, so that every sample sees the
// same sequence of fragments whatever the threads do.
#pragma once

#include <cstddef>
#include <cstdint>
#include <glm/vec3.hpp>
#include <span>
#include <vector>

#include "view/camera.h"
#include "view/channel.h"
#include "view/cloud_record.h"
#include "view/disk_raster.h"
#include "view/framebuffer.h"
#include "view/radius_estimate.h"
#include "view/value_map.h"

namespace surfeit {

// What turns rows into surfels on the screen. Points to things that must outlive the renderer.
struct RenderStyle {
  std::size_t row_bytes = 0;
  const RecordDecoder* decoder = nullptr;
  const Channel* channel = nullptr;
  ValueMap value_map;
  const RadiusEstimate* radius_estimate = nullptr;  // nullptr: the cloud's own radii
  float fixed_radius = 0;                           // > 0: before all others
  float radius_scale = 1;
  float square_samples = 0;    // > 0: squares of that many samples instead of disks
  bool is_normal_map = false;  // show 0.5 n + 0.5 instead of the channel
  bool cull_back = false;
};

// What one pass over the cloud met.
struct RenderCounts {
  std::uint64_t records = 0;
  std::uint64_t skipped_records = 0;
  std::uint64_t drawn_surfels = 0;
  std::uint64_t non_finite_values = 0;  // shown in magenta

  void add(const RenderCounts& other);
};

// One thread at a time.
class CloudRenderer {
 public:
  CloudRenderer(const RenderStyle& style, const Camera& camera, Framebuffer& framebuffer);

  // First pass: finds each sample's depth limit. Over all batches, and then closed, before the
  // second begins.
  void findFront(std::span<const std::byte> rows);
  void closeFront();
  // Second pass, over the same batches: averages the values before the limits. Returns counts of
  // this batch.
  RenderCounts accumulate(std::span<const std::byte> rows);

 private:
  template <bool kWithValues>
  RenderCounts project(std::span<const std::byte> rows);
  void sortIntoBands();
  bool projectRow(const std::byte* row, ScreenSurfel& surfel, RenderCounts& counts) const;
  glm::vec3 shownValue(const std::byte* row, RenderCounts& counts) const;

  const RenderStyle style_;
  const Camera& camera_;
  Framebuffer& framebuffer_;
  std::vector<ScreenSurfel> surfels_;              // of the batch
  std::vector<std::uint8_t> is_visible_;           // the same index
  std::vector<std::vector<std::uint32_t>> bands_;  // indices of the surfels that touch each band
};

}  // namespace surfeit
