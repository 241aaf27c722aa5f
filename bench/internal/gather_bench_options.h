// Options that the benches of the gather share.
#pragma once

#include <CLI/CLI.hpp>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "bench/internal/gather_scenes.h"
#include "surfeit/gather.h"
#include "surfeit/status.h"

namespace surfeit {

struct GatherBenchOptions {
  std::vector<std::string> scenes = {"spheres"};
  std::vector<std::string> engines;          // all
  std::vector<std::uint64_t> surfels = {0};  // to make scenes with; 0: the scene's own number
  std::vector<std::string> sets = {"dense", "scattered"};
  SceneOptions place;
  GatherQuality quality;
  int threads = 1;
  int rounds = 5;
  std::size_t timed = 256;  // receivers of each run that are timed
};

void addGatherBenchOptions(CLI::App& app, GatherBenchOptions& options);

// Runs each scene with each number of surfels that is asked for, skipping those whose files are not
// there, and returns the exit status of the program.
int forEachScene(
    const char* program, const GatherBenchOptions& options,
    const std::function<Status(const std::string& scene, const SceneOptions& place)>& run);

}  // namespace surfeit
