// The engine: surfeit/engine.h.
#include "surfeit/engine.h"

#include <pybind11/pybind11.h>
#include <pybind11/stl.h>

#include <algorithm>
#include <array>
#include <cstddef>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "arrays.h"
#include "bindings.h"
#include "call.h"
#include "errors.h"
#include "options.h"
#include "records.h"
#include "surfeit/apply_look.h"

namespace surfeit::python {
namespace {

// A call of so few receivers returns soon enough to wait for it without looking up.
constexpr std::size_t kFewReceivers = 512;
// Receivers that are copied to structs at a time, whole groups of a gatherer.
constexpr std::size_t kCopiedReceivers = 4096;

// A gatherer, what it has results for, and a place near them.
class WorldGatherer {
 public:
  WorldGatherer(Gatherer gatherer, std::uint32_t outputs, const glm::dvec3& origin)
      : gatherer_(std::move(gatherer)), outputs_(outputs), origin_(origin) {}

  // `look_given`: options of the look of bounce light.
  py::dict gather(const py::object& positions, const py::object& normals, const py::object& views,
                  const py::object& out, bool keeps_order, int threads, const py::dict& look_given,
                  const py::object& watcher) {
    const BounceLook look = checkedLook(look_given);
    ReceiverColumns columns(positions, normals, views, outputs_, out);
    const auto work = [&](Progress& progress) -> Status {
      SURFEIT_RETURN_IF_ERROR(keeps_order ? gatherInOrder(columns, progress)
                                          : gatherer_.gatherAll(columns, progress, threads));
      return look.isOff() ? Status() : applyTo(columns, look);
    };
    if (columns.count() > kFewReceivers) {
      run(watcher, work);
    } else {
      check(runHere(work));
    }
    return columns.results();
  }

  WorldGatherer another() const {
    return {runFor<Gatherer>(py::none(), [&](Progress&) { return gatherer_.another(); }), outputs_,
            origin_};
  }

  void pause() { gatherer_.pause(); }
  std::uint64_t receivers() const { return gatherer_.receivers(); }
  std::uint64_t invalidReceivers() const { return gatherer_.invalidReceivers(); }

 private:
  template <typename Work>
  static Status runHere(const Work& work) {
    const py::gil_scoped_release release;
    Progress progress;
    return work(progress);
  }

  // Before any work.
  BounceLook checkedLook(const py::dict& given) const {
    Options options(given);
    BounceLook look;
    takeLook(options, look);
    options.finish();
    check(applyLook(look, origin_, nullptr, 0, nullptr));
    if (!look.isOff() && (outputs_ & kOutputIrradiance) == 0) {
      throw py::value_error(
          "look of bounce light: found no output irradiance that it changes, expected mode "
          "bleeding or glossy, or irradiance among the outputs");
    }
    return look;
  }

  Status applyTo(const ReceiverColumns& columns, const BounceLook& look) const {
    std::vector<Receiver> receivers;
    for (std::size_t begin = 0; begin < columns.count(); begin += kCopiedReceivers) {
      const std::size_t end = std::min(columns.count(), begin + kCopiedReceivers);
      receivers.clear();
      for (std::size_t i = begin; i < end; ++i) receivers.push_back(columns.receiver(i));
      SURFEIT_RETURN_IF_ERROR(applyLook(look, origin_, receivers.data(), receivers.size(),
                                        columns.irradiance() + begin));
    }
    return {};
  }

  // Clusters are of consecutive receivers.
  Status gatherInOrder(ReceiverColumns& columns, Progress& progress) {
    progress.beginPhase("gather", columns.count(), "receivers");
    std::vector<Receiver> receivers;
    std::vector<GatherResult> results(std::min(kCopiedReceivers, columns.count()));
    for (std::size_t begin = 0; begin < columns.count(); begin += kCopiedReceivers) {
      const std::size_t end = std::min(columns.count(), begin + kCopiedReceivers);
      receivers.clear();
      for (std::size_t i = begin; i < end; ++i) receivers.push_back(columns.receiver(i));
      SURFEIT_RETURN_IF_ERROR(
          gatherer_.gather(receivers.data(), receivers.size(), results.data(), &progress));
      for (std::size_t i = begin; i < end; ++i) columns.setResult(i, results[i - begin]);
      progress.advance(end - begin);
    }
    return {};
  }

  Gatherer gatherer_;
  std::uint32_t outputs_;
  glm::dvec3 origin_;
};

Engine makeEngine(std::uint64_t memory_bytes, int threads, bool direct_io, bool lobes) {
  EngineOptions options;
  options.memory_bytes = memory_bytes;
  options.threads = threads;
  options.direct_io = direct_io;
  options.lobes = lobes;
  return valueOf(Engine::create(options));
}

Scene openScene(Engine& engine, const std::string& path) {
  return runFor<Scene>(py::none(), [&](Progress&) { return engine.open(path); });
}

Scene openBytes(Engine& engine, const py::bytes& bytes, const std::string& name) {
  const auto view = static_cast<std::string_view>(bytes);
  return runFor<Scene>(py::none(),
                       [&](Progress&) { return engine.openBytes(view.data(), view.size(), name); });
}

// What a gather of these settings has results for (GatherSettings::outputs).
std::uint32_t outputsOf(const GatherSettings& settings, bool has_environment) {
  if (settings.outputs != 0) return settings.outputs;
  std::uint32_t outputs = kOutputOcclusion;
  if (settings.mode != GatherMode::kOcclusion) outputs |= kOutputIrradiance;
  if (has_environment) outputs |= kOutputEnvironment;
  return outputs;
}

using Matrix = std::array<double, 12>;

// The origin of a scene, where it stands in the world.
glm::dvec3 originOf(const std::vector<std::pair<Scene, Matrix>>& scenes) {
  if (scenes.empty()) return glm::dvec3(0);
  const auto& [scene, m] = scenes.front();
  const glm::dvec3 o = scene.info().origin;
  return {m[0] * o.x + m[1] * o.y + m[2] * o.z + m[3], m[4] * o.x + m[5] * o.y + m[6] * o.z + m[7],
          m[8] * o.x + m[9] * o.y + m[10] * o.z + m[11]};
}

WorldGatherer makeGatherer(Engine& engine, const std::vector<std::pair<Scene, Matrix>>& given,
                           const py::dict& settings_given) {
  Options options(settings_given);
  GatherSettings settings;
  takeSettings(options, settings);
  const EnvironmentArray environment(options);
  options.finish();
  std::vector<Instance> instances;
  for (const auto& [scene, matrix] : given) instances.push_back({scene, {matrix}});
  Gatherer gatherer = runFor<Gatherer>(py::none(), [&](Progress&) {
    return engine.gatherer(instances, settings, environment.get());
  });
  return {std::move(gatherer), outputsOf(settings, environment.get() != nullptr), originOf(given)};
}

}  // namespace

void addEngine(py::module_& module) {
  py::class_<Scene>(module, "Scene")
      .def_property_readonly("info", [](const Scene& scene) { return record(scene.info()); })
      .def_property_readonly("path", &Scene::path);
  py::class_<WorldGatherer>(module, "Gatherer")
      .def("gather", &WorldGatherer::gather)
      .def("another", &WorldGatherer::another)
      .def("pause", &WorldGatherer::pause)
      .def_property_readonly("receivers", &WorldGatherer::receivers)
      .def_property_readonly("invalid_receivers", &WorldGatherer::invalidReceivers);
  py::class_<Engine>(module, "Engine")
      .def(py::init(&makeEngine))
      .def("open", &openScene)
      .def("open_bytes", &openBytes)
      .def("gatherer", &makeGatherer)
      .def("statistics", [](const Engine& engine) { return record(engine.statistics()); })
      .def("windows", [](const Engine& engine) { return record(engine.windows()); });
}

}  // namespace surfeit::python
