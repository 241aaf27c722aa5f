// Indexes surfels in memory, asks what the file holds and gathers from it, through the installed
// headers alone.
//
//   consumer DIR

#include <surfeit/engine.h>
#include <surfeit/scene.h>
#include <surfeit/surfel_source.h>
#include <surfeit/version.h>

#include <cmath>
#include <iostream>
#include <string>
#include <vector>

namespace {

// Prints what the library tells.
class Notes : public surfeit::Progress {
 public:
  void note(const std::string& message) override { std::cout << message << '\n'; }
};

// A ceiling of 40 x 40 surfels, one unit above the origin, that faces down and sends light.
std::vector<surfeit::Surfel> ceiling() {
  constexpr int kEdge = 40;
  std::vector<surfeit::Surfel> surfels;
  for (int row = 0; row < kEdge; ++row) {
    for (int column = 0; column < kEdge; ++column) {
      surfeit::Surfel surfel;
      surfel.position = {(float(column) + 0.5f) / kEdge - 0.5f, 1,
                         (float(row) + 0.5f) / kEdge - 0.5f};
      surfel.normal = {0, -1, 0};
      surfel.radius = 0.018f;
      surfel.area = 1.0f / (kEdge * kEdge);
      surfel.radiosity = {1, 0.5f, 0.25f};
      surfels.push_back(surfel);
    }
  }
  return surfels;
}

bool fails(const surfeit::Status& status) {
  if (!status.ok()) std::cerr << status.message() << '\n';
  return !status.ok();
}

int run(const std::string& directory) {
  const std::string path = directory + "/ceiling.sft";
  const std::vector<surfeit::Surfel> surfels = ceiling();
  surfeit::CloudChannels channels;
  channels.normal = channels.radius = channels.area = channels.radiosity = true;
  surfeit::SurfelSpan span(surfels.data(), surfels.size(), channels);
  surfeit::IndexOptions index_options;
  index_options.memory_bytes = 64 << 20;
  Notes progress;
  const auto index = surfeit::indexSurfels(span, path, index_options, progress);
  if (fails(index.status())) return 1;
  const auto report = surfeit::verifyScene(path, 1, progress);
  if (fails(report.status())) return 1;

  surfeit::EngineOptions engine_options;
  engine_options.memory_bytes = 64 << 20;
  auto engine = surfeit::Engine::create(engine_options);
  if (fails(engine.status())) return 1;
  const auto scene = engine->open(path);
  if (fails(scene.status())) return 1;
  surfeit::GatherSettings settings;
  settings.mode = surfeit::GatherMode::kBleeding;
  auto gatherer = engine->gatherer(*scene, settings);
  if (fails(gatherer.status())) return 1;
  surfeit::Receiver receiver;
  receiver.normal = {0, 1, 0};
  surfeit::GatherResult result;
  if (fails(gatherer->gather(&receiver, 1, &result))) return 1;

  // The form factor of a square of edge 1 at distance 1: 4 / pi * a / sqrt(1 + a^2) * atan(a /
  // sqrt(1 + a^2)), a = 1/2
  const double a = 0.5, hypotenuse = std::sqrt(1 + a * a);
  const double expected = 4 / 3.14159265358979 * (a / hypotenuse) * std::atan(a / hypotenuse) / 1;
  std::cout << "surfeit " << surfeit::kVersion << ": " << index->surfels << " surfels, "
            << scene->info().nodes << " nodes, occlusion " << result.occlusion << " (" << expected
            << "), irradiance " << result.irradiance.x << '\n';
  const bool ok = index->surfels == 1600 && scene->info().surfels == 1600 &&
                  report->finding_count == 0 && std::abs(result.occlusion - expected) < 0.01 &&
                  std::abs(result.irradiance.x - expected) < 0.01 &&
                  std::abs(result.irradiance.z - 0.25 * expected) < 0.01;
  if (!ok) std::cerr << "the library did not do what was asked of it\n";
  return ok ? 0 : 1;
}

}  // namespace

int main(int argc, char** argv) {
  if (argc != 2) {
    std::cerr << "usage: consumer DIR\n";
    return 2;
  }
  return run(argv[1]);
}
