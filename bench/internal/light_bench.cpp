// What the lights cost beside plain color bleeding: processor time of one thread, for the same
// receivers, in rounds in which all of them take turns.
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <array>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <functional>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "batch/environment_file.h"
#include "bench/internal/gather_bench_options.h"
#include "bench/internal/gather_measure.h"
#include "bench/internal/gather_scenes.h"
#include "gather/light/environment_map.h"
#include "gather/packet/packet_gatherer.h"
#include "gather/rules/gather_outputs.h"

namespace surfeit {
namespace {

// Gathers clusters by any rules.
class RulesWorker : public Worker {
 public:
  RulesWorker(const GatherRules& rules, PagedOctree& octree) : gatherer_(rules), reader_(octree) {}
  Status gather(const ReceiverSet& set, std::size_t begin, std::size_t end,
                std::span<GatherResult> results) override {
    const std::span<const LocalReceiver> receivers =
        std::span(set.receivers).subspan(begin, end - begin);
    for (std::size_t i = 0; i < receivers.size(); i += kClusterReceivers) {
      const std::size_t count = std::min(kClusterReceivers, receivers.size() - i);
      SURFEIT_RETURN_IF_ERROR(
          gatherer_.gather(receivers.subspan(i, count), reader_, results.subspan(i, count)));
    }
    return {};
  }
  void pause() override { reader_.release(); }

 private:
  PacketGatherer gatherer_;
  PagedOctree::Reader reader_;
};

// A sky, brighter above, with a sun: a Radiance picture, flat.
Status writeSky(const std::string& path) {
  constexpr int kWidth = 512, kHeight = 256;
  std::ofstream file(path, std::ios::binary);
  file << "#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y " << kHeight << " +X " << kWidth << "\n";
  for (int row = 0; row < kHeight; ++row) {
    for (int column = 0; column < kWidth; ++column) {
      const bool is_sun = std::hypot(row - 60, column - 100) < 4;
      const char exponent = is_sun ? char(138) : char(128);
      const char value = row < kHeight / 2 ? char(255 - row) : char(40);
      const std::array<char, 4> texel = {value, value, char(200), exponent};
      file.write(texel.data(), texel.size());
    }
  }
  return file.good() ? Status() : Status::ioError(fmt::format("{}: cannot write", path));
}

Result<LoadedEnvironment> loadSky(int resolution) {
  const std::string path =
      (std::filesystem::temp_directory_path() / "surfeit_light_bench_sky.hdr").string();
  SURFEIT_RETURN_IF_ERROR(writeSky(path));
  GatherEnvironment environment;
  environment.path = path;
  environment.up = UpAxis::kZ;
  Progress quiet;
  SURFEIT_ASSIGN_OR_RETURN(EnvironmentMap map, loadEnvironmentMap(environment, quiet));
  std::filesystem::remove(path);
  return LoadedEnvironment(std::move(map), resolution);
}

struct Light {
  std::string name;
  GatherRules rules;
  std::vector<std::unique_ptr<Worker>> workers{};
  std::vector<double> rates{};
};

std::vector<Light> makeLights(const GatherQuality& quality, const LoadedEnvironment& sky,
                              const glm::vec3& eye) {
  std::vector<Light> lights;
  const auto add = [&](const std::string& name, GatherMode mode,
                       const std::function<void(GatherRules&)>& change) {
    lights.push_back({.name = name, .rules = GatherRules(mode, quality)});
    GatherRules& rules = lights.back().rules;
    rules.eye = eye;
    change(rules);
  };
  const auto surround = [&](GatherRules& rules) {
    rules.environment = &sky.map;
    rules.environment_cube = &sky.cube;
    rules.outputs |= kOutputEnvironment;
  };
  const auto narrow = [](float angle) {
    return [angle](GatherRules& rules) {
      rules.weights.roughness = 1;
      rules.weights.cone_angle = angle;
    };
  };
  add("bleeding", GatherMode::kBleeding, [](GatherRules&) {});
  add("bleeding, environment", GatherMode::kBleeding, surround);
  add("all but harmonics", GatherMode::kBleeding, [&](GatherRules& rules) {
    surround(rules);
    rules.outputs = kAllOutputs & ~std::uint32_t{kOutputRadianceSh};
  });
  add("all outputs", GatherMode::kBleeding, [&](GatherRules& rules) {
    surround(rules);
    rules.outputs = kAllOutputs;
  });
  add("occlusion", GatherMode::kOcclusion, [](GatherRules&) {});
  add("occlusion, falloff", GatherMode::kOcclusion,
      [](GatherRules& rules) { rules.weights.falloff = 1; });
  add("occlusion, cone .5", GatherMode::kOcclusion,
      [](GatherRules& rules) { rules.weights.cone_angle = .5f; });
  add("glossy .5", GatherMode::kGlossy, narrow(.5f));
  add("glossy .2", GatherMode::kGlossy, narrow(.2f));
  add("glossy .05", GatherMode::kGlossy, narrow(.05f));
  add("glossy .02", GatherMode::kGlossy, narrow(.02f));
  add("glossy .2, environment", GatherMode::kGlossy, [&](GatherRules& rules) {
    narrow(.2f)(rules);
    surround(rules);
  });
  return lights;
}

// Root mean square difference of occlusion from a gather that takes the same light far more
// exactly: an eighth of the solid angle, raster and near field twice as fine.
Result<double> errorOf(const Light& light, const LoadedEnvironment& fine_sky,
                       const ReceiverSet& set, PagedOctree& octree) {
  GatherRules fine = light.rules;
  fine.quality.max_solid_angle /= 8;
  fine.quality.raster_resolution *= 2;
  fine.quality.near_field_radii *= 2;
  if (fine.environment != nullptr) {
    fine.environment = &fine_sky.map;
    fine.environment_cube = &fine_sky.cube;
  }
  RulesWorker worker(light.rules, octree), reference(fine, octree);
  double sum = 0;
  std::size_t count = 0;
  for (std::size_t begin = 0; begin < set.receivers.size(); begin += set.run_length) {
    const std::size_t size = std::min(kPacketReceivers, set.receivers.size() - begin);
    std::array<GatherResult, kPacketReceivers> found, expected;
    const auto gather = [&](RulesWorker& by, std::array<GatherResult, kPacketReceivers>& results) {
      return by.gather(set, begin, begin + size, std::span(results).first(size));
    };
    SURFEIT_RETURN_IF_ERROR(gather(worker, found));
    SURFEIT_RETURN_IF_ERROR(gather(reference, expected));
    for (std::size_t i = 0; i < size; ++i, ++count) {
      const double error = double(found[i].occlusion) - double(expected[i].occlusion);
      sum += error * error;
    }
  }
  return std::sqrt(sum / double(count));
}

Status runScene(const GatherBenchOptions& options, const std::string& name,
                const SceneOptions& place) {
  Progress quiet;
  SURFEIT_ASSIGN_OR_RETURN(const GatherScene scene, GatherScene::open(name, place, quiet));
  SURFEIT_ASSIGN_OR_RETURN(const std::unique_ptr<PagedOctree> octree, scene.openOctree(2));
  SURFEIT_ASSIGN_OR_RETURN(const LoadedEnvironment sky, loadSky(options.quality.raster_resolution));
  SURFEIT_ASSIGN_OR_RETURN(const LoadedEnvironment fine_sky,
                           loadSky(2 * options.quality.raster_resolution));
  const RootCube& cube = octree->file().header().cube;
  const glm::vec3 corner(float(cube.origin[0]), float(cube.origin[1]), float(cube.origin[2]));
  const glm::vec3 eye = corner + float(cube.size) * glm::vec3(.5f, -.5f, .8f);
  for (const std::string& set_name : options.sets) {
    SURFEIT_ASSIGN_OR_RETURN(const ReceiverSet set, chooseReceivers(set_name, octree->file()));
    std::vector<Light> lights = makeLights(options.quality, sky, eye);
    for (Light& light : lights) {
      light.workers.push_back(std::make_unique<RulesWorker>(light.rules, *octree));
    }
    for (int round = 0; round < options.rounds; ++round) {
      for (Light& light : lights) {
        SURFEIT_ASSIGN_OR_RETURN(const Timing timing,
                                 timeGather(set, options.timed, light.workers));
        light.rates.push_back(timing.rate());
      }
    }
    fmt::print("{}, {} receivers\n  {:<26}{:>10}{:>12}{:>12}\n", name, set.name, "light", "rate",
               "time", "error");
    const double plain = median(lights.front().rates);
    for (const Light& light : lights) {
      const double rate = median(light.rates);
      SURFEIT_ASSIGN_OR_RETURN(const double error, errorOf(light, fine_sky, set, *octree));
      fmt::print("  {:<26}{:>10.0f}{:>11.2f}x{:>12.4f}\n", light.name, rate, plain / rate, error);
    }
  }
  return {};
}

}  // namespace
}  // namespace surfeit

int main(int argc, char** argv) {
  surfeit::GatherBenchOptions options;
  options.sets = {"dense"};
  CLI::App app("What the lights cost beside color bleeding.");
  surfeit::addGatherBenchOptions(app, options);
  app.footer(
      "Columns: receivers per second of one thread's processor time, and the time over that of\n"
      "plain bleeding; root mean square difference of occlusion from a gather that takes the same\n"
      "light far more exactly.\n"
      "Example:\n"
      "  light_bench --scene spheres city --keep scenes");
  CLI11_PARSE(app, argc, argv);
  return surfeit::forEachScene("light_bench", options,
                               [&](const std::string& name, const surfeit::SceneOptions& place) {
                                 return surfeit::runScene(options, name, place);
                               });
}
