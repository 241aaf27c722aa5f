// Curved things that a light shines on from one side: a receiver below sees mostly their dark
// side, and one above their bright side, also where a node stands for all of it.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <glm/mat3x3.hpp>
#include <ostream>
#include <string>
#include <vector>

#include "random/indexed_scene.h"
#include "random/random_numbers.h"
#include "surfeit/gather.h"

namespace surfeit {
namespace {

enum class Curved { kBall, kEgg, kPipe, kBowl };

struct CurvedScene {
  const char* name;
  Curved shape;
};
void PrintTo(const CurvedScene& scene, std::ostream* out) { *out << scene.name; }

// A place on the shape and its normal, of two numbers between 0 and 1, and the area per number.
struct Place {
  glm::vec3 position, normal;
  float area;
};

Place placeOn(Curved shape, float a, float b) {
  constexpr float kTau = 6.2831853f;
  const float turn = kTau * a, z = 2 * b - 1, across = std::sqrt(1 - z * z);
  const glm::vec3 ball(across * std::cos(turn), z, across * std::sin(turn));
  switch (shape) {
    case Curved::kBall:
      return {ball, ball, 2 * kTau};
    case Curved::kBowl: {
      const glm::vec3 low(ball.x, -std::abs(ball.y), ball.z);
      return {low, -low, kTau};
    }
    case Curved::kEgg: {
      const glm::vec3 size(1, .6f, 1.7f);
      const glm::vec3 inverse = ball / size;
      return {ball * size, glm::normalize(inverse),
              2 * kTau * size.x * size.y * size.z * glm::length(inverse)};
    }
    case Curved::kPipe:
      break;
  }
  const glm::vec3 round(std::cos(turn), std::sin(turn), 0);
  return {round + glm::vec3(0, 0, 2 * z), round, 4 * kTau};
}

// Lit from above, each color from a little elsewhere, with some light from everywhere.
std::vector<Surfel> surfelsOf(const CurvedScene& scene, const glm::mat3& turn) {
  constexpr int kRows = 140;
  const glm::vec3 lights[] = {glm::normalize(glm::vec3(.3f, 1, .2f)),
                              glm::normalize(glm::vec3(.1f, 1, -.3f)),
                              glm::normalize(glm::vec3(-.1f, 1, 0))};
  RandomNumbers random(8);
  std::vector<Surfel> surfels;
  for (int i = 0; i < kRows * kRows; ++i) {
    const float a = (float(i % kRows) + float(random.between(0, 1))) / kRows;
    const float b = (float(i / kRows) + float(random.between(0, 1))) / kRows;
    const Place place = placeOn(scene.shape, a, b);
    Surfel& surfel = surfels.emplace_back();
    surfel.position = turn * place.position;
    surfel.normal = turn * place.normal;
    surfel.area = place.area / (kRows * kRows);
    surfel.radius = std::sqrt(surfel.area);
    for (int c = 0; c < 3; ++c) {
      const float cosine = glm::dot(place.normal, lights[c]);
      surfel.radiosity[c] = .02f + std::max(0.f, cosine);
    }
  }
  return surfels;
}

// At two to six times the size of the shape, facing it, from below or from above.
std::vector<LocalReceiver> receiversAround(const glm::mat3& turn, bool are_below) {
  RandomNumbers random(5);
  std::vector<LocalReceiver> receivers;
  while (receivers.size() < 150) {
    const glm::vec3 direction(random.direction());
    if (std::abs(direction.y) < .5f || (direction.y < 0) != are_below) continue;
    LocalReceiver& receiver = receivers.emplace_back();
    receiver.position = turn * (direction * float(random.between(3.2, 9)));
    receiver.normal = turn * glm::normalize(.4f * glm::vec3(random.direction()) - direction);
  }
  return receivers;
}

// What reaches a receiver from all surfels that show it the front of a shape that hides nothing of
// itself.
glm::vec3 irradianceOf(const std::vector<Surfel>& surfels, const LocalReceiver& receiver) {
  glm::dvec3 sum(0);
  for (const Surfel& surfel : surfels) {
    const glm::dvec3 offset(surfel.position - receiver.position);
    const double square = glm::dot(offset, offset);
    const double facing = -glm::dot(offset, glm::dvec3(surfel.normal));
    const double height = glm::dot(offset, glm::dvec3(receiver.normal));
    if (facing <= 0 || height <= 0) continue;
    sum += double(surfel.area) * facing * height / (square * square) * glm::dvec3(surfel.radiosity);
  }
  return glm::vec3(sum / 3.14159265358979);
}

class CurvedLight : public testing::TestWithParam<CurvedScene> {
 protected:
  // Errors over the mean that arrives above. A shape covers 1 % too much at standard quality.
  void measure(IndexedScene& scene, const std::vector<Surfel>& surfels, const glm::mat3& turn,
               QualityPreset preset) {
    GatherRules rules(GatherMode::kBleeding, {});
    setQuality(preset, rules.quality);
    double mean_above = 0;
    for (const bool are_below : {false, true}) {
      const std::vector<LocalReceiver> receivers = receiversAround(turn, are_below);
      const auto found = scene.gatherTogether(receivers, rules);
      ASSERT_TRUE(found.ok()) << found.status().message();
      double square = 0, sum = 0, mean = 0;
      for (std::size_t i = 0; i < receivers.size(); ++i) {
        const glm::dvec3 truth(irradianceOf(surfels, receivers[i]));
        const glm::dvec3 error = glm::dvec3((*found)[i].irradiance) - truth;
        square += glm::dot(error, error) / 3 / double(receivers.size());
        sum += error.g / double(receivers.size());
        mean += truth.g / double(receivers.size());
      }
      if (!are_below) mean_above = mean;
      const double rms = std::sqrt(square) / mean_above, bias = sum / mean_above;
      fmt::print("{}: irradiance {:.4f}, off by {:.4f}, bias {:+.4f}\n",
                 are_below ? "below" : "above", mean / mean_above, rms, bias);
      const bool is_final = preset == QualityPreset::kFinal;
      EXPECT_LE(rms, (is_final ? .55 : 1) * (are_below ? .008 : .034));
      EXPECT_LE(std::abs(bias), (is_final ? .55 : 1) * (are_below ? .002 : .026));
    }
  }
};

TEST_P(CurvedLight, ComesFromTheSideThatIsSeen) {
  RandomNumbers random(3);
  const glm::vec3 x = glm::normalize(glm::vec3(random.direction()));
  const glm::vec3 y = glm::normalize(glm::cross(x, glm::vec3(random.direction())));
  for (const glm::mat3& turn : {glm::mat3(1), glm::mat3(x, y, glm::cross(x, y))}) {
    const std::vector<Surfel> surfels = surfelsOf(GetParam(), turn);
    const auto made = IndexedScene::make(surfels);
    ASSERT_TRUE(made.ok()) << made.status().message();
    measure(**made, surfels, turn, QualityPreset::kStandard);
    measure(**made, surfels, turn, QualityPreset::kFinal);
  }
}

INSTANTIATE_TEST_SUITE_P(Shapes, CurvedLight,
                         testing::Values(CurvedScene{"Ball", Curved::kBall},
                                         CurvedScene{"Egg", Curved::kEgg},
                                         CurvedScene{"Pipe", Curved::kPipe},
                                         CurvedScene{"Bowl", Curved::kBowl}),
                         [](const auto& one) { return one.param.name; });

}  // namespace
}  // namespace surfeit
