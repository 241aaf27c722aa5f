#include "surfeit/view.h"

#include <fmt/format.h>
#include <tbb/task_arena.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <exception>
#include <memory>
#include <new>

#include "cloud/cloud_formats.h"
#include "cloud/rows/channels.h"
#include "core/job_limits.h"
#include "core/seconds_since.h"
#include "core/thread_check.h"
#include "view/brick_rows.h"
#include "view/camera.h"
#include "view/channel.h"
#include "view/cloud_record.h"
#include "view/cloud_renderer.h"
#include "view/cloud_rows.h"
#include "view/framebuffer.h"
#include "view/pass_file.h"
#include "view/picture_file.h"
#include "view/radius_estimate.h"
#include "view/row_stream.h"
#include "view/value_map.h"

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
  if (!options.passes.empty() && options.mode == ViewMode::kPoints) {
    return refuse("passes are of disks; points have no surface");
  }
  if (options.range && !(std::isfinite(options.range->x) && std::isfinite(options.range->y) &&
                         options.range->x != options.range->y)) {
    return refuse("the range needs two different finite numbers");
  }
  return {};
}

Result<ValueExtent> findExtent(CloudRows& rows, const RecordDecoder& decoder,
                               const Channel& channel, bool needs_range, bool needs_frame,
                               ViewFrame& frame, Progress& progress) {
  ValueExtent extent;
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
          extent.bounds.add(record.position);
          frame.add(record.position);
          if (!needs_range) continue;
          const double value = double(channel.value(&batch[at]).x);
          if (!std::isfinite(value)) continue;
          extent.addValue(value);
        }
      }));
  if (extent.bounds.isEmpty()) {
    return Status::corruption(
        fmt::format("{}: none of its {} records can be drawn", rows.path(), rows.element().count));
  }
  return extent;
}

Status checkBudget(const ViewOptions& options, std::uint64_t framebuffer_bytes) {
  const std::uint64_t budget =
      options.memory_bytes > 0 ? options.memory_bytes : defaultMemoryBytes();
  const std::uint64_t pixels = std::uint64_t(options.width) * std::uint64_t(options.height);
  // Passes and picture are drawn one after the other
  const std::uint64_t pass_bytes =
      options.passes.empty() ? 0 : passBytes(options.width, options.height);
  const std::uint64_t needed =
      std::max(framebuffer_bytes + pixels * kEncodeBytesPerPixel, pass_bytes) + kStreamBytes +
      RadiusEstimate::kMaxBytes + (options.brick.empty() ? 0 : kBrickRowsBytes);
  if (needed <= budget) return {};
  return Status::budgetTooSmall(fmt::format(
      "a memory budget of {} MiB is too small for a picture of {}x{} with {}x{} samples: "
      "{} MiB is the least that works; a smaller size or fewer samples take less",
      budget >> 20, options.width, options.height, options.samples, options.samples,
      (needed >> 20) + 1));
}

// The format of the picture, if there is one; what is written must have a name that fits.
Result<PictureFormat> checkNames(const std::string& picture, const std::string& passes) {
  if (!passes.empty()) {
    SURFEIT_ASSIGN_OR_RETURN(const PictureFormat format, pictureFormat(passes));
    if (format != PictureFormat::kExr) {
      return Status::invalidArgument(
          fmt::format("{}: passes are written as OpenEXR, expected a name in .exr", passes));
    }
  }
  if (!picture.empty()) return pictureFormat(picture);
  if (!passes.empty()) return PictureFormat::kExr;
  return Status::invalidArgument("neither a picture nor passes to write");
}

// Draws the values of the style's channel and writes the picture.
Status drawPicture(const std::string& picture_path, CloudRows& rows, const RenderStyle& style,
                   const Camera& camera, const ViewOptions& options, ViewStats& stats,
                   Progress& progress) {
  // Front surfaces first, then the values on them
  Framebuffer framebuffer(options.width, options.height, options.samples);
  CloudRenderer renderer(style, camera, framebuffer);
  SURFEIT_RETURN_IF_ERROR(
      streamRows(rows, "depth", progress,
                 [&](std::span<const std::byte> batch) { renderer.findFront(batch); }));
  renderer.closeFront();
  RenderCounts counts;
  SURFEIT_RETURN_IF_ERROR(streamRows(
      rows, "values", progress,
      [&](std::span<const std::byte> batch) { counts.add(renderer.accumulate(batch)); }));
  stats.records = counts.records;
  stats.skipped_records = counts.skipped_records;
  stats.drawn_surfels = counts.drawn_surfels;
  stats.non_finite_values = counts.non_finite_values;
  if (counts.skipped_records > 0) {
    progress.note(
        fmt::format("{}: {} of {} records cannot be drawn (not finite, or no positive "
                    "radius); skipped",
                    rows.path(), counts.skipped_records, counts.records));
  }
  if (counts.non_finite_values > 0) {
    progress.note(fmt::format("{}: {} values of channel {} are not finite; drawn in magenta",
                              rows.path(), counts.non_finite_values, style.channel->name()));
  }

  const Picture picture = framebuffer.resolve();
  double covered = 0;
  for (const Picture::Pixel& pixel : picture.pixels) covered += double(pixel.alpha);
  stats.coverage = covered / double(picture.pixels.size());

  PngOptions png;
  png.exposure = options.exposure;
  png.is_data = style.is_normal_map || style.channel->kind() != ValueKind::kLight;
  png.background = options.background;
  return writePicture(picture_path, picture, png);
}

Result<ViewStats> draw(const std::string& input, const std::string& picture_path,
                       const ViewOptions& options, Progress& progress) {
  ViewStats stats;
  SURFEIT_RETURN_IF_ERROR(checkOptions(options));
  SURFEIT_ASSIGN_OR_RETURN(const PictureFormat format, checkNames(picture_path, options.passes));
  const bool has_picture = !picture_path.empty();
  if (has_picture) {
    stats.framebuffer_bytes = Framebuffer::bytes(options.width, options.height, options.samples);
  }
  SURFEIT_RETURN_IF_ERROR(checkBudget(options, stats.framebuffer_bytes));

  RowReaderOptions reading;
  SURFEIT_ASSIGN_OR_RETURN(reading.channels, parseChannelRenames(options.channels));
  reading.part = options.part;
  reading.filter = options.filter;
  reading.color_range = options.color_range;
  SURFEIT_ASSIGN_OR_RETURN(std::unique_ptr<CloudRows> rows, openCloudRows(input, reading));
  for (const std::string& note : rows->notes()) {
    progress.note(fmt::format("{}: {}", input, note));
  }
  if (!options.brick.empty()) {
    SURFEIT_ASSIGN_OR_RETURN(rows,
                             addBrickValues(std::move(rows), options.brick, options.filter_width));
  }
  CameraOptions looking = options.camera;
  looking.up_axis = options.up.value_or(rows->up());
  const RowLayout& element = rows->element();
  SURFEIT_ASSIGN_OR_RETURN(const RecordDecoder decoder, RecordDecoder::create(element, input));
  const bool is_normal_map = options.mode == ViewMode::kNormals || !has_picture;
  stats.channel = is_normal_map             ? "normal"
                  : options.channel.empty() ? Channel::choose(element)
                                            : options.channel;
  SURFEIT_ASSIGN_OR_RETURN(
      const Channel channel,
      Channel::find(element, is_normal_map ? "position" : stats.channel, input));

  // Where the cloud is, and the values that a grey channel takes
  const bool needs_range =
      channel.kind() == ValueKind::kScalar && !options.range && format == PictureFormat::kPng;
  const int width = options.width * options.samples, height = options.height * options.samples;
  SURFEIT_ASSIGN_OR_RETURN(ViewFrame frame, Camera::createFrame(looking, width, height));
  SURFEIT_ASSIGN_OR_RETURN(
      const ValueExtent extent,
      findExtent(*rows, decoder, channel, needs_range, !options.camera.eye, frame, progress));
  SURFEIT_ASSIGN_OR_RETURN(const Camera camera,
                           Camera::create(looking, extent.bounds, frame, width, height));
  stats.eye = camera.eye();
  stats.look_at = camera.lookAt();

  // How large surfels without a radius are
  RenderStyle style;
  style.row_bytes = element.row_bytes;
  style.decoder = &decoder;
  style.channel = &channel;
  style.value_map = chooseValueMap(options.range, channel, extent, format, progress);
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

  if (!options.passes.empty()) {
    // The same view, with a pixel for a sample
    SURFEIT_ASSIGN_OR_RETURN(
        const Camera pixel_camera,
        Camera::create(looking, extent.bounds, frame, options.width, options.height));
    SURFEIT_ASSIGN_OR_RETURN(stats.pass_pixels,
                             writePasses(options.passes, *rows, style, pixel_camera, progress));
    if (stats.pass_pixels == 0) {
      progress.note(fmt::format("{}: no pixel sees the cloud", options.passes));
    }
  }
  if (has_picture) {
    SURFEIT_RETURN_IF_ERROR(
        drawPicture(picture_path, *rows, style, camera, options, stats, progress));
  }
  return stats;
}

}  // namespace

Result<ViewStats> viewCloud(const std::string& input, const std::string& picture,
                            const ViewOptions& options, Progress& progress) {
  const auto start = std::chrono::steady_clock::now();
  const int threads = options.threads > 0 ? options.threads : defaultThreadCount();
  try {
    requireThreads(threads);
    tbb::task_arena arena(threads);
    Result<ViewStats> result =
        arena.execute([&] { return draw(input, picture, options, progress); });
    if (!result.ok()) return result;
    result->threads = threads;
    result->seconds = secondsSince(start);
    return result;
  } catch (const std::bad_alloc&) {
    return Status::budgetTooSmall(fmt::format("{}: out of memory", picture));
  } catch (const std::exception& error) {
    return Status::failed(fmt::format("{}: {}", picture, error.what()));
  }
}

}  // namespace surfeit
