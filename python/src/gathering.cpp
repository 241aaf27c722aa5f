// Gathers from file to file, at once or in shards, their forecasts, and the cube of one receiver:
// surfeit/bake.h, shards.h, tune.h, cube.h.
#include <pybind11/numpy.h>
#include <pybind11/pybind11.h>
#include <pybind11/stl.h>

#include <array>
#include <cstdint>
#include <cstring>
#include <string>
#include <type_traits>
#include <vector>

#include "bindings.h"
#include "call.h"
#include "errors.h"
#include "options.h"
#include "records.h"
#include "surfeit/cube.h"
#include "surfeit/shards.h"
#include "surfeit/tune.h"

namespace surfeit::python {
namespace {

GatherOptions gatherOptions(const py::dict& given) {
  Options options(given);
  GatherOptions gather;
  takeGather(options, gather);
  options.finish();
  return gather;
}

// And the stage of a gather from file to file.
GatherOptions gatherJobOptions(const py::dict& given) {
  Options options(given);
  GatherOptions gather;
  takeGather(options, gather);
  options.into("stage", gather.stage_directory);
  options.into("stage_limit", gather.stage_limit_bytes);
  options.finish();
  return gather;
}

py::dict gather(const std::string& scene, const std::string& receivers, const std::string& result,
                const py::dict& given, const py::object& watcher) {
  const GatherOptions options = gatherJobOptions(given);
  return record(runFor<GatherStats>(watcher, [&](Progress& progress) {
    return gatherCloud(scene, receivers, result, options, progress);
  }));
}

// Shards first to last, of count.
py::dict gatherShardsOf(const std::string& scene, const std::string& receivers,
                        const std::string& result, const std::array<int, 3>& shards,
                        const py::dict& given, const py::object& watcher) {
  const GatherOptions options = gatherJobOptions(given);
  const ShardRange range = {shards[0], shards[1], shards[2]};
  return record(runFor<ShardStats>(watcher, [&](Progress& progress) {
    return gatherShards(scene, receivers, result, options, range, progress);
  }));
}

py::dict resume(const std::string& scene, const std::string& receivers, const std::string& result,
                int parts, const py::dict& given, const py::object& watcher) {
  const GatherOptions options = gatherJobOptions(given);
  return record(runFor<ShardStats>(watcher, [&](Progress& progress) {
    return gatherResumable(scene, receivers, result, options, parts, progress);
  }));
}

py::dict merge(const std::string& scene, const std::string& receivers, const std::string& result,
               const py::dict& given, const py::object& watcher) {
  Options options(given);
  MergeOptions merging;
  takeJob(options, merging);
  options.into("shards", merging.count);
  options.into("remove_shards", merging.removes_shards);
  options.finish();
  return record(runFor<MergeStats>(watcher, [&](Progress& progress) {
    return mergeShards(scene, receivers, result, merging, progress);
  }));
}

py::dict forecastGather(const std::string& scene, const std::string& receivers, const py::dict& given,
                  const py::object& watcher) {
  const GatherOptions options = gatherJobOptions(given);
  return record(runFor<GatherForecast>(watcher, [&](Progress& progress) {
    return forecastGather(scene, receivers, options, progress);
  }));
}

py::dict tune(const std::string& scene, const std::string& receivers, const py::dict& given,
              const py::object& watcher) {
  Options options(given);
  TuneOptions tuning;
  options.into("sample_receivers", tuning.sample_receivers);
  options.into("check", tuning.check);
  takeGather(options, tuning.gather);
  options.finish();
  return record(runFor<TuneReport>(
      watcher, [&](Progress& progress) { return tuneGather(scene, receivers, tuning, progress); }));
}

// A member of all pixels as an array (faces, rows, columns, ...).
template <typename T>
py::array pixelArray(const CubeImage& cube, T CubePixel::*member) {
  using Number =
      std::conditional_t<std::is_same_v<T, glm::vec3>, float,
                         std::conditional_t<std::is_same_v<T, CubeKind>, std::uint8_t, T>>;
  const py::ssize_t n = cube.resolution;
  std::vector<py::ssize_t> shape = {py::ssize_t(cube.faces.size()), n, n};
  if (sizeof(T) > sizeof(Number)) shape.push_back(3);
  py::array_t<Number> array(shape);
  Number* to = array.mutable_data();
  for (const CubePixel& pixel : cube.pixels) {
    std::memcpy(to, &(pixel.*member), sizeof(T));
    to += sizeof(T) / sizeof(Number);
  }
  return array;
}

py::tuple vector(const glm::vec3& v) { return py::make_tuple(v.x, v.y, v.z); }

CubeImage cube(const std::string& scene, const Receiver& receiver, const py::dict& given,
               const py::object& watcher) {
  const GatherOptions options = gatherOptions(given);
  return runFor<CubeImage>(
      watcher, [&](Progress& progress) { return gatherCube(scene, receiver, options, progress); });
}

Receiver makeReceiver(const std::array<double, 3>& at, const std::array<double, 3>& normal,
                      const std::array<double, 3>& view) {
  Receiver receiver;
  receiver.position = {at[0], at[1], at[2]};
  receiver.normal = glm::vec3(normal[0], normal[1], normal[2]);
  receiver.view = glm::vec3(view[0], view[1], view[2]);
  return receiver;
}

// The receiver of a row of a cloud.
Receiver readReceiver(const std::string& cloud, std::uint64_t number, const py::dict& given,
                      const py::object& watcher) {
  Options options(given);
  ReadOptions reading;
  takeReading(options, reading);
  options.finish();
  return runFor<Receiver>(watcher, [&](Progress& progress) {
    return readCubeReceiver(cloud, number, reading.channels, reading.part, progress,
                            reading.filter);
  });
}

py::dict cubeArrays(const CubeImage& image) {
  py::list faces;
  for (const CubeFace& face : image.faces) {
    faces.append(py::make_tuple(vector(face.forward), vector(face.u), vector(face.v)));
  }
  const glm::dvec3& at = image.receiver.position;
  py::dict dict;
  dict["at"] = py::make_tuple(at.x, at.y, at.z);
  dict["normal"] = vector(image.receiver.normal);
  dict["faces"] = faces;
  dict["direction"] = pixelArray(image, &CubePixel::direction);
  dict["solid_angle"] = pixelArray(image, &CubePixel::solid_angle);
  dict["weight"] = pixelArray(image, &CubePixel::weight);
  dict["coverage"] = pixelArray(image, &CubePixel::coverage);
  dict["pixel_occlusion"] = pixelArray(image, &CubePixel::occlusion);
  dict["light"] = pixelArray(image, &CubePixel::light);
  dict["pixel_environment"] = pixelArray(image, &CubePixel::environment);
  dict["depth"] = pixelArray(image, &CubePixel::depth);
  dict["layers"] = pixelArray(image, &CubePixel::layers);
  dict["filled"] = pixelArray(image, &CubePixel::filled);
  dict["kind"] = pixelArray(image, &CubePixel::kind);
  dict["occlusion"] = image.occlusion;
  dict["irradiance"] = vector(image.irradiance);
  dict["environment"] = vector(image.environment);
  dict["contributions"] = image.contributions;
  dict["traced_surfels"] = image.traced_surfels;
  return dict;
}

}  // namespace

void addGathering(py::module_& module) {
  py::class_<Receiver>(module, "Receiver").def(py::init(&makeReceiver));
  py::class_<CubeImage>(module, "Cube").def("arrays", &cubeArrays);
  module.def("gather", &gather);
  module.def("gather_shards", &gatherShardsOf);
  module.def("gather_resumable", &resume);
  module.def("merge", &merge);
  module.def("forecast_gather", &forecastGather);
  module.def("tune", &tune);
  module.def("read_receiver", &readReceiver);
  module.def("cube", &cube);
}

}  // namespace surfeit::python
