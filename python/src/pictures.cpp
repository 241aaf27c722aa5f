// Pictures of clouds, passes and cubes. The component `view` (surfeit/view.h, composite.h,
// cube_picture.h).
#include <pybind11/pybind11.h>
#include <pybind11/stl.h>

#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "bindings.h"
#include "call.h"
#include "errors.h"
#include "options.h"
#include "records.h"
#include "surfeit/composite.h"
#include "surfeit/cube_picture.h"
#include "surfeit/view.h"

namespace surfeit::python {
namespace {

using namespace py::literals;

// exposure, background, range, channel: what view and composite share.
template <typename PictureOptions>
void takeDisplay(Options& options, PictureOptions& picture) {
  options.into("channel", picture.channel);
  options.into("exposure", picture.exposure);
  takeVector(options, "background", picture.background);
  std::optional<std::array<double, 2>> range;
  options.into("range", range);
  if (range) picture.range = glm::dvec2((*range)[0], (*range)[1]);
  options.into("memory", picture.memory_bytes);
}

void takePlaceIfGiven(Options& options, const char* name, std::optional<glm::dvec3>& place) {
  std::optional<std::array<double, 3>> given;
  options.into(name, given);
  if (given) place = glm::dvec3((*given)[0], (*given)[1], (*given)[2]);
}

void takeCamera(Options& options, ViewOptions& viewing) {
  takePlaceIfGiven(options, "eye", viewing.camera.eye);
  takePlaceIfGiven(options, "look_at", viewing.camera.look_at);
  takePlaceIfGiven(options, "up_direction", viewing.camera.up);
  takeUp(options, "up", viewing.up);
  options.into("fov", viewing.camera.fov_degrees);
  std::optional<std::array<int, 2>> size;
  options.into("size", size);
  if (!size) return;
  viewing.width = (*size)[0];
  viewing.height = (*size)[1];
}

ViewOptions viewOptions(const py::dict& given) {
  Options options(given);
  ViewOptions viewing;
  takeCamera(options, viewing);
  takeDisplay(options, viewing);
  options.choose<ViewMode>("mode", viewing.mode,
                           {{"discs", ViewMode::kDiscs},
                            {"points", ViewMode::kPoints},
                            {"normals", ViewMode::kNormals}});
  options.into("samples", viewing.samples);
  options.into("point_size", viewing.point_size);
  options.into("radius", viewing.radius);
  options.into("radius_scale", viewing.radius_scale);
  options.into("cull_back", viewing.cull_back);
  options.into("passes", viewing.passes);
  options.into("channels", viewing.channels);
  options.into("part", viewing.part);
  options.into("filter", viewing.filter);
  takeColorRange(options, viewing.color_range);
  options.into("brick", viewing.brick);
  options.into("filter_width", viewing.filter_width);
  options.into("threads", viewing.threads);
  options.finish();
  return viewing;
}

py::dict view(const std::string& input, const std::string& picture, const py::dict& given,
              const py::object& watcher) {
  const ViewOptions viewing = viewOptions(given);
  const auto stats = runFor<ViewStats>(
      watcher, [&](Progress& progress) { return viewCloud(input, picture, viewing, progress); });
  return py::dict(
      "records"_a = stats.records, "skipped_records"_a = stats.skipped_records,
      "drawn_surfels"_a = stats.drawn_surfels, "non_finite_values"_a = stats.non_finite_values,
      "coverage"_a = stats.coverage, "channel"_a = stats.channel,
      "pass_pixels"_a = stats.pass_pixels, "radius_estimated"_a = stats.radius_estimated,
      "mean_estimated_radius"_a = stats.mean_estimated_radius, "eye"_a = place(stats.eye),
      "look_at"_a = place(stats.look_at), "framebuffer_bytes"_a = stats.framebuffer_bytes,
      "threads"_a = stats.threads, "seconds"_a = stats.seconds);
}

py::dict composite(const std::vector<std::string>& inputs, const std::string& picture,
                   const py::dict& given, const py::object& watcher) {
  Options options(given);
  CompositeOptions compositing;
  takeDisplay(options, compositing);
  options.into("reduce", compositing.reduce);
  options.finish();
  const auto stats = runFor<CompositeStats>(watcher, [&](Progress& progress) {
    return compositePicture(inputs, picture, compositing, progress);
  });
  return py::dict("channel"_a = stats.channel, "width"_a = stats.width, "height"_a = stats.height,
                  "pixels"_a = stats.pixels, "non_finite_values"_a = stats.non_finite_values);
}

// The panels of the words of `show`.
void takePanels(Options& options, std::vector<CubePanel>& panels) {
  std::optional<std::vector<std::string>> words;
  options.into("show", words);
  if (!words) return;
  panels.clear();
  for (const std::string& word : *words) {
    py::dict one;
    one["show"] = word;
    Options choice(one);
    CubePanel panel{};
    choice.choose<CubePanel>("show", panel,
                             {{"light", CubePanel::kLight},
                              {"coverage", CubePanel::kCoverage},
                              {"depth", CubePanel::kDepth},
                              {"layers", CubePanel::kLayers},
                              {"kind", CubePanel::kKind}});
    panels.push_back(panel);
  }
}

void cubePicture(const std::string& path, const CubeImage& gathered, const CubeImage* traced,
                 const py::dict& given) {
  Options options(given);
  CubePictureOptions drawing;
  takePanels(options, drawing.panels);
  options.into("zoom", drawing.zoom);
  options.into("exposure", drawing.exposure);
  std::optional<UpAxis> up;
  takeUp(options, "up", up);
  if (up) drawing.up = *up;
  std::uint64_t memory_bytes = 0;
  options.into("memory", memory_bytes);
  options.finish();
  const CubeViews cubes = {&gathered, traced};
  run(py::none(), [&](Progress&) { return writeCubePicture(path, cubes, drawing, memory_bytes); });
}

}  // namespace

void addPictures(py::module_& module) {
  module.def("view", &view);
  module.def("composite", &composite);
  module.def("write_cube_picture", &cubePicture);
}

}  // namespace surfeit::python
