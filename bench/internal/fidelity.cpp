// How true is a gather? Compares results of `surfeit gather` with rays traced by Embree against the
// true triangles, at evenly spaced receivers, and prints errors and the ray tracer's rates:
//
//   fidelity RESULT.ply MESH... [lights and ground as for surfeit sample] [--rays 1024]

#include <fmt/format.h>
#include <tbb/global_control.h>
#include <tbb/parallel_for.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <glm/geometric.hpp>
#include <optional>
#include <string>
#include <vector>

#include "bench/internal/error_summary.h"
#include "cloud/ply/ply_reader.h"
#include "core/job_limits.h"
#include "core/seconds_since.h"
#include "sample/reference.h"
#include "tools/sample_options.h"

namespace surfeit {
namespace {

struct FidelityOptions {
  std::string result;
  std::vector<std::string> meshes;
  Surroundings surroundings;
  ReferenceQuality quality;
  int receivers = 2000;
  int threads = 0;
};

// A receiver and what the gather found there.
struct Measured {
  glm::vec3 position{0}, normal{0};
  float occlusion = 0;
  glm::vec3 irradiance{0};
};

struct MeasuredCloud {
  std::vector<Measured> receivers;
  bool has_irradiance = false;
  std::uint64_t in_file = 0;
  std::uint64_t left_out = 0;  // chosen, but without a normal or a finite result
};

// Evenly spaced records of the result, by number.
Result<MeasuredCloud> readResult(const std::string& path, int count) {
  SURFEIT_ASSIGN_OR_RETURN(PlyReader reader, PlyReader::open(path));
  const std::optional<std::size_t> index = reader.header().findElement("vertex");
  if (!index) return Status::corruption(fmt::format("{}: no element vertex", path));
  const RowLayout& element = reader.header().elements[*index];
  constexpr std::array kNames = {
      "x", "y", "z", "nx", "ny", "nz", "occlusion", "irradiance_r", "irradiance_g", "irradiance_b"};
  std::array<const RowProperty*, kNames.size()> properties{};
  for (std::size_t i = 0; i < kNames.size(); ++i) {
    properties[i] = element.find(kNames[i]);
    if (properties[i] == nullptr && i < 7) {
      return Status::corruption(fmt::format("{}: no property {}", path, kNames[i]));
    }
  }

  MeasuredCloud cloud;
  cloud.in_file = element.count;
  cloud.has_irradiance = properties[7] && properties[8] && properties[9];
  const std::uint64_t chosen = std::min<std::uint64_t>(std::uint64_t(count), element.count);
  SURFEIT_RETURN_IF_ERROR(reader.seekElement(*index));
  std::vector<std::byte> rows(4096 * element.row_bytes);
  std::uint64_t record = 0, next = 0;  // next: how many are chosen so far
  for (;;) {
    SURFEIT_ASSIGN_OR_RETURN(const std::size_t row_count, reader.readRows(rows));
    if (row_count == 0) break;
    for (std::size_t i = 0; i < row_count; ++i, ++record) {
      if (next >= chosen || record != (2 * next + 1) * element.count / (2 * chosen)) continue;
      ++next;
      std::array<float, kNames.size()> values{};
      for (std::size_t k = 0; k < values.size(); ++k) {
        if (properties[k] == nullptr) continue;
        values[k] = float(
            rowValue(&rows[i * element.row_bytes + properties[k]->offset], properties[k]->type));
      }
      Measured measured{{values[0], values[1], values[2]},
                        {values[3], values[4], values[5]},
                        values[6],
                        {values[7], values[8], values[9]}};
      const float length = glm::length(measured.normal);
      const float sum = measured.occlusion + measured.irradiance.x + measured.irradiance.y +
                        measured.irradiance.z + length;
      if (!(length > 1e-6f) || !std::isfinite(sum)) {
        ++cloud.left_out;
        continue;
      }
      measured.normal /= length;
      cloud.receivers.push_back(measured);
    }
  }
  if (cloud.receivers.empty()) {
    return Status::corruption(fmt::format("{}: no receiver with a normal and a result", path));
  }
  return cloud;
}

double luminance(const glm::vec3& rgb) {
  return 0.2126 * double(rgb.x) + 0.7152 * double(rgb.y) + 0.0722 * double(rgb.z);
}

void printOcclusion(const char* name, const std::vector<Measured>& receivers,
                    const std::vector<ReferenceGather>& truths, float ReferenceGather::*truth) {
  const auto truthOf = [&](std::size_t i) { return double(truths[i].*truth); };
  const ErrorFigures errors = summariseErrors(
      receivers.size(), [&](std::size_t i) { return double(receivers[i].occlusion) - truthOf(i); },
      truthOf);
  fmt::print("occlusion  {:5}  mean {:.4f}  RMSE {:.4f}  bias {:+.4f}  p95 {:.4f}  max {:.4f}\n",
             name, errors.mean, errors.rmse, errors.bias, errors.p95, errors.max);
}

void printIrradiance(const char* name, const std::vector<Measured>& receivers,
                     const std::vector<ReferenceGather>& truths,
                     glm::vec3 ReferenceGather::*truth) {
  const auto truthOf = [&](std::size_t i) { return luminance(truths[i].*truth); };
  const ErrorFigures bias = summariseErrors(
      receivers.size(),
      [&](std::size_t i) { return luminance(receivers[i].irradiance) - truthOf(i); }, truthOf);
  // Over the three channels, so that a wrong color of the right luminance counts
  const ErrorFigures errors = summariseErrors(
      receivers.size(),
      [&](std::size_t i) {
        const glm::vec3 error = receivers[i].irradiance - truths[i].*truth;
        return std::sqrt(double(glm::dot(error, error)) / 3);
      },
      truthOf);
  if (!(errors.mean > 0)) {
    fmt::print("irradiance {:5}  mean 0: no light reaches the receivers\n", name);
    return;
  }
  fmt::print(
      "irradiance {:5}  mean {:.4g}  relative RMSE {:.4f}  relative bias {:+.4f}  p95 {:.4f}  max "
      "{:.4f}\n",
      name, errors.mean, errors.rmse / errors.mean, bias.bias / errors.mean,
      errors.p95 / errors.mean, errors.max / errors.mean);
}

// Runs trace(i) for all receivers and prints how fast.
template <typename Trace>
void timeTracing(const char* name, std::size_t count, int rays, int threads, Trace trace) {
  const auto start = std::chrono::steady_clock::now();
  tbb::parallel_for(std::size_t{0}, count, trace);
  const double seconds = secondsSince(start);
  fmt::print("embree {}: {} rays, {} threads: {:.3g} receivers/s, {:.3g} rays/s, {:.2f} s\n", name,
             rays, threads, double(count) / seconds, double(count) * rays / seconds, seconds);
}

class Notes : public Progress {
 public:
  void note(const std::string& message) override {
    fmt::print(stderr, "fidelity: note: {}\n", message);
  }
};

Status run(const FidelityOptions& options) {
  const int threads = options.threads > 0 ? options.threads : defaultThreadCount();
  const tbb::global_control limit(tbb::global_control::max_allowed_parallelism,
                                  std::size_t(threads));
  Notes notes;
  SURFEIT_ASSIGN_OR_RETURN(const MeasuredCloud cloud,
                           readResult(options.result, options.receivers));
  SURFEIT_ASSIGN_OR_RETURN(
      const ReferenceScene scene,
      ReferenceScene::load(options.meshes, options.surroundings, threads, notes));
  const std::vector<Measured>& receivers = cloud.receivers;
  fmt::print("{} of {} receivers ({} left out), {} triangles\n", receivers.size(), cloud.in_file,
             cloud.left_out, scene.mesh().triangle.size());

  // The seed depends on the receiver's number alone: the same truth on every run
  std::vector<float> occlusion(receivers.size());
  timeTracing("occlusion", receivers.size(), options.quality.rays, threads, [&](std::size_t i) {
    occlusion[i] =
        scene.occlusion(receivers[i].position, receivers[i].normal, i << 32, options.quality);
  });
  std::vector<ReferenceGather> truths(receivers.size());
  timeTracing("lit hits", receivers.size(), options.quality.rays, threads, [&](std::size_t i) {
    truths[i] = scene.gather(receivers[i].position, receivers[i].normal, i << 32, options.quality);
  });

  printOcclusion("front", receivers, truths, &ReferenceGather::occlusion_front);
  printOcclusion("both", receivers, truths, &ReferenceGather::occlusion_both);
  if (cloud.has_irradiance) {
    printIrradiance("front", receivers, truths, &ReferenceGather::irradiance_front);
    printIrradiance("both", receivers, truths, &ReferenceGather::irradiance_both);
  }
  return {};
}

}  // namespace
}  // namespace surfeit

int main(int argc, char** argv) {
  surfeit::FidelityOptions options;
  CLI::App app("Compares gather results with rays traced against the true triangles");
  app.add_option("RESULT", options.result, "Result of surfeit gather (PLY)")->required();
  app.add_option("MESH", options.meshes, "The meshes that were sampled")->required();
  app.add_option("--receivers", options.receivers, "Receivers to compare, evenly spaced")
      ->capture_default_str()
      ->check(CLI::Range(1, 1 << 30));
  app.add_option("--rays", options.quality.rays, "Rays per receiver")
      ->capture_default_str()
      ->check(CLI::Range(1, 1 << 24));
  app.add_option("--hit-light-samples", options.quality.light_samples,
                 "Shadow rays per light at each hit")
      ->capture_default_str()
      ->check(CLI::Range(1, 65536));
  app.add_option("--offset", options.quality.offset,
                 "Start of rays above the receiver, scene units [1/10000 of the diagonal]")
      ->check(CLI::NonNegativeNumber);
  app.add_option("--max-dist", options.quality.max_distance, "Ignore what is farther away");
  app.add_option("--threads", options.threads, "Threads [all that the job may use]");
  surfeit::addSurroundingsOptions(app, options.surroundings);
  CLI11_PARSE(app, argc, argv);

  const surfeit::Status status = surfeit::run(options);
  if (status.ok()) return 0;
  fmt::print(stderr, "fidelity: {}\n", status.message());
  return 1;
}
