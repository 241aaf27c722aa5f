// Normals of places scattered over meshes, beside those of the triangles: angle, flips, rate.
//
//   normals_bench MESH... [--count N] [--orient up|outward|consistent] [--save DIRECTORY]
//   normals_bench --check FOUND --truth TRUTH
//
// --save keeps the places, NAME_NOISE.ply, and with the normals of their triangles,
// NAME_NOISE_truth.ply; --check compares two files of those places, whoever found the normals
// (bench/normals_peers.sh).
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <glm/geometric.hpp>
#include <memory>
#include <random>
#include <string>
#include <vector>

#include "bench/or_exit.h"
#include "cloud/cloud_formats.h"
#include "core/job_limits.h"
#include "core/seconds_since.h"
#include "sample/meshes/mesh.h"
#include "surfeit/normals.h"
#include "surfels/rows/surfel_writer.h"
#include "tools/normal_options.h"

namespace surfeit {
namespace {

struct Places {
  std::vector<Surfel> surfels;  // with the normals of their triangles
  double spacing = 0;
};

// Evenly over the area, in random order; moved by Gauss' `noise` in spacings, every way.
Places scatter(const Mesh& mesh, std::size_t count, double noise) {
  std::vector<double> sums;
  double area = 0;
  for (std::uint32_t t = 0; t < mesh.triangle.size(); ++t) {
    sums.push_back(area += triangleArea(mesh, t));
  }
  Places places;
  places.spacing = std::sqrt(area / double(count));
  std::mt19937 random(11);
  std::uniform_real_distribution<double> unit;
  std::normal_distribution<double> gauss;
  for (std::size_t i = 0; i < count; ++i) {
    const auto t = std::upper_bound(sums.begin(), sums.end(), unit(random) * area);
    const glm::uvec3& corners = mesh.triangle[std::min<std::size_t>(std::size_t(t - sums.begin()),
                                                                    mesh.triangle.size() - 1)];
    const glm::dvec3 a(mesh.position[corners.x]), b(mesh.position[corners.y]),
        c(mesh.position[corners.z]);
    const double root = std::sqrt(unit(random)), v = unit(random) * root;
    glm::dvec3 at = a * (1 - root) + b * (root - v) + c * v;
    for (int axis = 0; axis < 3; ++axis) at[axis] += noise * places.spacing * gauss(random);
    Surfel surfel;
    surfel.position = glm::vec3(at);
    surfel.normal = glm::vec3(glm::normalize(glm::cross(b - a, c - a)));
    places.surfels.push_back(surfel);
  }
  return places;
}

std::vector<glm::vec3> normalsIn(const std::string& path) {
  const std::unique_ptr<RowReader> reader = take(openRowReader(path));
  const RowLayout& element = reader->element();
  const std::size_t offset = element.find("nx")->offset;
  AlignedBuffer buffer;
  std::vector<glm::vec3> normals;
  for (;;) {
    const Bytes rows = take(reader->readRows(4096, buffer));
    if (rows.empty()) return normals;
    for (std::size_t at = 0; at < rows.size(); at += element.row_bytes) {
      glm::vec3& normal = normals.emplace_back();
      for (int i = 0; i < 3; ++i) {
        normal[i] =
            float(rowValue(rows.data() + at + offset + 4 * std::size_t(i), ValueType::kFloat32));
      }
    }
  }
}

class Bench {
 public:
  Bench(NormalsOptions options, std::string saved)
      : options_(std::move(options)), saved_(std::move(saved)) {
    std::string name = (std::filesystem::temp_directory_path() / "normals-XXXXXX").string();
    if (mkdtemp(name.data()) == nullptr) std::exit(1);
    directory_ = name + "/";
  }
  Bench(const Bench&) = delete;
  Bench& operator=(const Bench&) = delete;
  ~Bench() { std::filesystem::remove_all(directory_); }

  void row(const std::string& mesh_path, const Mesh& mesh, std::size_t count, double noise) const {
    const Places places = scatter(mesh, count, noise);
    const std::string name = std::filesystem::path(mesh_path).stem().string();
    write(directory_ + "cloud.ply", places.surfels, false);
    if (!saved_.empty()) {
      const std::string saved = fmt::format("{}/{}_{}", saved_, name, noise);
      write(saved + ".ply", places.surfels, false);
      write(saved + "_truth.ply", places.surfels, true);
      return;
    }
    Progress quiet;
    const double before = processCpuSeconds();
    const NormalsStats stats = take(
        estimateNormals(directory_ + "cloud.ply", directory_ + "normals.ply", options_, quiet));
    const double cpu = processCpuSeconds() - before;
    std::vector<glm::vec3> truth;
    for (const Surfel& surfel : places.surfels) truth.push_back(surfel.normal);
    fmt::print("| {} | {} | {} | {:.0f} | {:.1f} |\n", name, noise,
               errors(truth, normalsIn(directory_ + "normals.ply")), double(count) / cpu / 1e3,
               stats.seconds);
    std::fflush(stdout);
  }

  // "median | 90 % | flips | without"
  static std::string errors(const std::vector<glm::vec3>& truth,
                            const std::vector<glm::vec3>& found) {
    std::vector<float> angles;
    std::size_t without = 0, flipped = 0;
    for (std::size_t i = 0; i < truth.size(); ++i) {
      if (found[i] == glm::vec3(0)) {
        ++without;
        continue;
      }
      const float cosine = glm::dot(truth[i], found[i]);
      flipped += cosine < 0 ? 1 : 0;
      angles.push_back(std::acos(std::min(std::abs(cosine), 1.f)) * 57.29578f);
    }
    std::sort(angles.begin(), angles.end());
    const double with = double(angles.size());
    return fmt::format("{:.2f} | {:.2f} | {:.3f} | {:.3f}", angles[angles.size() / 2],
                       angles[angles.size() * 9 / 10], 100 * double(flipped) / with,
                       100 * double(without) / double(truth.size()));
  }

 private:
  static void write(const std::string& path, const std::vector<Surfel>& surfels, bool has_normals) {
    CloudChannels channels;
    channels.normal = has_normals;
    SurfelWriter writer = take(SurfelWriter::create(path, channels));
    need(writer.write(surfels));
    need(writer.finish());
  }

  NormalsOptions options_;
  std::string saved_, directory_;
};

void run(const std::vector<std::string>& meshes, std::size_t count, const NormalsOptions& options,
         const std::string& saved) {
  fmt::print(
      "{} places on each mesh. Angles from the triangle's normal in degrees, either way; noise in\n"
      "spacings; flips of those with a normal, %.\n\n"
      "| mesh | noise | median | 90 % | flips | without | k/s and core | wall s |\n"
      "|---|---|---|---|---|---|---|---|\n",
      count);
  Progress quiet;
  const Bench bench(options, saved);
  for (const std::string& path : meshes) {
    const Mesh mesh = take(loadMeshes({path}, glm::vec3(0.5f), quiet));
    for (const double noise : {0., .2}) bench.row(path, mesh, count, noise);
  }
}

}  // namespace
}  // namespace surfeit

int main(int argc, char** argv) {
  CLI::App app("Normals found for places on meshes");
  std::vector<std::string> meshes;
  std::size_t count = 200000;
  surfeit::NormalsOptions options;
  std::string saved, found, truth;
  app.add_option("MESH", meshes, "PLY or OBJ");
  app.add_option("--save", saved, "Write the places there, and do nothing else");
  app.add_option("--check", found, "Cloud with normals");
  app.add_option("--truth", truth, "The same places with the true ones");
  app.add_option("--count", count, "Places on each")->capture_default_str();
  app.add_option("--threads", options.threads, "Threads");
  surfeit::addNormalOptions(app, options.estimation);
  CLI11_PARSE(app, argc, argv);
  if (!found.empty()) {
    fmt::print("{}\n",
               surfeit::Bench::errors(surfeit::normalsIn(truth), surfeit::normalsIn(found)));
    return 0;
  }
  surfeit::run(meshes, count, options, saved);
  return 0;
}
