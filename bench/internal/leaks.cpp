// What arrives behind closed things, how closed they are, and what small lights send: for each,
// what the gather finds over what is right. Every cloud is scattered by a third of its spacing.
//
//   leaks [--quality draft|standard|final] [--raster-resolution N] [--max-solid-angle S] ...
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <glm/geometric.hpp>
#include <glm/vec3.hpp>
#include <random>
#include <string>
#include <utility>
#include <vector>

#include "bench/or_exit.h"
#include "random/closed_things.h"
#include "random/indexed_scene.h"
#include "surfeit/gather.h"

namespace surfeit {
namespace {

using Cloud = std::vector<Surfel>;
constexpr double kPiExact = 3.14159265358979323846;

struct Settings {
  GatherQuality quality;
  bool packets = false;
};

std::vector<GatherResult> gather(const Cloud& cloud, const std::vector<LocalReceiver>& receivers,
                                 const Settings& settings) {
  const auto scene = take(IndexedScene::make(cloud));
  const GatherRules rules(GatherMode::kBleeding, settings.quality);
  return take(settings.packets ? scene->gatherTogether(receivers, rules)
                               : scene->gatherAlone(receivers, rules));
}

double meanLight(const Cloud& cloud, const std::vector<LocalReceiver>& receivers,
                 const Settings& settings) {
  double sum = 0;
  for (const GatherResult& result : gather(cloud, receivers, settings)) {
    sum += double(result.irradiance.x);
  }
  return sum / double(receivers.size());
}

// A lamp wholly hidden by what stands before it: what arrives, of what would without.
double leakOf(const Cloud& blocker, const Settings& settings) {
  Cloud lamp = hiddenLamp();
  const double open = meanLight(lamp, receiversBehind(), settings);
  lamp.insert(lamp.end(), blocker.begin(), blocker.end());
  return meanLight(lamp, receiversBehind(), settings) / open;
}

struct Closed {
  double mean = 0, worst = 1;
};
Closed closedness(int count, float scatter, const Settings& settings) {
  Cloud shell;
  addBall(shell, count, glm::vec3(0), 1, 1, -1, scatter);
  std::mt19937 random(3);
  std::normal_distribution<float> normal;
  const auto direction = [&] {
    return glm::normalize(glm::vec3(normal(random), normal(random), normal(random)));
  };
  std::vector<LocalReceiver> receivers;
  for (int i = 0; i < 64; ++i)
    receivers.push_back({.8f * float(i) / 64 * direction(), direction()});
  Closed closed;
  for (const GatherResult& result : gather(shell, receivers, settings)) {
    closed.mean += double(result.occlusion) / 64;
    closed.worst = std::min(closed.worst, double(result.occlusion));
  }
  return closed;
}

// A dark ball on a floor before a bright wall, seen from the floor on its other side.
double floorBeside(int count, const Settings& settings) {
  Cloud cloud;
  addBall(cloud, count, {0, 0, 1}, 1);
  addSheet(cloud, 20'000, {3, -3, 0}, {0, 0, 6}, {0, 6, 0}, 1);
  std::vector<LocalReceiver> receivers;
  double truth = 0;
  constexpr int kReceivers = 16, kSteps = 300;
  for (int k = 0; k < kReceivers; ++k) {
    const glm::vec3 q(-1.3f - .05f * float(k), .02f * float(k), 0);
    receivers.push_back({q, {0, 0, 1}});
    for (int i = 0; i < kSteps * kSteps; ++i) {
      const float y = -3 + 6 * (float(i % kSteps) + .5f) / kSteps;
      const float z = 6 * (float(i / kSteps) + .5f) / kSteps;
      const glm::dvec3 to(3 - q.x, y - q.y, z), c(-q.x, -q.y, 1);
      const double length_sq = glm::dot(to, to), t = glm::dot(c, to) / length_sq;
      if (glm::dot(c, c) - t * t * length_sq < 1) continue;
      const double area = 36. / (kSteps * kSteps);
      truth += to.z * to.x / (length_sq * length_sq) * area / kPiExact / kReceivers;
    }
  }
  return meanLight(cloud, receivers, settings) / truth - 1;
}

// Small bright spheres before a dark wall, at many places of a pixel; the mean, and how they
// differ.
struct Power {
  double mean = 0, deviation = 0;
};
Power powerOf(float radius, const Settings& settings) {
  std::mt19937 random(5);
  std::uniform_real_distribution<float> uniform(-1, 1);
  double sum = 0, square = 0;
  constexpr int kTrials = 200;
  Cloud wall;
  addSheet(wall, 5000, {-6, -6, -4}, {12, 0, 0}, {0, 12, 0});
  Surfel lamp;
  lamp.radius = radius;
  lamp.area = kPi * radius * radius;
  lamp.radiosity = glm::vec3(100);
  lamp.position = {.3f, .2f, -3};
  lamp.normal = glm::vec3(0);
  lamp.flags = kSurfelSphere;
  wall.push_back(lamp);
  std::vector<LocalReceiver> receivers;
  for (int i = 0; i < kTrials; ++i) {
    receivers.push_back(
        {{2.8f * uniform(random), 2.8f * uniform(random), .3f * uniform(random)}, {0, 0, -1}});
  }
  const std::vector<GatherResult> results = gather(wall, receivers, settings);
  for (std::size_t i = 0; i < results.size(); ++i) {
    const glm::dvec3 to = glm::dvec3(lamp.position) - glm::dvec3(receivers[i].position);
    const double d2 = glm::dot(to, to);
    const double truth = 100. * radius * radius / d2 * (-to.z / std::sqrt(d2));
    const double ratio = double(results[i].irradiance.x) / truth;
    sum += ratio / kTrials;
    square += ratio * ratio / kTrials;
  }
  return {sum, std::sqrt(std::max(0., square - sum * sum))};
}

void printLeaks(const Settings& settings, const std::vector<int>& counts) {
  fmt::print("behind          {:>8} {:>8} {:>8}   floor beside a ball\n", "ball", "box", "wall");
  for (const int count : counts) {
    Cloud ball, box, wall;
    addBall(ball, count, glm::vec3(0), 1);
    addBox(box, count, glm::vec3(0), 1.6f);
    addSheet(wall, count, {-1, -1, 0}, {2, 0, 0}, {0, 2, 0});
    fmt::print("{:>8}        {:8.4f} {:8.4f} {:8.4f}   {:+.4f}\n", count, leakOf(ball, settings),
               leakOf(box, settings), leakOf(wall, settings), floorBeside(count, settings));
  }
}

void printShells(const Settings& settings, const std::vector<int>& pixels) {
  fmt::print("closed shell    ");
  for (const int p : pixels) fmt::print("     {:>2} pixels   ", p);
  fmt::print("\n");
  for (const int count : {2000, 20'000, 200'000}) {
    for (const float scatter : {0.f, kScatter}) {
      fmt::print("{:>8} {:>4}   ", count, scatter);
      for (const int p : pixels) {
        Settings at = settings;
        at.quality.raster_resolution = p;
        const Closed closed = closedness(count, scatter, at);
        fmt::print("  {:.4f} {:.4f}", closed.mean, closed.worst);
      }
      fmt::print("\n");
    }
  }
}

void printPower(const Settings& settings) {
  fmt::print("small light     mean     deviation\n");
  for (const float radius : {.003f, .02f, .1f, .3f}) {
    const Power power = powerOf(radius, settings);
    fmt::print("{:>8}        {:.4f}   {:.4f}\n", radius, power.mean, power.deviation);
  }
}

}  // namespace
}  // namespace surfeit

int main(int argc, char** argv) {
  using namespace surfeit;
  CLI::App app("What arrives behind closed things, how closed they are, what small lights send.");
  Settings settings;
  std::string preset, engine = "alone";
  float max_solid_angle = -1, near_field = -1;
  int resolution = 0;
  std::vector<int> counts = {5000, 50'000}, pixels = {8, 16, 32, 64};
  std::vector<std::string> parts = {"leaks", "shells", "power"};
  app.add_option("--quality", preset, "Of the gather")
      ->check(CLI::IsMember({"draft", "standard", "final"}));
  app.add_option("--engine", engine, "Receivers alone, or together")
      ->check(CLI::IsMember({"alone", "packet"}));
  app.add_option("--max-solid-angle", max_solid_angle, "Largest cluster drawn as one");
  app.add_option("--raster-resolution", resolution, "Pixels along a cube face, even");
  app.add_option("--near-field", near_field, "Reach of tracing, in surfel radii");
  app.add_option("--surfels", counts, "Of what hides the light")->delimiter(',');
  app.add_option("--pixels", pixels, "Of the closed shells")->delimiter(',');
  app.add_option("--parts", parts, "What is printed")
      ->check(CLI::IsMember({"leaks", "shells", "power"}))
      ->delimiter(',');
  CLI11_PARSE(app, argc, argv);
  if (preset == "draft") setQuality(QualityPreset::kDraft, settings.quality);
  if (preset == "final") setQuality(QualityPreset::kFinal, settings.quality);
  if (max_solid_angle >= 0) settings.quality.max_solid_angle = max_solid_angle;
  if (resolution > 0) settings.quality.raster_resolution = resolution;
  if (near_field >= 0) settings.quality.near_field_radii = near_field;
  settings.packets = engine == "packet";
  const auto has = [&](const char* part) {
    return std::find(parts.begin(), parts.end(), part) != parts.end();
  };
  if (has("leaks")) printLeaks(settings, counts);
  if (has("shells")) printShells(settings, pixels);
  if (has("power")) printPower(settings);
}
