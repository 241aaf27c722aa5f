#include "view/pass_file.h"

#include <OpenEXR/ImfHeader.h>
#include <OpenEXR/ImfStandardAttributes.h>
#include <OpenEXR/ImfStringAttribute.h>
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <glm/geometric.hpp>
#include <glm/vec3.hpp>
#include <limits>
#include <memory>
#include <optional>
#include <utility>
#include <vector>

#include "cloud/exr/exr_image_writer.h"
#include "cloud/exr/exr_reader.h"
#include "view/channel.h"
#include "view/framebuffer.h"
#include "view/row_stream.h"

namespace surfeit {
namespace {

// Shorter sums of normals point nowhere: surfels that face each other within one surface.
constexpr float kShortNormal = 1e-6f;

// Along silhouettes the rims of surfels that turn away just behind them stick out. Their normals
// tell the light there well, and turned around they would look into the object; so only normals
// that point away from the eye by more than this cosine are turned.
constexpr float kGrazingCosine = 0.25f;

// What a pixel sees.
struct PassPixel {
  float depth = 0;  // 0: nothing
  glm::vec3 normal{0};
  std::array<glm::vec3, 2> colors{glm::vec3(0), glm::vec3(0)};  // of kColorPasses
};

// A pass with three values of the cloud itself.
struct ColorPass {
  const char* name;
  std::size_t index;
};
constexpr ColorPass kColorPasses[] = {{"albedo", 0}, {"radiosity", 1}};

Imath::M44f worldToCamera(const Camera& camera) {
  const ViewAxes& axes = camera.axes();
  const glm::dvec3 columns[3] = {axes.right, axes.up, axes.forward};
  Imath::M44f matrix;
  for (int c = 0; c < 3; ++c) {
    for (int r = 0; r < 3; ++r) matrix[r][c] = float(columns[c][r] + 0.0);  // no -0
    matrix[3][c] = float(0.0 - glm::dot(camera.eye(), columns[c]));
  }
  return matrix;
}

// x and y from 0 to 1 over the picture, y downwards, after the division by w = depth.
Imath::M44f worldToNdc(const Camera& camera) {
  const float slope_x = camera.slopeX(float(camera.width())), slope_y = camera.slopeY(0);
  const Imath::M44f ndc_from_camera(0.5f / slope_x, 0, 0, 0,   //
                                    0, -0.5f / slope_y, 0, 0,  //
                                    0.5f, 0.5f, 1, 1,          //
                                    0, 0, -camera.nearDepth(), 0);
  return worldToCamera(camera) * ndc_from_camera;
}

// Draws the passes one after the other into one framebuffer.
class PassRenderer {
 public:
  PassRenderer(CloudRows& rows, const RenderStyle& style, const Camera& camera, Progress& progress)
      : rows_(rows),
        style_(style),
        camera_(camera),
        progress_(progress),
        framebuffer_(camera.width(), camera.height(), 1),
        pixels_(std::size_t(camera.width()) * std::size_t(camera.height())) {}

  Status draw() {
    style_.value_map = {};
    style_.is_normal_map = true;
    {
      CloudRenderer renderer(style_, camera_, framebuffer_);
      SURFEIT_RETURN_IF_ERROR(
          streamRows(rows_, "depth", progress_,
                     [&](std::span<const std::byte> batch) { renderer.findFront(batch); }));
      renderer.closeFront();
    }
    SURFEIT_RETURN_IF_ERROR(drawValues("normal"));
    keep([&](PassPixel& pixel, const glm::vec3& value, float depth, const glm::vec3& ray) {
      pixel.depth = depth;
      pixel.normal = unitNormal(2.0f * value - 1.0f, ray);
    });

    style_.is_normal_map = false;
    for (const ColorPass& pass : kColorPasses) {
      SURFEIT_ASSIGN_OR_RETURN(const std::optional<Channel> channel, findColor(pass.name));
      if (!channel) continue;
      style_.channel = &*channel;
      framebuffer_.clearValues();
      SURFEIT_RETURN_IF_ERROR(drawValues(pass.name));
      keep([&](PassPixel& pixel, const glm::vec3& value, float, const glm::vec3&) {
        pixel.colors[pass.index] = value;
      });
      has_color_[pass.index] = true;
    }
    return {};
  }

  const std::vector<PassPixel>& pixels() const { return pixels_; }
  bool hasColor(std::size_t index) const { return has_color_[index]; }

 private:
  // As the channels lit and indirect choose: the cloud's color where it has no such triple.
  Result<std::optional<Channel>> findColor(const char* name) const {
    const std::vector<std::string> names = Channel::list(rows_.element());
    for (const char* candidate : {name, "color"}) {
      if (std::find(names.begin(), names.end(), candidate) == names.end()) continue;
      SURFEIT_ASSIGN_OR_RETURN(Channel channel,
                               Channel::find(rows_.element(), candidate, rows_.path()));
      return std::optional<Channel>(std::move(channel));
    }
    return std::optional<Channel>();
  }

  Status drawValues(const char* name) {
    CloudRenderer renderer(style_, camera_, framebuffer_);
    RenderCounts counts;
    SURFEIT_RETURN_IF_ERROR(streamRows(
        rows_, name, progress_,
        [&](std::span<const std::byte> batch) { counts.add(renderer.accumulate(batch)); }));
    if (counts.non_finite_values > 0) {
      progress_.note(fmt::format("{}: {} values of {} are not finite; magenta in the passes",
                                 rows_.path(), counts.non_finite_values, name));
    }
    return {};
  }

  template <typename Keep>
  void keep(const Keep& visit) {
    for (int y = 0; y < camera_.height(); ++y) {
      const std::span<const Framebuffer::Sample> samples = framebuffer_.row(y);
      for (int x = 0; x < camera_.width(); ++x) {
        const Framebuffer::Sample& sample = samples[std::size_t(x)];
        if (!(sample.weight > 0)) continue;
        const glm::vec3 ray(camera_.slopeX(float(x) + 0.5f), camera_.slopeY(float(y) + 0.5f), 1);
        visit(pixels_[std::size_t(y) * std::size_t(camera_.width()) + std::size_t(x)],
              sample.sum / sample.weight, sample.depth_sum / sample.weight, ray);
      }
    }
  }

  // Turned towards the eye; `ray` in camera space.
  glm::vec3 unitNormal(const glm::vec3& sum, const glm::vec3& ray) const {
    const glm::vec3 direction = glm::normalize(camera_.worldFromCameraDirection(ray));
    const float length = glm::length(sum);
    if (!(length > kShortNormal)) return -direction;
    const glm::vec3 normal = sum / length;
    return glm::dot(normal, direction) > kGrazingCosine ? -normal : normal;
  }

  CloudRows& rows_;
  RenderStyle style_;
  const Camera& camera_;
  Progress& progress_;
  Framebuffer framebuffer_;
  std::vector<PassPixel> pixels_;
  std::array<bool, 2> has_color_{};
};

// The channels of the file, in the order in which writeLine fills them.
std::vector<ExrImageChannel> passChannels(const PassRenderer& passes) {
  std::vector<ExrImageChannel> channels;
  for (const char* name : {"P.X", "P.Y", "P.Z", "N.X", "N.Y", "N.Z", "A", "Z"}) {
    channels.push_back({name, ExrPixelType::kFloat});
  }
  for (const ColorPass& pass : kColorPasses) {
    if (!passes.hasColor(pass.index)) continue;
    for (const char* end : {"R", "G", "B"}) {
      channels.push_back({fmt::format("{}.{}", pass.name, end), ExrPixelType::kFloat});
    }
  }
  if (passes.hasColor(1)) {
    for (const char* name : {"R", "G", "B"}) channels.push_back({name, ExrPixelType::kHalf});
  }
  return channels;
}

// Fills the values of a pixel, channel after channel.
void fillPixel(const PassPixel& pixel, const PassRenderer& passes, const Camera& camera, int x,
               int y, ExrImageWriter& image) {
  std::size_t channel = 0;
  const auto put = [&](float value) { image.floats(channel++)[std::size_t(x)] = value; };
  const auto putTriple = [&](const glm::vec3& value) {
    for (int i = 0; i < 3; ++i) put(value[i]);
  };
  const bool is_seen = pixel.depth > 0;
  const double depth(pixel.depth);
  const glm::dvec3 place = camera.worldFromCamera(
      depth * glm::dvec3(camera.slopeX(float(x) + 0.5f), camera.slopeY(float(y) + 0.5f), 1));
  putTriple(is_seen ? glm::vec3(place) : glm::vec3(0));
  putTriple(pixel.normal);
  put(is_seen ? 1 : 0);
  put(is_seen ? pixel.depth : std::numeric_limits<float>::infinity());
  for (const ColorPass& pass : kColorPasses) {
    if (passes.hasColor(pass.index)) putTriple(pixel.colors[pass.index]);
  }
  if (passes.hasColor(1)) putTriple(pixel.colors[1]);
}

}  // namespace

std::uint64_t passBytes(int width, int height) {
  return Framebuffer::bytes(width, height, 1) +
         std::uint64_t(width) * std::uint64_t(height) * sizeof(PassPixel);
}

Result<std::uint64_t> writePasses(const std::string& path, CloudRows& rows,
                                  const RenderStyle& style, const Camera& camera,
                                  Progress& progress) {
  PassRenderer passes(rows, style, camera, progress);
  SURFEIT_RETURN_IF_ERROR(passes.draw());

  Imf::Header header(camera.width(), camera.height());
  Imf::addWorldToCamera(header, worldToCamera(camera));
  Imf::addWorldToNDC(header, worldToNdc(camera));
  if (passes.hasColor(1)) {
    header.insert(kExrMainLayerAttribute, Imf::StringAttribute("radiosity"));
  }
  SURFEIT_ASSIGN_OR_RETURN(const std::unique_ptr<ExrImageWriter> image,
                           ExrImageWriter::create(path, header, passChannels(passes)));
  std::uint64_t seen = 0;
  auto pixel = passes.pixels().begin();
  for (int y = 0; y < camera.height(); ++y) {
    for (int x = 0; x < camera.width(); ++x, ++pixel) {
      seen += pixel->depth > 0 ? 1 : 0;
      fillPixel(*pixel, passes, camera, x, y, *image);
    }
    SURFEIT_RETURN_IF_ERROR(image->writeLine());
  }
  SURFEIT_RETURN_IF_ERROR(image->finish());
  return seen;
}

}  // namespace surfeit
