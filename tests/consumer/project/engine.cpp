// Gathers from a scene that another program indexed, with the engine alone: no file formats are
// linked.
//
//   engine_consumer SCENE.sft

#include <surfeit/engine.h>

#include <iostream>

int main(int argc, char** argv) {
  if (argc != 2) {
    std::cerr << "usage: engine_consumer SCENE.sft\n";
    return 2;
  }
  surfeit::EngineOptions options;
  options.memory_bytes = 32 << 20;
  auto engine = surfeit::Engine::create(options);
  if (!engine.ok()) return 1;
  const auto scene = engine->open(argv[1]);
  if (!scene.ok()) {
    std::cerr << scene.status().message() << '\n';
    return 1;
  }
  auto gatherer = engine->gatherer(*scene, surfeit::GatherSettings());
  surfeit::Receiver receiver;
  receiver.normal = {0, 1, 0};
  surfeit::GatherResult result;
  if (!gatherer.ok() || !gatherer->gather(&receiver, 1, &result).ok()) return 1;
  std::cout << "occlusion " << result.occlusion << '\n';
  return result.occlusion > 0.2f && result.occlusion < 0.3f ? 0 : 1;
}
