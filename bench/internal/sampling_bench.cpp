// Areas that bare positions are given, by shape and sampling: their sum over the true one, and the
// occlusion before them against that before the surface itself (a hexagonal grid, nine times as
// dense, with its true areas).
//
//   sampling_bench [--side N] [--only TEXT]
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <functional>
#include <glm/geometric.hpp>
#include <glm/vec2.hpp>
#include <random>
#include <string>
#include <utility>
#include <vector>

#include "bench/or_exit.h"
#include "cloud/cloud_formats.h"
#include "core/spherical_harmonics.h"
#include "index/rows/scene_rows.h"
#include "surfeit/bake.h"
#include "surfeit/index.h"
#include "surfels/rows/surfel_writer.h"

namespace surfeit {
namespace {

// A place of the unit square and the part of it that the place stands for; `height` above the
// surface, in spacings.
struct Place {
  double u = 0, v = 0, part = 0, height = 0;
};
using Places = std::vector<Place>;

// Samplings of the unit square with about side^2 places.
class Samplings {
 public:
  explicit Samplings(int side) : side_(side) {}

  Places scattered(double times = 1) {
    Places places(std::size_t(times * side_ * side_));
    for (Place& place : places) place = {unit(), unit(), 1 / double(places.size()), 0};
    return places;
  }
  Places rows(double ratio) const {
    const int lines = int(std::lround(side_ / std::sqrt(ratio)));
    const int points = int(std::lround(double(side_) * side_ / lines));
    Places places;
    for (int j = 0; j < lines; ++j) {
      for (int i = 0; i < points; ++i) {
        places.push_back({(i + .5) / points, (j + .5) / lines, 1. / lines / points, 0});
      }
    }
    return places;
  }
  Places hexagons() const {
    const int lines = int(std::lround(side_ * std::sqrt(2 / std::sqrt(3.))));
    const int points = int(std::lround(double(side_) * side_ / lines));
    Places places;
    for (int j = 0; j < lines; ++j) {
      for (int i = 0; i < points; ++i) {
        places.push_back(
            {(i + .25 + .5 * (j % 2)) / points, (j + .5) / lines, 1. / lines / points, 0});
      }
    }
    return places;
  }
  // Every place so many times.
  static Places repeated(const Places& some, int times) {
    Places places;
    for (int i = 0; i < times; ++i) places.insert(places.end(), some.begin(), some.end());
    for (Place& place : places) place.part /= times;
    return places;
  }
  static Places halfTwice(Places places) {
    const std::size_t count = places.size();
    for (std::size_t i = 0; i < count; ++i) {
      if (places[i].u >= .5) continue;
      places[i].part /= 2;
      places.push_back(Place(places[i]));
    }
    return places;
  }
  // A second scan, so many spacings off.
  Places twoScans(double off) {
    Places places = repeated(scattered(), 2);
    for (std::size_t i = places.size() / 2; i < places.size(); ++i) {
      places[i].u = std::min(places[i].u + off / side_, 1.);
      places[i].height = off;
    }
    return places;
  }
  Places noisy(Places places, double noise) {
    for (Place& place : places) place.height = noise * std::normal_distribution<double>()(random_);
    return places;
  }
  // One half a thousand times as dense as the other, of 200 places.
  Places uneven() {
    const std::size_t sparse = 200, dense = 200000;
    Places places = scattered(double(dense) / side_ / side_);
    for (Place& place : places) place.u *= .5, place.part = .5 / double(dense);
    for (std::size_t i = 0; i < sparse; ++i) {
      places.push_back({.5 + .5 * unit(), unit(), .5 / double(sparse), 0});
    }
    return places;
  }

 private:
  double unit() { return std::uniform_real_distribution<double>(0, 1)(random_); }

  int side_;
  std::mt19937 random_{7};
};

// A piece of surface over the unit square.
struct Point {
  glm::dvec3 position{0}, normal{0};
  double area = 0;  // of the whole piece, if it were as stretched everywhere as here
};
using Patch = std::function<Point(double u, double v)>;

Patch flat(const glm::dvec3& corner, const glm::dvec3& u, const glm::dvec3& v) {
  const glm::dvec3 across = glm::cross(u, v);
  return [=](double s, double t) {
    return Point{corner + s * u + t * v, glm::normalize(across), glm::length(across)};
  };
}

Point onSphere(double u, double v) {
  const double z = 2 * v - 1, r = std::sqrt(1 - z * z), phi = 2 * double(kPi) * u;
  const glm::dvec3 at(r * std::cos(phi), r * std::sin(phi), z);
  return {at, at, 4 * double(kPi)};
}

Point onTerrain(double u, double v) {
  const double dx = .35 * std::cos(7 * u) * std::cos(5 * v);
  const double dy = -.25 * std::sin(7 * u) * std::sin(5 * v);
  const glm::dvec3 up(-dx, -dy, 1);
  return {{u, v, .05 * std::sin(7 * u) * std::cos(5 * v)}, glm::normalize(up), glm::length(up)};
}

struct Shape {
  std::string name;
  std::vector<Patch> patches;
};

std::vector<Shape> shapes(double spacing) {
  const Patch floor = flat({0, 0, 0}, {1, 0, 0}, {0, 1, 0});
  Shape box{"box", {}};
  for (int axis = 0; axis < 3; ++axis) {
    glm::dvec3 u(0), v(0), far(0);
    u[(axis + 1) % 3] = v[(axis + 2) % 3] = far[axis] = 1;
    box.patches.push_back(flat(far, u, v));
    box.patches.push_back(flat({0, 0, 0}, v, u));
  }
  return {{"plane", {floor}},
          {"sphere", {onSphere}},
          box,
          {"walls", {floor, flat({0, 0, -spacing}, {0, 1, 0}, {1, 0, 0})}},
          {"terrain", {onTerrain}}};
}

struct Cloud {
  std::vector<Surfel> surfels;  // with true normals, areas and radii
  double area = 0;
};

Cloud cloudOf(const Shape& shape, const std::function<Places()>& sampling, double spacing) {
  Cloud cloud;
  for (const Patch& patch : shape.patches) {
    for (const Place& place : sampling()) {
      const Point at = patch(place.u, place.v);
      Surfel surfel;
      const double scale = std::sqrt(at.area) * spacing;
      surfel.position = glm::vec3(at.position + place.height * scale * at.normal);
      surfel.normal = glm::vec3(at.normal);
      surfel.area = float(place.part * at.area);
      surfel.radius = std::sqrt(2 * surfel.area / kPi);
      cloud.area += double(surfel.area);
      cloud.surfels.push_back(surfel);
    }
  }
  return cloud;
}

class Bench {
 public:
  explicit Bench(int side) : side_(side) {
    std::string name = (std::filesystem::temp_directory_path() / "sampling-XXXXXX").string();
    if (mkdtemp(name.data()) == nullptr) std::exit(1);
    directory_ = name + "/";
  }
  Bench(const Bench&) = delete;
  Bench& operator=(const Bench&) = delete;
  ~Bench() { std::filesystem::remove_all(directory_); }

  void row(const Shape& shape, const std::string& name, const std::function<Places()>& sampling) {
    const Cloud cloud = cloudOf(shape, sampling, 1. / side_);
    writeReceivers(shape);
    const double bare = areaOf(cloud.surfels, {});
    CloudChannels normals;
    normals.normal = true;
    const double with_normals = areaOf(cloud.surfels, normals);
    const std::vector<double> found = occlusions();
    const std::vector<double> exact = trueOcclusions(shape);
    double mean = 0, worst = 0;
    for (std::size_t i = 0; i < found.size(); ++i) {
      mean += (found[i] - exact[i]) / double(found.size());
      worst = std::max(worst, std::abs(found[i] - exact[i]));
    }
    fmt::print("| {} | {} | {:.3f} | {:.3f} | {:+.4f} | {:.4f} |\n", shape.name, name,
               bare / cloud.area, with_normals / cloud.area, mean, worst);
    std::fflush(stdout);
  }

 private:
  std::vector<double> trueOcclusions(const Shape& shape) {
    if (shape.name == true_shape_) return true_occlusions_;
    Samplings dense(3 * side_);
    CloudChannels all;
    all.normal = all.area = all.radius = true;
    areaOf(cloudOf(
               shape, [&] { return dense.hexagons(); }, 1. / side_)
               .surfels,
           all);
    true_shape_ = shape.name;
    return true_occlusions_ = occlusions();
  }

  void write(const std::string& name, const std::vector<Surfel>& surfels,
             const CloudChannels& channels) const {
    SurfelWriter writer = take(SurfelWriter::create(directory_ + name, channels));
    need(writer.write(surfels));
    need(writer.finish());
  }

  // Before every patch, 3 and 20 spacings away, facing it.
  void writeReceivers(const Shape& shape) const {
    std::vector<Surfel> receivers;
    for (const Patch& patch : shape.patches) {
      for (const double away : {3., 20.}) {
        for (int i = 0; i < 64; ++i) {
          const Point at = patch((i % 8 + .5) / 8, (i / 8 + .5) / 8);
          Surfel receiver;
          receiver.normal = glm::vec3(-at.normal);
          receiver.position = glm::vec3(at.position + away * std::sqrt(at.area) / side_ * at.normal);
          receivers.push_back(receiver);
        }
      }
    }
    CloudChannels channels;
    channels.normal = true;
    write("receivers.ply", receivers, channels);
  }

  // The sum of the areas in the scene.
  double areaOf(const std::vector<Surfel>& surfels, const CloudChannels& channels) const {
    write("cloud.ply", surfels, channels);
    IndexOptions options;
    options.full_precision = true;
    Progress quiet;
    take(indexClouds({directory_ + "cloud.ply"}, directory_ + "scene.sft", options, quiet));
    return sumOf(directory_ + "scene.sft", "area");
  }

  static double sumOf(const std::string& path, const std::string& property) {
    double sum = 0;
    for (const double value : valuesOf(path, property)) sum += value;
    return sum;
  }

  static std::vector<double> valuesOf(const std::string& path, const std::string& name) {
    const std::unique_ptr<RowReader> reader = take(openCloud(path, {}));
    const RowLayout& element = reader->element();
    const RowProperty& property = *element.find(name);
    AlignedBuffer buffer;
    std::vector<double> values;
    for (;;) {
      const Bytes rows = take(reader->readRows(4096, buffer));
      if (rows.empty()) return values;
      for (std::size_t at = 0; at < rows.size(); at += element.row_bytes) {
        values.push_back(rowValue(rows.data() + at + property.offset, property.type));
      }
    }
  }

  std::vector<double> occlusions() const {
    Progress quiet;
    take(gatherCloud(directory_ + "scene.sft", directory_ + "receivers.ply",
                     directory_ + "result.ply", {}, quiet));
    return valuesOf(directory_ + "result.ply", "occlusion");
  }

  int side_;
  std::string directory_, true_shape_;
  std::vector<double> true_occlusions_;
};

void run(int side, const std::string& only) {
  Samplings samplings(side);
  const std::vector<std::pair<std::string, std::function<Places()>>> kinds = {
      {"random", [&] { return samplings.scattered(); }},
      {"square grid", [&] { return samplings.rows(1); }},
      {"hexagons", [&] { return samplings.hexagons(); }},
      {"rows 5:1", [&] { return samplings.rows(5); }},
      {"rows 20:1", [&] { return samplings.rows(20); }},
      {"every point 4 times", [&] { return Samplings::repeated(samplings.scattered(), 4); }},
      {"half of it twice", [&] { return Samplings::halfTwice(samplings.scattered()); }},
      {"second scan .05 off", [&] { return samplings.twoScans(.05); }},
      {"noise .2", [&] { return samplings.noisy(samplings.scattered(), .2); }},
      {"noise .5", [&] { return samplings.noisy(samplings.scattered(), .5); }},
      {"density 1:1000", [&] { return samplings.uneven(); }}};
  fmt::print(
      "{} x {} places on a patch, lengths in spacings. Areas: sum over the true one. Occlusion:\n"
      "of places with normals, less that of the true surface.\n\n"
      "| shape | sampling | area, bare | area, normals | occlusion, mean | occlusion, worst |\n"
      "|---|---|---|---|---|---|\n",
      side, side);
  Bench bench(side);
  for (const Shape& shape : shapes(1. / side)) {
    for (const auto& [name, sampling] : kinds) {
      if ((shape.name + ' ' + name).find(only) != std::string::npos) {
        bench.row(shape, name, sampling);
      }
    }
  }
}

}  // namespace
}  // namespace surfeit

int main(int argc, char** argv) {
  CLI::App app("Areas found for bare positions, beside the true ones");
  int side = 100;
  app.add_option("--side", side, "Places along an edge of a patch")->capture_default_str();
  std::string only;
  app.add_option("--only", only, "Only rows whose shape and sampling hold this text");
  CLI11_PARSE(app, argc, argv);
  surfeit::run(side, only);
  return 0;
}
