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

namespace surfeit::python {
namespace {

// A call of so few receivers returns soon enough to wait for it without looking up.
constexpr std::size_t kFewReceivers = 512;
// Receivers that are copied to structs at a time, whole groups of a gatherer.
constexpr std::size_t kCopiedReceivers = 4096;

// A gatherer and what it has results for.
class WorldGatherer {
 public:
  WorldGatherer(Gatherer gatherer, std::uint32_t outputs)
      : gatherer_(std::move(gatherer)), outputs_(outputs) {}

  py::dict gather(const py::object& positions, const py::object& normals, const py::object& views,
                  const py::object& out, bool keeps_order, int threads, const py::object& watcher) {
    ReceiverColumns columns(positions, normals, views, outputs_, out);
    const auto work = [&](Progress& progress) {
      return keeps_order ? gatherInOrder(columns, progress)
                         : gatherer_.gatherAll(columns, progress, threads);
    };
    if (columns.count() > kFewReceivers) {
      run(watcher, work);
    } else {
      check(runHere(work));
    }
    return columns.results();
  }

  WorldGatherer another() const {
    return {runFor<Gatherer>(py::none(), [&](Progress&) { return gatherer_.another(); }), outputs_};
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
};

Engine makeEngine(std::uint64_t memory_bytes, int threads, bool direct_io) {
  EngineOptions options;
  options.memory_bytes = memory_bytes;
  options.threads = threads;
  options.direct_io = direct_io;
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
  return {std::move(gatherer), outputsOf(settings, environment.get() != nullptr)};
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
