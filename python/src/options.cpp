#include "options.h"

#include <pybind11/stl.h>

#include <array>

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

void takePlace(Options& options, const char* name, glm::dvec3& place) {
  std::optional<std::array<double, 3>> given;
  options.into(name, given);
  if (given) place = {(*given)[0], (*given)[1], (*given)[2]};
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

void takeReading(Options& options, ReadOptions& reading) {
  options.into("channels", reading.channels);
  options.into("part", reading.part);
  options.into("filter", reading.filter);
  options.choose<ColorRange>("color_range", reading.color_range,
                             {{"auto", ColorRange::kAuto},
                              {"8", ColorRange::k8},
                              {"16", ColorRange::k16},
                              {"unit", ColorRange::kUnit}});
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
  options.choose<GatherSides>(
      "sides", quality.sides,
      {{"front", GatherSides::kFront}, {"both", GatherSides::kBoth}, {"back", GatherSides::kBack}});
}

void takeGroups(Options& options, std::uint64_t& groups) {
  const py::object value = options.take("groups");
  if (value.is_none()) return;
  py::object words = value;
  if (!py::isinstance<py::str>(value)) {
    py::list numbers;
    for (const py::handle& each : value) numbers.append(py::str(each));
    words = py::str(",").attr("join")(numbers);
  }
  groups = valueOf(parseGroups(py::cast<std::string>(words)));
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
  options.choose<ReceiverOrder>("order", gather.order,
                                {{"curve", ReceiverOrder::kHilbert},
                                 {"hilbert", ReceiverOrder::kHilbert},
                                 {"morton", ReceiverOrder::kMorton},
                                 {"input", ReceiverOrder::kInput}});
  options.into("cache_split", gather.cache_split);
  options.into("direct_io", gather.direct_io);
  options.into("prefetch", gather.prefetch);
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
