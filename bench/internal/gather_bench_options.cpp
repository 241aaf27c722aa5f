#include "bench/internal/gather_bench_options.h"

#include <fmt/format.h>

#include <algorithm>
#include <cstdio>

#include "bench/internal/gather_measure.h"
#include "surfels/generated/scene_recipe.h"

namespace surfeit {

void addGatherBenchOptions(CLI::App& app, GatherBenchOptions& options) {
  options.engines = engineNames();
  std::vector<std::string> scenes = gatherSceneNames();
  scenes.insert(scenes.end(), unseenSceneNames().begin(), unseenSceneNames().end());
  scenes.emplace_back("all");
  app.add_option("--scene", options.scenes, "Scenes; all: those that errors are reported for")
      ->check(CLI::IsMember(scenes))
      ->capture_default_str();
  app.add_option_function<std::vector<std::string>>(
         "--surfels",
         [&options](const std::vector<std::string>& texts) {
           options.surfels.clear();
           for (const std::string& text : texts) {
             const Result<std::uint64_t> count = parseSurfelCount(text);
             if (!count.ok()) throw CLI::ValidationError("--surfels", count.status().message());
             options.surfels.push_back(*count);
           }
         },
         "Numbers of surfels to make scenes with, such as 10M [each scene's own]")
      ->type_name("COUNT ...");
  app.add_option("--data", options.place.data, "Directory of meshes, for scenes made of them")
      ->capture_default_str();
  app.add_option("--keep", options.place.keep,
                 "Directory for scenes and true values, to start at once next time [none]");
  app.add_option("--engine", options.engines, "Our engines to measure")
      ->check(CLI::IsMember(engineNames()))
      ->capture_default_str();
  app.add_option("--receivers", options.sets, "Dense runs, scattered ones")
      ->check(CLI::IsMember({"dense", "scattered"}))
      ->capture_default_str();
  app.add_option("--timed", options.timed, "Receivers that are timed of each of 64 runs")
      ->check(CLI::Range(16, 1024))
      ->capture_default_str();
  app.add_option("--rounds", options.rounds, "Rounds, of which rates are the medians")
      ->check(CLI::Range(1, 1000))
      ->capture_default_str();
  app.add_option("--threads", options.threads, "Threads that gather")
      ->check(CLI::Range(1, 1024))
      ->capture_default_str();

  GatherQuality& quality = options.quality;
  app.add_option("--max-solid-angle", quality.max_solid_angle, "Largest cluster drawn as one")
      ->check(CLI::Range(0.0, 6.3))
      ->capture_default_str();
  app.add_option("--raster-resolution", quality.raster_resolution, "Pixels along a cube face, even")
      ->check(CLI::Range(2, 64))
      ->check([](const std::string& text) {
        return std::stoi(text) % 2 == 0 ? std::string() : text + ": expected an even number";
      })
      ->capture_default_str();
  app.add_option("--near-field", quality.near_field_radii, "Reach of tracing, in surfel radii")
      ->check(CLI::Range(0.0, 100.0))
      ->capture_default_str();
  app.add_option("--bias", quality.bias, "Start of rays above the receiver, in surfel radii")
      ->check(CLI::Range(0.0, 10.0))
      ->capture_default_str();
}

int forEachScene(
    const char* program, const GatherBenchOptions& options,
    const std::function<Status(const std::string& scene, const SceneOptions& place)>& run) {
  const bool has_all =
      std::find(options.scenes.begin(), options.scenes.end(), "all") != options.scenes.end();
  for (const std::string& scene : has_all ? gatherSceneNames() : options.scenes) {
    if (const std::string missing = missingSceneFile(scene, options.place); !missing.empty()) {
      fmt::print(stderr, "{}: scene {} skipped: no {} (--data)\n", program, scene, missing);
      continue;
    }
    for (const std::uint64_t surfels : options.surfels) {
      SceneOptions place = options.place;
      place.surfels = surfels;
      if (const Status status = run(scene, place); !status.ok()) {
        fmt::print(stderr, "{}: {}: {}\n", program, scene, status.message());
        return 1;
      }
      std::fflush(stdout);
    }
  }
  return 0;
}

}  // namespace surfeit
