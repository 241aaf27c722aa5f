#include "view/cube_picture.h"

#include <OpenEXR/ImfHeader.h>
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <glm/common.hpp>
#include <glm/vec2.hpp>
#include <memory>
#include <utility>

#include "cloud/exr/exr_image_writer.h"
#include "core/guard.h"
#include "core/job_limits.h"
#include "core/program_memory.h"
#include "view/cube_layout.h"
#include "view/picture_file.h"
#include "view/srgb.h"

namespace surfeit {
namespace {

constexpr int kFaceEdge = 128, kConeEdge = 384;  // about, in pixels of the picture
constexpr int kGap = 12;                         // between panels
constexpr glm::vec3 kBackground{0.42f, 0.42f, 0.45f};
// What does not count is mixed with this much of a dark gray
constexpr glm::vec3 kBelowHorizon{0.22f};
constexpr float kDimmed = 0.75f;
// Depth is shown from white to this, and nothing as black
constexpr float kFarthest = 0.12f;
constexpr float kMostDepths = 1e4f;  // farthest over nearest that is told apart
constexpr float kMostLayers = 4;

struct KindLook {
  glm::vec3 color;
  const char* name;
  const char* meaning;
};
// Told apart also by those who see few colors: they differ in lightness
constexpr KindLook kKindLooks[kCubeKinds] = {
    {{0, 0, 0}, "black", "nothing"},
    {{0.16f, 0.35f, 0.80f}, "blue", "flat node"},
    {{0.35f, 0.75f, 0.95f}, "light blue", "facet of a node"},
    {{0.90f, 0.45f, 0.10f}, "orange", "rough node"},
    {{0.97f, 0.90f, 0.45f}, "yellow", "surfel as a patch"},
    {{0.80f, 0.20f, 0.55f}, "magenta", "ray-traced surfel"},
};

struct PlacedPanel {
  CubePanel panel;
  bool is_traced;
};
using PanelRows = std::vector<std::vector<PlacedPanel>>;

// Rows of up to three. With rays, coverage and depth have rows of their own, gathered and traced,
// and the others stand to the right of them, and below.
PanelRows arrange(const CubeViews& cubes, const std::vector<CubePanel>& panels) {
  constexpr std::size_t kColumns = 3;
  PanelRows rows;
  std::vector<PlacedPanel> others;
  for (const CubePanel panel : panels) {
    const bool is_traced = panel == CubePanel::kCoverage || panel == CubePanel::kDepth;
    if (is_traced && cubes.traced != nullptr) {
      rows.push_back({{panel, false}, {panel, true}});
    } else {
      others.push_back({panel, false});
    }
  }
  std::size_t next = 0;
  for (auto& row : rows) {
    if (next < others.size()) row.push_back(others[next++]);
  }
  for (; next < others.size(); ++next) {
    if (rows.empty() || rows.back().size() == kColumns) rows.emplace_back();
    rows.back().push_back(others[next]);
  }
  return rows;
}

// Nearest and farthest of what counts, gathered or traced; 0 and 0 where nothing does.
struct DepthScale {
  float nearest = 0, farthest = 0;

  explicit DepthScale(const CubeViews& cubes) {
    float low = std::numeric_limits<float>::infinity(), high = 0;
    for (const CubeImage* const cube : {cubes.gathered, cubes.traced}) {
      if (cube == nullptr) continue;
      for (const CubePixel& pixel : cube->pixels) {
        if (!(pixel.weight > 0) || !std::isfinite(pixel.depth)) continue;
        low = std::min(low, pixel.depth);
        high = std::max(high, pixel.depth);
      }
    }
    if (!(high > 0)) return;
    farthest = high;
    nearest = std::max(low, high / kMostDepths);
  }
  // 1 at the nearest, kFarthest at the farthest, along the logarithm.
  float brightness(float depth) const {
    if (!std::isfinite(depth)) return 0;
    if (!(farthest > nearest)) return 1;
    const float part = std::log(std::max(depth, nearest) / nearest) / std::log(farthest / nearest);
    return 1 - (1 - kFarthest) * std::min(part, 1.f);
  }
};

glm::vec3 displayLight(const glm::vec3& light, float exposure) {
  glm::vec3 display;
  for (int i = 0; i < 3; ++i) {
    display[i] = srgbFromLinear(std::clamp(std::exp2(exposure) * light[i], 0.f, 1.f));
  }
  return display;
}

glm::vec3 displayValue(const CubePixel& pixel, CubePanel panel, const DepthScale& depths,
                       const CubePictureOptions& options) {
  switch (panel) {
    case CubePanel::kLight:
      return displayLight(pixel.light + pixel.environment, options.exposure);
    case CubePanel::kCoverage:
      return glm::vec3(pixel.coverage);
    case CubePanel::kDepth:
      return glm::vec3(depths.brightness(pixel.depth));
    case CubePanel::kLayers:
      return glm::vec3(std::min(1.f, pixel.layers / kMostLayers));
    case CubePanel::kKind:
      break;
  }
  return kKindLooks[std::size_t(pixel.kind)].color;
}

int zoomOf(const CubeImage& cube, const CubePictureOptions& options) {
  if (options.zoom > 0) return options.zoom;
  const int edge = cube.faces.size() == 1 ? kConeEdge : kFaceEdge;
  return std::max(1, (edge + cube.resolution / 2) / cube.resolution);
}

void drawPanel(const CubeImage& cube, const CubeLayout& layout, CubePanel panel, int left, int top,
               const DepthScale& depths, const CubePictureOptions& options, Picture& picture) {
  const int zoom = zoomOf(cube, options);
  for (int y = 0; y < layout.height() * zoom; ++y) {
    for (int x = 0; x < layout.width() * zoom; ++x) {
      const std::int32_t place = layout.pixel(x / zoom, y / zoom);
      if (place == CubeLayout::kOutside) continue;
      const CubePixel& pixel = cube.pixels[std::size_t(place)];
      glm::vec3 color = displayValue(pixel, panel, depths, options);
      if (!(pixel.weight > 0)) color = glm::mix(color, kBelowHorizon, kDimmed);
      const std::size_t row = std::size_t(top + y) * std::size_t(picture.width);
      picture.pixels[row + std::size_t(left + x)].color = color;
    }
  }
}

// From one panel to the next, in pixels of the picture.
glm::ivec2 panelStep(const CubeViews& cubes, const CubePictureOptions& options) {
  const CubeLayout layout(*cubes.gathered, options.up);
  return zoomOf(*cubes.gathered, options) * glm::ivec2(layout.width(), layout.height()) + kGap;
}

glm::ivec2 pictureSize(const PanelRows& rows, const glm::ivec2& step) {
  std::size_t columns = 0;
  for (const auto& row : rows) columns = std::max(columns, row.size());
  return glm::ivec2(columns, rows.size()) * step + kGap;
}

}  // namespace

std::string_view panelName(CubePanel panel) {
  switch (panel) {
    case CubePanel::kLight:
      return "light";
    case CubePanel::kCoverage:
      return "coverage";
    case CubePanel::kDepth:
      return "depth";
    case CubePanel::kLayers:
      return "layers";
    case CubePanel::kKind:
      break;
  }
  return "kind";
}

std::uint64_t cubePictureBytes(const CubeViews& cubes, const CubePictureOptions& options) {
  const glm::ivec2 size = pictureSize(arrange(cubes, options.panels), panelStep(cubes, options));
  // The picture, its bytes for the encoder, and the file in memory
  constexpr std::uint64_t kPixelBytes = sizeof(Picture::Pixel) + 16;
  return std::uint64_t(size.x) * std::uint64_t(size.y) * kPixelBytes;
}

Picture drawCube(const CubeViews& cubes, const CubePictureOptions& options) {
  const CubeLayout layout(*cubes.gathered, options.up);
  const DepthScale depths(cubes);
  const PanelRows rows = arrange(cubes, options.panels);
  const glm::ivec2 step = panelStep(cubes, options), size = pictureSize(rows, step);

  Picture picture;
  picture.width = size.x;
  picture.height = size.y;
  picture.pixels.assign(std::size_t(picture.width) * std::size_t(picture.height),
                        {.color = kBackground, .alpha = 1});
  for (std::size_t row = 0; row < rows.size(); ++row) {
    for (std::size_t column = 0; column < rows[row].size(); ++column) {
      const PlacedPanel& placed = rows[row][column];
      drawPanel(placed.is_traced ? *cubes.traced : *cubes.gathered, layout, placed.panel,
                kGap + int(column) * step.x, kGap + int(row) * step.y, depths, options, picture);
    }
  }
  return picture;
}

std::string cubeLegend(const CubeViews& cubes, const CubePictureOptions& options) {
  std::string text;
  const PanelRows rows = arrange(cubes, options.panels);
  for (std::size_t row = 0; row < rows.size(); ++row) {
    text += row == 0 ? "panels    " : "          ";
    for (std::size_t i = 0; i < rows[row].size(); ++i) {
      text += fmt::format("{}{}{}", i == 0 ? "" : " | ", panelName(rows[row][i].panel),
                          rows[row][i].is_traced ? " of rays" : "");
    }
    text += "\n";
  }
  const DepthScale depths(cubes);
  for (const CubePanel panel : options.panels) {
    switch (panel) {
      case CubePanel::kLight:
        text += fmt::format("light     radiosity times 2^{:g}, sRGB\n", options.exposure);
        break;
      case CubePanel::kCoverage:
        text += "coverage  black 0, white 1\n";
        break;
      case CubePanel::kDepth:
        text +=
            fmt::format("depth     white {:.4g}, dark gray {:.4g}, by logarithm; black nothing\n",
                        depths.nearest, depths.farthest);
        break;
      case CubePanel::kLayers:
        text += "layers    black 0, grays 1 to 3, white 4 or more\n";
        break;
      case CubePanel::kKind:
        for (std::size_t kind = 0; kind < kCubeKinds; ++kind) {
          const KindLook& look = kKindLooks[kind];
          text += fmt::format("{:<10}{:<11}{}\n", kind == 0 ? "kind" : "", look.name, look.meaning);
        }
        break;
    }
  }
  return text + "dimmed    below the horizon, or outside of the cone\n";
}

Status writeCubeExr(const std::string& path, const CubeViews& cubes, UpAxis up) {
  const CubeLayout layout(*cubes.gathered, up);
  std::vector<ExrImageChannel> channels;
  for (const char* name : {"R", "G", "B", "coverage", "depth", "layers", "kind", "weight"}) {
    channels.push_back({name, ExrPixelType::kFloat});
  }
  if (cubes.traced != nullptr) {
    channels.push_back({"reference.coverage", ExrPixelType::kFloat});
    channels.push_back({"reference.depth", ExrPixelType::kFloat});
  }
  const std::size_t channel_count = channels.size();
  SURFEIT_ASSIGN_OR_RETURN(
      const std::unique_ptr<ExrImageWriter> image,
      ExrImageWriter::create(path, Imf::Header(layout.width(), layout.height()),
                             std::move(channels)));
  for (int y = 0; y < layout.height(); ++y) {
    for (int x = 0; x < layout.width(); ++x) {
      const std::int32_t place = layout.pixel(x, y);
      std::vector<float> values;
      if (place != CubeLayout::kOutside) {
        const CubePixel& pixel = cubes.gathered->pixels[std::size_t(place)];
        const glm::vec3 light = pixel.light + pixel.environment;
        values = {light.x,     light.y,      light.z,           pixel.coverage,
                  pixel.depth, pixel.layers, float(pixel.kind), pixel.weight * pixel.solid_angle};
        if (cubes.traced != nullptr) {
          const CubePixel& traced = cubes.traced->pixels[std::size_t(place)];
          values.insert(values.end(), {traced.coverage, traced.depth});
        }
      }
      values.resize(channel_count, 0);
      for (std::size_t i = 0; i < channel_count; ++i) {
        image->floats(i)[std::size_t(x)] = values[i];
      }
    }
    SURFEIT_RETURN_IF_ERROR(image->writeLine());
  }
  return image->finish();
}

Status writeCubePicture(const std::string& path, const CubeViews& cubes,
                        const CubePictureOptions& options, std::uint64_t memory_bytes) {
  return guarded(path, [&]() -> Status {
    SURFEIT_ASSIGN_OR_RETURN(const PictureFormat format, pictureFormat(path));
    if (format == PictureFormat::kExr) return writeCubeExr(path, cubes, options.up);
    if (!std::isfinite(options.exposure)) {
      return Status::invalidArgument("the exposure must be finite");
    }
    const std::uint64_t needed = programBytes(1) + cubePictureBytes(cubes, options);
    const std::uint64_t budget = memory_bytes > 0 ? memory_bytes : defaultMemoryBytes();
    if (budget < needed) {
      return Status::budgetTooSmall(
          fmt::format("a memory budget of {:.1f} MiB is too small for the picture: {:.1f} MiB is "
                      "the least that "
                      "works; fewer panels (--show) or a smaller --zoom take less",
                      double(budget) / (1 << 20), std::ceil(double(needed) / (1 << 20) * 10) / 10));
    }
    PngOptions png;
    png.is_data = true;
    return writePicture(path, drawCube(cubes, options), png);
  });
}

}  // namespace surfeit
