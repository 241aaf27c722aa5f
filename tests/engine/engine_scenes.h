// Scenes and receivers for tests of the engine.
#pragma once

#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <glm/geometric.hpp>
#include <string>
#include <utility>
#include <vector>

#include "io/test_directory.h"
#include "random/indexed_scene.h"
#include "random/random_scene.h"
#include "surfeit/engine.h"

namespace surfeit {

inline constexpr std::uint64_t kMiB = std::uint64_t{1} << 20;

template <typename T>
T valueOrFail(Result<T> result) {
  EXPECT_TRUE(result.ok()) << result.status().message();
  if (!result.ok()) std::abort();  // nothing else can be tested
  return std::move(*result);
}

inline Engine makeEngine(std::uint64_t memory_bytes = 64 * kMiB, int threads = 1) {
  EngineOptions options;
  options.memory_bytes = memory_bytes;
  options.threads = threads;
  return valueOrFail(Engine::create(options));
}

inline GatherSettings bleedingSettings() {
  GatherSettings settings;
  settings.mode = GatherMode::kBleeding;
  return settings;
}

// Receivers of a scene, as a caller has them.
inline std::vector<Receiver> receiversOf(const RandomScene& scene) {
  std::vector<Receiver> receivers;
  for (const RandomReceiver& each : scene.receivers) {
    receivers.push_back({glm::dvec3(each.receiver.position), each.receiver.normal, glm::vec3(0)});
  }
  return receivers;
}

// As many more, near these.
inline std::vector<Receiver> manyOf(const std::vector<Receiver>& receivers, std::size_t count) {
  std::vector<Receiver> many;
  for (std::size_t i = 0; i < count; ++i) {
    Receiver receiver = receivers[i * receivers.size() / count];
    receiver.position += 1e-4 * double(i % 97) * glm::dvec3(receiver.normal);
    many.push_back(receiver);
  }
  return many;
}

inline std::vector<GatherResult> gatherAt(Gatherer& gatherer,
                                          const std::vector<Receiver>& receivers) {
  std::vector<GatherResult> results(receivers.size());
  const Status status = gatherer.gather(receivers.data(), receivers.size(), results.data());
  EXPECT_TRUE(status.ok()) << status.message();
  return results;
}

// The same along the curve of the scene, from and to vectors.
inline std::vector<GatherResult> gatherAlong(Gatherer& gatherer,
                                             const std::vector<Receiver>& receivers,
                                             int threads = 2) {
  class Vectors : public ReceiverArray {
   public:
    explicit Vectors(const std::vector<Receiver>& receivers)
        : results(receivers.size()), receivers_(receivers) {}
    std::size_t count() const override { return receivers_.size(); }
    Receiver receiver(std::size_t index) const override { return receivers_[index]; }
    void setResult(std::size_t index, const GatherResult& result) override {
      results[index] = result;
    }
    std::vector<GatherResult> results;

   private:
    const std::vector<Receiver>& receivers_;
  };
  Vectors vectors(receivers);
  Progress progress;
  const Status status = gatherer.gatherAll(vectors, progress, threads);
  EXPECT_TRUE(status.ok()) << status.message();
  return vectors.results;
}

inline bool haveSameBytes(const std::vector<GatherResult>& a, const std::vector<GatherResult>& b) {
  return a.size() == b.size() &&
         std::memcmp(a.data(), b.data(), a.size() * sizeof(GatherResult)) == 0;
}

// How far results are off, by occlusion and by irradiance over its mean.
struct Difference {
  double mean_occlusion = 0, most_occlusion = 0;
  double mean_light = 0, most_light = 0;
};
inline Difference differenceOf(const std::vector<GatherResult>& a,
                               const std::vector<GatherResult>& b) {
  Difference difference;
  double light = 0;
  for (std::size_t i = 0; i < a.size(); ++i) {
    const double occlusion = std::abs(double(a[i].occlusion) - double(b[i].occlusion));
    const double off = double(glm::length(a[i].irradiance - b[i].irradiance));
    light += double(glm::length(b[i].irradiance));
    difference.mean_occlusion += occlusion;
    difference.mean_light += off;
    difference.most_occlusion = std::max(difference.most_occlusion, occlusion);
    difference.most_light = std::max(difference.most_light, off);
  }
  const auto count = double(a.size());
  difference.mean_occlusion /= count;
  difference.mean_light /= std::max(light, 1e-30);
  difference.most_light /= std::max(light / count, 1e-30);
  return difference;
}

// A directory with random scenes, indexed: "1.sft" of seed 1.
class EngineTest : public DirectoryTest {
 protected:
  std::string sceneFile(std::uint64_t seed) {
    const std::string file = path(std::to_string(seed) + ".sft");
    const Status status = indexTo(file, makeRandomScene(seed).surfels);
    EXPECT_TRUE(status.ok()) << status.message();
    return file;
  }
};

}  // namespace surfeit
