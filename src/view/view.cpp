#include "view/view.h"

#include <fmt/format.h>
#include <tbb/task_arena.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <functional>
#include <limits>
#include <memory>
#include <new>

#include "core/job_limits.h"
#include "view/channel.h"
#include "view/cloud_record.h"
#include "view/cloud_renderer.h"
#include "view/cloud_rows.h"
#include "view/framebuffer.h"
#include "view/picture_file.h"
#include "view/radius_estimate.h"

namespace surfeit {
namespace {

constexpr int kMaxPixelsPerEdge = 32768;
constexpr int kMaxSamplesPerEdge = 8;

// Rows and surfels of a batch, buffers of the readers and libraries.
constexpr std::uint64_t kStreamBytes = 32u << 20;
// Per pixel, while a picture is encoded: the encoder's copy and the file in memory.
constexpr std::uint64_t kEncodeBytesPerPixel = 32;

Status checkOptions(const ViewOptions& options) {
  const auto refuse = [](std::string message) { return Status::invalidArgument(message); };
  if (options.width < 1 || options.height < 1 || options.width > kMaxPixelsPerEdge ||
      options.height > kMaxPixelsPerEdge) {
    return refuse(fmt::format("picture size {}x{}: each edge must have 1 to {} pixels",
                              options.width, options.height, kMaxPixelsPerEdge));
  }
  if (options.samples < 1 || options.samples > kMaxSamplesPerEdge) {
    return refuse(fmt::format("samples {}: expected 1 to {} along each edge of a pixel",
                              options.samples, kMaxSamplesPerEdge));
  }
  if (!(options.radius >= 0 && std::isfinite(options.radius))) {
    return refuse(fmt::format("radius {}: expected a positive number", options.radius));
  }
  if (!(options.radius_scale > 0 && std::isfinite(options.radius_scale))) {
    return refuse(fmt::format("radius scale {}: expected a positive number", options.radius_scale));
  }
  if (!(options.point_size > 0 && options.point_size <= 1000)) {
    return refuse(fmt::format("point size {}: expected at most 1000 pixels", options.point_size));
  }
  if (!std::isfinite(options.exposure)) return refuse("the exposure must be finite");
  if (options.range && !(std::isfinite(options.range->x) && std::isfinite(options.range->y) &&
                         options.range->x != options.range->y)) {
    return refuse("the range needs two different finite numbers");
  }
  return {};
}

// Reads the whole cloud once as a phase of the progress.
Status streamRows(CloudRows& rows, const char* phase, Progress& progress,
                  const std::function<void(std::span<const std::byte>)>& visit) {
  SURFEIT_RETURN_IF_ERROR(rows.rewind());
  progress.beginPhase(phase, rows.element().count, "surfels");
  while (true) {
    if (progress.isCancelled()) return Status::interrupted();
    SURFEIT_ASSIGN_OR_RETURN(const std::span<const std::byte> batch, rows.next());
    if (batch.empty()) return {};
    visit(batch);
    progress.advance(batch.size() / rows.element().row_bytes);
  }
}

// What the first pass finds out.
struct CloudExtent {
  Bounds3 bounds;
  double lowest = std::numeric_limits<double>::infinity();  // values of the channel
  double highest = -std::numeric_limits<double>::infinity();
};

Result<CloudExtent> findExtent(CloudRows& rows, const RecordDecoder& decoder,
                               const Channel& channel, bool needs_range, bool needs_frame,
                               ViewFrame& frame, Progress& progress) {
  CloudExtent extent;
  if (rows.statedBounds() && !needs_frame && !needs_range) {
    extent.bounds = *rows.statedBounds();
    return extent;
  }
  const std::size_t row_bytes = rows.element().row_bytes;
  SURFEIT_RETURN_IF_ERROR(
      streamRows(rows, "bounds", progress, [&](std::span<const std::byte> batch) {
        CloudRecord record;
        for (std::size_t at = 0; at < batch.size(); at += row_bytes) {
          if (!decoder.decode(&batch[at], record)) continue;
          extent.bounds.add(glm::vec3(record.position));
          frame.add(record.position);
          if (!needs_range) continue;
          const double value = double(channel.value(&batch[at]).x);
          if (!std::isfinite(value)) continue;
          extent.lowest = std::min(extent.lowest, value);
          extent.highest = std::max(extent.highest, value);
        }
      }));
  if (extent.bounds.isEmpty()) {
    return Status::corruption(
        fmt::format("{}: none of its {} records can be drawn", rows.path(), rows.element().count));
  }
  return extent;
}

// Maps [low, high] to [0, 1]; a range without width becomes mid-grey.
ValueMap stretch(double low, double high) {
  if (low == high) return {glm::vec3(0), glm::vec3(0.5f)};
  const double scale = 1 / (high - low);
  return {glm::vec3(float(scale)), glm::vec3(float(-low * scale))};
}

ValueMap chooseValueMap(const ViewOptions& options, const Channel& channel,
                        const CloudExtent& extent, PictureFormat format, Progress& progress) {
  if (options.range) return stretch(options.range->x, options.range->y);
  if (format == PictureFormat::kExr) return {};  // keeps the channel's own values
  switch (channel.kind()) {
    case ChannelKind::kLight:
      return {};
    case ChannelKind::kScalar:
      if (!(extent.lowest <= extent.highest)) return {};
      progress.note(fmt::format("channel {}: black is {:.6g}, white is {:.6g}", channel.name(),
                                extent.lowest, extent.highest));
      return stretch(extent.lowest, extent.highest);
    case ChannelKind::kNormal:
      return stretch(-1, 1);
    case ChannelKind::kPosition: {
      const glm::vec3 size = extent.bounds.extent();
      const float scale = 1 / std::max({size.x, size.y, size.z, 1e-30f});
      return {glm::vec3(scale), -scale * extent.bounds.min};
    }
  }
  return {};
}

Status checkBudget(const ViewOptions& options, std::uint64_t framebuffer_bytes) {
  const std::uint64_t budget =
      options.memory_bytes > 0 ? options.memory_bytes : memoryLimitBytes() / 4 * 3;
  const std::uint64_t pixels = std::uint64_t(options.width) * std::uint64_t(options.height);
  const std::uint64_t needed =
      framebuffer_bytes + pixels * kEncodeBytesPerPixel + kStreamBytes + RadiusEstimate::kMaxBytes;
  if (needed <= budget) return {};
  return Status::budgetTooSmall(
      fmt::format("a picture of {}x{} with {}x{} samples needs {} MiB, the budget is {} MiB; "
                  "a smaller size or fewer samples take less",
                  options.width, options.height, options.samples, options.samples,
                  (needed >> 20) + 1, budget >> 20));
}

Result<ViewStats> draw(const std::string& input, const std::string& picture_path,
                       const ViewOptions& options, Progress& progress) {
  ViewStats stats;
  SURFEIT_RETURN_IF_ERROR(checkOptions(options));
  SURFEIT_ASSIGN_OR_RETURN(const PictureFormat format, pictureFormat(picture_path));
  stats.framebuffer_bytes = Framebuffer::bytes(options.width, options.height, options.samples);
  SURFEIT_RETURN_IF_ERROR(checkBudget(options, stats.framebuffer_bytes));

  SURFEIT_ASSIGN_OR_RETURN(const std::unique_ptr<CloudRows> rows, openCloudRows(input));
  const PlyElement& element = rows->element();
  SURFEIT_ASSIGN_OR_RETURN(const RecordDecoder decoder, RecordDecoder::create(element, input));
  const bool is_normal_map = options.mode == ViewMode::kNormals;
  stats.channel = is_normal_map             ? "normal"
                  : options.channel.empty() ? Channel::choose(element, rows->statedChannels())
                                            : options.channel;
  SURFEIT_ASSIGN_OR_RETURN(
      const Channel channel,
      Channel::find(element, is_normal_map ? "position" : stats.channel, input));

  // Where the cloud is, and the values that a grey channel takes
  const bool needs_range =
      channel.kind() == ChannelKind::kScalar && !options.range && format == PictureFormat::kPng;
  const int width = options.width * options.samples, height = options.height * options.samples;
  SURFEIT_ASSIGN_OR_RETURN(ViewFrame frame, Camera::createFrame(options.camera, width, height));
  SURFEIT_ASSIGN_OR_RETURN(
      const CloudExtent extent,
      findExtent(*rows, decoder, channel, needs_range, !options.camera.eye, frame, progress));
  SURFEIT_ASSIGN_OR_RETURN(const Camera camera,
                           Camera::create(options.camera, extent.bounds, frame, width, height));
  stats.eye = camera.eye();
  stats.look_at = camera.lookAt();

  // How large surfels without a radius are
  RenderStyle style;
  style.row_bytes = element.row_bytes;
  style.decoder = &decoder;
  style.channel = &channel;
  style.value_map = chooseValueMap(options, channel, extent, format, progress);
  style.fixed_radius = options.radius;
  style.radius_scale = options.radius_scale;
  style.is_normal_map = is_normal_map;
  style.cull_back = options.cull_back;
  if (options.mode == ViewMode::kPoints) {
    style.square_samples = options.point_size * float(options.samples);
  }
  std::unique_ptr<RadiusEstimate> estimate;
  if (!decoder.hasRadius() && options.radius == 0 && options.mode != ViewMode::kPoints) {
    estimate = std::make_unique<RadiusEstimate>(extent.bounds, element.count);
    SURFEIT_RETURN_IF_ERROR(
        streamRows(*rows, "radii", progress, [&](std::span<const std::byte> batch) {
          CloudRecord record;
          for (std::size_t at = 0; at < batch.size(); at += element.row_bytes) {
            if (decoder.decode(&batch[at], record)) estimate->add(record.position);
          }
        }));
    estimate->finish();
    style.radius_estimate = estimate.get();
    stats.radius_estimated = true;
    stats.mean_estimated_radius = estimate->meanRadius();
    progress.note(
        fmt::format("{}: no radius; estimated from the density of the cloud, {:.4g} "
                    "on average (change it with the radius options)",
                    input, stats.mean_estimated_radius));
  }

  // Front surfaces first, then the values on them
  Framebuffer framebuffer(options.width, options.height, options.samples);
  CloudRenderer renderer(style, camera, framebuffer);
  SURFEIT_RETURN_IF_ERROR(
      streamRows(*rows, "depth", progress,
                 [&](std::span<const std::byte> batch) { renderer.findFront(batch); }));
  RenderCounts counts;
  SURFEIT_RETURN_IF_ERROR(streamRows(
      *rows, "values", progress,
      [&](std::span<const std::byte> batch) { counts.add(renderer.accumulate(batch)); }));
  stats.records = counts.records;
  stats.skipped_records = counts.skipped_records;
  stats.drawn_surfels = counts.drawn_surfels;
  stats.non_finite_values = counts.non_finite_values;
  if (counts.skipped_records > 0) {
    progress.note(
        fmt::format("{}: {} of {} records cannot be drawn (not finite, or no positive "
                    "radius); skipped",
                    input, counts.skipped_records, counts.records));
  }
  if (counts.non_finite_values > 0) {
    progress.note(fmt::format("{}: {} values of channel {} are not finite; drawn in magenta", input,
                              counts.non_finite_values, channel.name()));
  }

  const Picture picture = framebuffer.resolve();
  double covered = 0;
  for (const Picture::Pixel& pixel : picture.pixels) covered += double(pixel.alpha);
  stats.coverage = covered / double(picture.pixels.size());

  PngOptions png;
  png.exposure = options.exposure;
  png.is_data = is_normal_map || channel.kind() != ChannelKind::kLight;
  png.background = options.background;
  SURFEIT_RETURN_IF_ERROR(writePicture(picture_path, picture, png));
  return stats;
}

}  // namespace

Result<ViewStats> viewCloud(const std::string& input, const std::string& picture,
                            const ViewOptions& options, Progress& progress) {
  const auto start = std::chrono::steady_clock::now();
  const int threads = options.threads > 0 ? options.threads : defaultThreadCount();
  try {
    tbb::task_arena arena(threads);
    Result<ViewStats> result =
        arena.execute([&] { return draw(input, picture, options, progress); });
    if (!result.ok()) return result;
    result->threads = threads;
    result->seconds =
        std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
    return result;
  } catch (const std::bad_alloc&) {
    return Status::budgetTooSmall(fmt::format("{}: out of memory", picture));
  }
}

}  // namespace surfeit
