// Samples a mesh, draws the surfels, indexes them and gathers, with the components `sample` and
// `view`.
//
//   sample_consumer DIR

#include <surfeit/engine.h>
#include <surfeit/index.h>
#include <surfeit/sample.h>
#include <surfeit/view.h>

#include <cmath>
#include <fstream>
#include <iostream>
#include <string>

namespace {

bool fails(const surfeit::Status& status) {
  if (!status.ok()) std::cerr << status.message() << '\n';
  return !status.ok();
}

// A square of edge 1 at height 1 that faces down.
void writeCeiling(const std::string& path) {
  std::ofstream(path) << "v -.5 1 -.5\nv .5 1 -.5\nv .5 1 .5\nv -.5 1 .5\nf 1 2 3 4\n";
}

int run(const std::string& directory) {
  const std::string mesh = directory + "/square.obj", cloud = directory + "/square.ply",
                    scene_path = directory + "/square.sft", picture = directory + "/square.png";
  surfeit::Progress progress;
  writeCeiling(mesh);

  surfeit::SampleOptions options;
  options.count = 2000;
  options.threads = 1;
  surfeit::DirectionalLight sun;
  sun.direction = {0, 1, 0};
  sun.irradiance = {2, 2, 2};
  options.surroundings.lights.directionals.push_back(sun);
  const auto sampled = surfeit::sampleMeshes({mesh}, cloud, options, progress);
  if (fails(sampled.status())) return 1;

  surfeit::ViewOptions looking;
  looking.width = looking.height = 64;
  looking.threads = 1;
  looking.camera.eye = glm::dvec3(0, -1, 0.1);
  const auto seen = surfeit::viewCloud(cloud, picture, looking, progress);
  if (fails(seen.status())) return 1;

  surfeit::IndexOptions indexing;
  indexing.memory_bytes = 64 << 20;
  indexing.threads = 1;
  const auto indexed = surfeit::indexClouds({cloud}, scene_path, indexing, progress);
  if (fails(indexed.status())) return 1;

  surfeit::EngineOptions engine_options;
  engine_options.memory_bytes = 64 << 20;
  auto engine = surfeit::Engine::create(engine_options);
  if (fails(engine.status())) return 1;
  const auto scene = engine->open(scene_path);
  if (fails(scene.status())) return 1;
  surfeit::GatherSettings settings;
  settings.mode = surfeit::GatherMode::kBleeding;
  auto gatherer = engine->gatherer(*scene, settings);
  if (fails(gatherer.status())) return 1;
  surfeit::Receiver receiver;
  receiver.normal = {0, 1, 0};
  surfeit::GatherResult result;
  if (fails(gatherer->gather(&receiver, 1, &result))) return 1;

  // The square covers .239 of the hemisphere (main.cpp), and reflects half of what it gets
  std::cout << sampled->surfels << " surfels of area " << sampled->area << ", " << seen->channel
            << " covers " << seen->coverage << " of the picture, occlusion " << result.occlusion
            << ", irradiance " << result.irradiance.x << '\n';
  const bool ok = sampled->surfels == 2000 && std::abs(sampled->area - 1) < 1e-6 &&
                  seen->coverage > 0.1 && std::abs(result.occlusion - 0.239f) < 0.01f &&
                  std::abs(result.irradiance.x - 0.239f) < 0.01f;
  if (!ok) std::cerr << "the library did not do what was asked of it\n";
  return ok ? 0 : 1;
}

}  // namespace

int main(int argc, char** argv) {
  if (argc != 2) {
    std::cerr << "usage: sample_consumer DIR\n";
    return 2;
  }
  return run(argv[1]);
}
