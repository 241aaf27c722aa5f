#include "options.h"

#include <pybind11/stl.h>

#include <array>
#include <cmath>
#include <tuple>

#include "errors.h"
#include "surfeit/scene.h"

namespace surfeit::python {
namespace {

std::string represent(const py::object& value) { return py::cast<std::string>(py::repr(value)); }

// "occlusion,irradiance", or a sequence of such words.
void takeOutputs(Options& options, std::uint32_t& outputs) {
  const py::object value = options.take("outputs");
  if (value.is_none()) return;
  const py::object words =
      py::isinstance<py::str>(value) ? value : py::str(",").attr("join")(value);
  outputs = valueOf(parseOutputs(py::cast<std::string>(words)));
}

void takeWeights(Options& options, GatherWeights& weights) {
  using Distribution = GatherWeights::Distribution;
  using FalloffMode = GatherWeights::FalloffMode;
  options.choose<Distribution>(
      "distribution", weights.distribution,
      {{"cosine", Distribution::kCosine}, {"uniform", Distribution::kUniform}});
  options.into("cone_angle", weights.cone_angle);
  options.into("roughness", weights.roughness);
  options.into("falloff", weights.falloff);
  options.choose<FalloffMode>(
      "falloff_mode", weights.falloff_mode,
      {{"exponential", FalloffMode::kExponential}, {"polynomial", FalloffMode::kPolynomial}});
  options.into("occlusion_by_brightness", weights.by_brightness);
}

}  // namespace

py::object Options::take(const char* name) {
  if (!left_.contains(name)) return py::none();
  return left_.attr("pop")(name);
}

void Options::finish() const {
  if (left_.empty()) return;
  std::string names;
  for (const auto& [name, value] : left_) {
    names += (names.empty() ? "" : ", ") + py::cast<std::string>(py::str(name));
  }
  throw py::type_error("unknown options: " + names);
}

void Options::refuseType(const char* name, const py::object& value) {
  throw py::type_error(std::string(name) + ": found " + represent(value) + " of type " +
                       py::cast<std::string>(py::type::of(value).attr("__name__")));
}

void Options::refuseWord(const char* name, const py::object& value, const std::string& expected) {
  throw py::value_error(std::string(name) + ": found " + represent(value) + ", expected one of " +
                        expected);
}

void takePlace(Options& options, const char* name, glm::dvec3& place) {
  std::optional<std::array<double, 3>> given;
  options.into(name, given);
  if (given) place = {(*given)[0], (*given)[1], (*given)[2]};
}

void takeVector(Options& options, const char* name, glm::vec3& vector) {
  glm::dvec3 place(vector);
  takePlace(options, name, place);
  vector = glm::vec3(place);
}

void takeUp(Options& options, const char* name, std::optional<UpAxis>& up) {
  options.choose<std::optional<UpAxis>>(name, up,
                                        {{"x", UpAxis::kX}, {"y", UpAxis::kY}, {"z", UpAxis::kZ}});
}

void takeJob(Options& options, JobOptions& job) {
  options.into("memory", job.memory_bytes);
  options.into("threads", job.threads);
  options.into("strict", job.strict);
  options.into("temporary_directory", job.temporary_directory);
}

void takeColorRange(Options& options, ColorRange& range) {
  options.choose<ColorRange>("color_range", range,
                             {{"auto", ColorRange::kAuto},
                              {"8", ColorRange::k8},
                              {"10", ColorRange::k10},
                              {"12", ColorRange::k12},
                              {"16", ColorRange::k16},
                              {"unit", ColorRange::kUnit}});
}

void takeReading(Options& options, ReadOptions& reading) {
  options.into("channels", reading.channels);
  options.into("part", reading.part);
  options.into("filter", reading.filter);
  takeColorRange(options, reading.color_range);
}

void takeQuality(Options& options, GatherQuality& quality) {
  std::optional<QualityPreset> preset;
  options.choose<std::optional<QualityPreset>>("quality", preset,
                                               {{"draft", QualityPreset::kDraft},
                                                {"standard", QualityPreset::kStandard},
                                                {"final", QualityPreset::kFinal}});
  if (preset) setQuality(*preset, quality);
  options.into("max_solid_angle", quality.max_solid_angle);
  options.into("raster_resolution", quality.raster_resolution);
  options.into("bias", quality.bias);
  options.into("near_field_radii", quality.near_field_radii);
  options.into("max_distance", quality.max_distance);
  options.into("max_variation", quality.max_variation);
  options.into("max_pixel_dist", quality.max_pixel_distance);
  options.choose<GatherSides>(
      "sides", quality.sides,
      {{"front", GatherSides::kFront}, {"both", GatherSides::kBoth}, {"back", GatherSides::kBack}});
}

void takeGroups(Options& options, std::uint64_t& groups) {
  std::optional<std::string> text;
  options.into("groups", text);
  if (text) groups = valueOf(parseGroups(*text));
}

void takeSettings(Options& options, GatherSettings& settings) {
  options.choose<GatherMode>("mode", settings.mode,
                             {{"occlusion", GatherMode::kOcclusion},
                              {"bleeding", GatherMode::kBleeding},
                              {"glossy", GatherMode::kGlossy}});
  takeOutputs(options, settings.outputs);
  takeQuality(options, settings.quality);
  takeWeights(options, settings.weights);
  takeGroups(options, settings.groups);
  std::vector<std::pair<std::uint32_t, float>> gains;
  options.into("gain", gains);
  for (const auto& [group, gain] : gains) settings.gains.push_back({group, gain});
  takePlace(options, "eye", settings.eye);
}

void takePlacement(Options& options, EnvironmentPlacement& placement) {
  options.into("environment_rotation", placement.rotation);
  options.into("environment_intensity", placement.intensity);
  takeUp(options, "environment_up", placement.up);
}

void takeGather(Options& options, GatherOptions& gather) {
  takeSettings(options, gather);
  takeJob(options, gather);
  takeReading(options, gather);
  options.into("environment", gather.environment.path);
  takePlacement(options, gather.environment);
  takeLook(options, gather.look);
  options.choose<ReceiverOrder>("order", gather.order,
                                {{"curve", ReceiverOrder::kHilbert},
                                 {"hilbert", ReceiverOrder::kHilbert},
                                 {"morton", ReceiverOrder::kMorton},
                                 {"input", ReceiverOrder::kInput}});
  options.into("cache_split", gather.cache_split);
  options.into("direct_io", gather.direct_io);
  options.into("prefetch", gather.prefetch);
}

namespace {

// gain, saturation and tint, each behind the prefix.
void takeCorrection(Options& options, const std::string& prefix, ColorCorrection& correction) {
  options.into((prefix + "gain").c_str(), correction.gain);
  options.into((prefix + "saturation").c_str(), correction.saturation);
  takeVector(options, (prefix + "tint").c_str(), correction.tint);
}

// The two ends of a fall.
void takeFall(Options& options, const char* name, float& inner, float& outer) {
  std::optional<std::array<double, 2>> ends;
  options.into(name, ends);
  if (!ends) return;
  inner = float((*ends)[0]);
  outer = float((*ends)[1]);
}

}  // namespace

void takeLook(Options& options, BounceLook& look) {
  takeCorrection(options, "bounce_", look.correction);
  std::vector<py::dict> filters;
  options.into("bounce_filter", filters);
  for (const py::dict& given : filters) {
    Options words(given);
    BounceFilter filter;
    takePlace(words, "centre", filter.centre);
    takeFall(words, "radius", filter.inner_radius, filter.outer_radius);
    takeVector(words, "direction", filter.direction);
    takeFall(words, "angle", filter.inner_angle, filter.outer_angle);
    takeCorrection(words, "", filter.correction);
    words.finish();
    look.filters.push_back(filter);
  }
}

void takeGroupCorrections(Options& options, std::vector<GroupCorrection>& corrections) {
  std::vector<py::dict> of_groups;
  options.into("group_corrections", of_groups);
  for (const py::dict& given : of_groups) {
    Options words(given);
    GroupCorrection correction;
    words.into("group", correction.group);
    takeCorrection(words, "", correction.correction);
    words.finish();
    corrections.push_back(correction);
  }
}

void takeDensity(Options& options, CameraDensity& density) {
  double fov_degrees = DensityCamera().fov_degrees;
  options.into("fov", fov_degrees);
  std::vector<std::array<double, 7>> cameras;
  options.into("camera", cameras);
  for (const std::array<double, 7>& n : cameras) {
    DensityCamera camera;
    camera.eye = {n[0], n[1], n[2]};
    camera.look_at = {n[3], n[4], n[5]};
    camera.fov_degrees = std::isnan(n[6]) ? fov_degrees : n[6];
    density.cameras.push_back(camera);
  }
  std::vector<std::string> files;
  options.into("camera_file", files);
  for (const std::string& file : files) {
    const std::vector<DensityCamera> more = valueOf(readDensityCameras(file, fov_degrees));
    density.cameras.insert(density.cameras.end(), more.begin(), more.end());
  }
  options.into("pixels", density.pixels);
  options.into("max_solid_angle", density.max_solid_angle);
  options.into("stereo", density.stereo);
  std::optional<std::array<int, 2>> size;
  options.into("size", size);
  if (size) std::tie(density.width, density.height) = std::tie((*size)[0], (*size)[1]);
  std::optional<std::array<int, 4>> crop;
  options.into("camera_crop", crop);
  if (crop) density.crop = PixelWindow{(*crop)[0], (*crop)[1], (*crop)[2], (*crop)[3]};
}

void takeEstimation(Options& options, NormalEstimation& estimation) {
  using Toward = NormalOrientation::Toward;
  NormalOrientation& orientation = estimation.orientation;
  options.choose<Toward>("toward", orientation.toward,
                         {{"up", Toward::kUp},
                          {"sensor", Toward::kSensor},
                          {"outward", Toward::kOutward},
                          {"consistent", Toward::kConsistent},
                          {"trajectory", Toward::kTrajectory}});
  takePlace(options, "sensor", orientation.sensor);
  options.into("trajectory", orientation.trajectory);
  options.choose<bool>("thin", estimation.thin_is_two_sided,
                       {{"spheres", false}, {"two-sided", true}});
}

EnvironmentArray::EnvironmentArray(Options& options) {
  const py::object given = options.take("environment");
  EnvironmentPlacement placement;
  takePlacement(options, placement);
  if (given.is_none()) return;
  array = py::array_t<float, py::array::c_style | py::array::forcecast>::ensure(given);
  if (!array || array.ndim() != 3 || array.shape(2) != 3) {
    PyErr_Clear();
    throw py::value_error("environment: expected an array of shape (height, width, 3)");
  }
  static_assert(sizeof(glm::vec3) == 3 * sizeof(float));
  pixels.emplace();
  static_cast<EnvironmentPlacement&>(*pixels) = placement;
  pixels->height = int(array.shape(0));
  pixels->width = int(array.shape(1));
  pixels->pixels = reinterpret_cast<const glm::vec3*>(array.data());
}

}  // namespace surfeit::python
