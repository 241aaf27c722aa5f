// Jobs from files to files, and what they are told by: index, gather, convert, normals, tune,
// bounce, lookup, verify, info, cube.
#include <pybind11/numpy.h>
#include <pybind11/pybind11.h>
#include <pybind11/stl.h>

#include <array>
#include <cstring>
#include <optional>
#include <string>
#include <vector>

#include "arrays.h"
#include "bindings.h"
#include "call.h"
#include "errors.h"
#include "options.h"
#include "records.h"
#include "surfeit/cube.h"

namespace surfeit::python {
namespace {

IndexOptions indexOptions(const py::dict& given) {
  Options options(given);
  IndexOptions index;
  takeJob(options, index);
  takeReading(options, index);
  options.into("leaf_capacity", index.leaf_capacity);
  options.into("disk_overlap", index.disk_overlap);
  options.into("full_precision", index.full_precision);
  options.choose<Repeats>("overlap", index.repeats,
                          {{"keep", Repeats::kKeep}, {"thin", Repeats::kThin}});
  std::optional<std::array<double, 3>> origin;
  options.into("origin", origin);
  if (origin) index.origin = glm::dvec3((*origin)[0], (*origin)[1], (*origin)[2]);
  std::optional<std::array<double, 4>> cube;
  options.into("cube", cube);
  if (cube) index.cube = {{(*cube)[0], (*cube)[1], (*cube)[2]}, (*cube)[3]};
  takeUp(options, "up", index.up);
  bool estimates = false;
  options.choose<bool>("normals", estimates, {{"none", false}, {"estimate", true}});
  NormalEstimation estimation;
  takeEstimation(options, estimation);
  if (estimates) index.normals = estimation;
  options.finish();
  return index;
}

py::dict indexFiles(const std::vector<std::string>& inputs, const std::string& output,
                    const py::dict& given, const py::object& watcher) {
  const IndexOptions options = indexOptions(given);
  return record(runFor<IndexStats>(
      watcher, [&](Progress& progress) { return indexClouds(inputs, output, options, progress); }));
}

py::dict indexArrays(const py::list& arrays, const std::string& output, const py::dict& given,
                     const py::object& watcher) {
  const IndexOptions options = indexOptions(given);
  const Columns columns(arrays);
  CloudColumns rows;
  rows.name = "arrays";
  rows.count = columns.count;
  rows.columns = columns.columns;
  rows.values = columns.values;
  return record(runFor<IndexStats>(
      watcher, [&](Progress& progress) { return indexColumns(rows, output, options, progress); }));
}

py::dict gather(const std::string& scene, const std::string& receivers, const std::string& result,
                const py::dict& given, const py::object& watcher) {
  Options options(given);
  GatherOptions gather;
  takeGather(options, gather);
  options.finish();
  return record(runFor<GatherStats>(watcher, [&](Progress& progress) {
    return gatherCloud(scene, receivers, result, gather, progress);
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

// Corners of a box: ((x, y, z), (x, y, z)).
using Corners = std::array<std::array<double, 3>, 2>;

py::dict convert(const std::vector<std::string>& inputs, const std::string& output,
                 const py::dict& given, const py::object& watcher) {
  Options options(given);
  ConvertOptions converting;
  takeJob(options, converting);
  takeReading(options, converting);
  options.into("every", converting.every);
  options.into("spacing", converting.spacing);
  options.into("transform", converting.transform);
  takeUp(options, "up", converting.up);
  std::optional<Corners> crop;
  options.into("crop", crop);
  if (crop) {
    const auto& [min, max] = *crop;
    converting.crop = CropBox{{min[0], min[1], min[2]}, {max[0], max[1], max[2]}};
  }
  options.into("keep", converting.keep);
  options.into("drop", converting.drop);
  options.into("assignments", converting.assignments);
  options.into("like", converting.like);
  options.finish();
  return record(runFor<ConvertStats>(watcher, [&](Progress& progress) {
    return convertClouds(inputs, output, converting, progress);
  }));
}

py::dict normals(const std::string& input, const std::string& output, const py::dict& given,
                 const py::object& watcher) {
  Options options(given);
  NormalsOptions estimating;
  takeJob(options, estimating);
  takeReading(options, estimating);
  takeEstimation(options, estimating.estimation);
  takeUp(options, "up", estimating.up);
  options.into("sizes", estimating.with_sizes);
  options.finish();
  return record(runFor<NormalsStats>(watcher, [&](Progress& progress) {
    return estimateNormals(input, output, estimating, progress);
  }));
}

py::dict bounce(const std::string& scene, const std::string& result, const py::dict& given,
                const py::object& watcher) {
  Options options(given);
  BounceOptions bouncing;
  takeJob(options, bouncing);
  takeQuality(options, bouncing.quality);
  takeGroups(options, bouncing.groups);
  options.into("bounces", bouncing.bounces);
  options.into("surfels_per_receiver", bouncing.surfels_per_receiver);
  options.into("cache_split", bouncing.cache_split);
  options.into("direct_io", bouncing.direct_io);
  options.finish();
  return record(runFor<BounceStats>(
      watcher, [&](Progress& progress) { return bounceScene(scene, result, bouncing, progress); }));
}

py::dict lookup(const std::string& map, const std::string& receivers, const std::string& result,
                const py::dict& given, const py::object& watcher) {
  Options options(given);
  LookupOptions looking;
  takeJob(options, looking);
  takeReading(options, looking);
  options.into("values", looking.values);
  options.into("map_channels", looking.map_channels);
  options.into("map_filter", looking.map_filter);
  options.choose<LookupInterpolation>(
      "interpolation", looking.interpolation,
      {{"smooth", LookupInterpolation::kSmooth}, {"nearest", LookupInterpolation::kNearest}});
  options.into("max_distance", looking.max_distance);
  options.into("filter_width", looking.filter_width);
  options.into("missing", looking.missing);
  options.into("from_space", looking.from_space);
  options.into("to_space", looking.to_space);
  options.into("pref", looking.reference_positions);
  options.into("nref", looking.reference_normals);
  options.finish();
  return record(runFor<LookupStats>(watcher, [&](Progress& progress) {
    return lookupCloud(map, receivers, result, looking, progress);
  }));
}

py::dict verify(const std::string& scene, const py::dict& given, const py::object& watcher) {
  Options options(given);
  JobOptions job;
  takeJob(options, job);
  options.finish();
  return record(runFor<VerifyReport>(watcher, [&](Progress& progress) {
    return verifyScene(scene, job.threads, progress, job.memory_bytes);
  }));
}

py::dict info(const std::string& path, const py::dict& given, const py::object& watcher) {
  Options options(given);
  ReadOptions reading;
  takeReading(options, reading);
  options.finish();
  if (!valueOf(isScene(path))) {
    return record(runFor<CloudInfo>(
        watcher, [&](Progress& progress) { return readCloudInfo(path, reading, progress); }));
  }
  const SceneInfo scene =
      runFor<SceneInfo>(watcher, [&](Progress&) { return readSceneInfo(path); });
  const CloudDensity density = runFor<CloudDensity>(
      watcher, [&](Progress& progress) { return measureSceneDensity(path, progress); });
  py::dict dict = record(scene);
  dict["density"] = record(density);
  return dict;
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

py::dict cube(const std::string& scene, const std::array<double, 3>& at,
              const std::array<double, 3>& normal, const std::array<double, 3>& view,
              const py::dict& given, const py::object& watcher) {
  Options options(given);
  GatherOptions gather;
  takeGather(options, gather);
  options.finish();
  Receiver receiver;
  receiver.position = {at[0], at[1], at[2]};
  receiver.normal = glm::vec3(normal[0], normal[1], normal[2]);
  receiver.view = glm::vec3(view[0], view[1], view[2]);
  const CubeImage image = runFor<CubeImage>(
      watcher, [&](Progress& progress) { return gatherCube(scene, receiver, gather, progress); });
  py::list faces;
  for (const CubeFace& face : image.faces) {
    faces.append(py::make_tuple(vector(face.forward), vector(face.u), vector(face.v)));
  }
  py::dict dict;
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

void addJobs(py::module_& module) {
  module.def("index_files", &indexFiles);
  module.def("index_arrays", &indexArrays);
  module.def("gather", &gather);
  module.def("tune", &tune);
  module.def("convert", &convert);
  module.def("normals", &normals);
  module.def("bounce", &bounce);
  module.def("lookup", &lookup);
  module.def("verify", &verify);
  module.def("info", &info);
  module.def("cube", &cube);
}

}  // namespace surfeit::python
