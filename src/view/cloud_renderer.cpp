#include "view/cloud_renderer.h"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <cmath>

#include "view/non_finite.h"

namespace surfeit {
namespace {

constexpr int kBandRows = 32;
constexpr std::size_t kChunkRows = 1024;

// The back of a thin wall lies within the front's thickness: a front fragment outweighs it.
constexpr float kBackWeight = 1e-3f;
// Weight at the rim of a disk, so that a sample which only rims cover is filled too.
constexpr float kRimWeight = 1e-3f;

glm::vec3 normalColor(const glm::vec3& normal) { return 0.5f * normal + 0.5f; }

}  // namespace

void RenderCounts::add(const RenderCounts& other) {
  records += other.records;
  skipped_records += other.skipped_records;
  drawn_surfels += other.drawn_surfels;
  non_finite_values += other.non_finite_values;
}

CloudRenderer::CloudRenderer(const RenderStyle& style, const Camera& camera,
                             Framebuffer& framebuffer)
    : style_(style),
      camera_(camera),
      framebuffer_(framebuffer),
      bands_(std::size_t((framebuffer.height() + kBandRows - 1) / kBandRows)) {}

bool CloudRenderer::projectRow(const std::byte* row, ScreenSurfel& surfel,
                               RenderCounts& counts) const {
  CloudRecord record;
  ++counts.records;
  if (!style_.decoder->decode(row, record)) {
    ++counts.skipped_records;
    return false;
  }
  std::optional<ScreenSurfel> projected;
  if (style_.square_samples > 0) {
    projected = projectSquare(record, camera_, style_.square_samples);
  } else {
    if (style_.fixed_radius > 0) {
      record.radius = style_.fixed_radius;
      record.area = 0;
    } else if (style_.radius_estimate != nullptr) {
      record.radius = style_.radius_estimate->radiusAt(record.position);
      record.area = 0;
    }
    record.radius *= style_.radius_scale;
    projected = projectDisk(record, camera_);
  }
  if (!projected || (style_.cull_back && projected->is_back)) return false;
  surfel = *projected;
  if (style_.is_normal_map) surfel.value = normalColor(record.normal);
  ++counts.drawn_surfels;
  return true;
}

glm::vec3 CloudRenderer::shownValue(const std::byte* row, RenderCounts& counts) const {
  const glm::vec3 value = style_.channel->value(row);
  if (!isFinite(value)) {
    ++counts.non_finite_values;
    return kNonFiniteColor;
  }
  return style_.value_map.scale * value + style_.value_map.offset;
}

template <bool kWithValues>
RenderCounts CloudRenderer::project(std::span<const std::byte> rows) {
  const std::size_t count = rows.size() / style_.row_bytes;
  const std::size_t chunks = (count + kChunkRows - 1) / kChunkRows;
  surfels_.resize(count);
  is_visible_.resize(count);
  std::vector<RenderCounts> chunk_counts(chunks);
  tbb::parallel_for(std::size_t{0}, chunks, [&](std::size_t chunk) {
    RenderCounts& counts = chunk_counts[chunk];
    const std::size_t end = std::min((chunk + 1) * kChunkRows, count);
    for (std::size_t i = chunk * kChunkRows; i < end; ++i) {
      const std::byte* row = rows.data() + i * style_.row_bytes;
      is_visible_[i] = projectRow(row, surfels_[i], counts);
      if constexpr (kWithValues) {
        if (is_visible_[i] && !style_.is_normal_map) surfels_[i].value = shownValue(row, counts);
      }
    }
  });
  sortIntoBands();
  RenderCounts total;
  for (const RenderCounts& counts : chunk_counts) total.add(counts);
  return total;
}

void CloudRenderer::sortIntoBands() {
  for (std::vector<std::uint32_t>& band : bands_) band.clear();
  for (std::size_t i = 0; i < surfels_.size(); ++i) {
    if (!is_visible_[i]) continue;
    const ScreenBox& box = surfels_[i].box;
    for (int band = box.y_begin / kBandRows; band <= (box.y_end - 1) / kBandRows; ++band) {
      bands_[std::size_t(band)].push_back(std::uint32_t(i));
    }
  }
}

void CloudRenderer::findFront(std::span<const std::byte> rows) {
  project<false>(rows);
  tbb::parallel_for(std::size_t{0}, bands_.size(), [&](std::size_t band) {
    const int band_begin = int(band) * kBandRows, band_end = band_begin + kBandRows;
    for (const std::uint32_t i : bands_[band]) {
      const ScreenSurfel& surfel = surfels_[i];
      const int y_end = std::min(surfel.box.y_end, band_end);
      for (int y = std::max(surfel.box.y_begin, band_begin); y < y_end; ++y) {
        const std::span<Framebuffer::Front> fronts = framebuffer_.frontRow(y);
        visitFragments(surfel, camera_, y, [&](const Fragment& fragment) {
          fronts[std::size_t(fragment.x)].add(fragment.depth, surfel.thickness, fragment.is_core);
        });
      }
    }
  });
}

void CloudRenderer::closeFront() {
  const float step = camera_.slopeStep();
  tbb::parallel_for(0, framebuffer_.height(), [&](int y) { framebuffer_.closeRow(y, step); });
  framebuffer_.beginValues();
}

RenderCounts CloudRenderer::accumulate(std::span<const std::byte> rows) {
  const RenderCounts counts = project<true>(rows);
  tbb::parallel_for(std::size_t{0}, bands_.size(), [&](std::size_t band) {
    const int band_begin = int(band) * kBandRows, band_end = band_begin + kBandRows;
    for (const std::uint32_t i : bands_[band]) {
      const ScreenSurfel& surfel = surfels_[i];
      const bool has_hit_normal =
          style_.is_normal_map && surfel.shape == ScreenSurfel::Shape::kSphere;
      const float side_weight = surfel.is_back ? kBackWeight : 1;
      const int y_end = std::min(surfel.box.y_end, band_end);
      for (int y = std::max(surfel.box.y_begin, band_begin); y < y_end; ++y) {
        const std::span<const float> limits = framebuffer_.limitRow(y);
        const std::span<Framebuffer::Sample> samples = framebuffer_.row(y);
        visitFragments(surfel, camera_, y, [&](const Fragment& fragment) {
          const float limit = limits[std::size_t(fragment.x)];
          if (!(fragment.depth <= limit)) return;
          // The rim of something before the front surface, which ends beside this sample
          if (!fragment.is_core && fragment.depth < limit - 2 * surfel.thickness) return;
          glm::vec3 value = surfel.value;
          if (has_hit_normal) {
            const glm::vec3 hit = fragment.depth * fragment.slope - surfel.centre;
            const float length = glm::length(hit);
            const glm::vec3 normal = length > 0 ? hit / length : glm::vec3(0, 0, -1);
            value = normalColor(camera_.worldFromCameraDirection(normal));
          }
          const float falloff = 1 - fragment.rho;
          const float weight = side_weight * (falloff * falloff + kRimWeight);
          Framebuffer::Sample& sample = samples[std::size_t(fragment.x)];
          sample.depth =
              sample.weight > 0 ? std::min(sample.depth, fragment.depth) : fragment.depth;
          sample.sum += weight * value;
          sample.weight += weight;
          sample.depth_sum += weight * fragment.depth;
        });
      }
    }
  });
  return counts;
}

}  // namespace surfeit
