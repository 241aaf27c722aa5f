// Irradiance under lights that cast hard shadows: what shines is small and near what is dark.
// Meshes on a plane, against 16,384 rays. Goal: 4 % of the mean at standard, 2 % at final, bias 1
// %.
#include <gtest/gtest.h>

#include <filesystem>
#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <ostream>
#include <string>
#include <tuple>

#include "fidelity/fidelity_case.h"

namespace surfeit {
namespace {

enum class HardLight { kSun, kPoint, kLamp };
const char* nameOf(HardLight light) {
  return light == HardLight::kSun ? "Sun" : light == HardLight::kPoint ? "Point" : "Lamp";
}
void PrintTo(HardLight light, std::ostream* out) { *out << nameOf(light); }

class UnderHardLight : public Fidelity,
                       public testing::WithParamInterface<std::tuple<const char*, HardLight>> {
 protected:
  // Above the mesh and beside it, wherever it lies and however large it is.
  void addLight(const std::string& mesh, HardLight light, Lights& lights) {
    SampleOptions options;
    options.count = 2000;
    ASSERT_TRUE(sampleMeshes({mesh}, path("outline.ply"), options, progress_).ok());
    const BakedRows rows = readBakedRows(path("outline.ply"));
    glm::vec3 low(1e30f), high(-1e30f);
    for (std::size_t i = 0; i < rows.element.count; ++i) {
      const glm::vec3 at(rows.value(i, "x"), rows.value(i, "y"), rows.value(i, "z"));
      low = glm::min(low, at);
      high = glm::max(high, at);
    }
    const glm::vec3 middle = .5f * (low + high);
    const float size = glm::distance(low, high);
    if (light == HardLight::kSun) lights.directionals.push_back({{-1, -2, -1}, glm::vec3(3)});
    if (light == HardLight::kPoint) {
      lights.points.push_back({middle + size * glm::vec3(.6f, .7f, .5f), glm::vec3(size * size)});
    }
    if (light == HardLight::kLamp) {
      lights.areas.push_back({middle + size * glm::vec3(.3f, .9f, 0), size * glm::vec3(.15f, 0, 0),
                              size * glm::vec3(0, 0, .15f), glm::vec3(20)});
    }
  }
};

TEST_P(UnderHardLight, IrradianceComesCloseToTracedRays) {
  const auto [name, light] = GetParam();
  const std::string mesh = std::string(SURFEIT_SHARED_DATA_DIR) + "/meshes/" + name + ".ply";
  if (!std::filesystem::exists(mesh)) GTEST_SKIP() << mesh << " is not here";
  Surroundings surroundings;
  surroundings.ground.enabled = true;
  ASSERT_NO_FATAL_FAILURE(addLight(mesh, light, surroundings.lights));
  ASSERT_NO_FATAL_FAILURE(sample(mesh, surroundings, 400));
  constexpr int kManyRays = 16384;
  const std::string what = std::string(name) + ", " + nameOf(light);
  measure(what + ", standard", QualityPreset::kStandard, kManyRays, {.04, .003, .055, .012});
  measure(what + ", final", QualityPreset::kFinal, kManyRays, {.04, .003, .025, .012});
}

INSTANTIATE_TEST_SUITE_P(Meshes, UnderHardLight,
                         testing::Combine(testing::Values("bunny", "igea", "koala"),
                                          testing::Values(HardLight::kSun, HardLight::kPoint,
                                                          HardLight::kLamp)),
                         [](const auto& one) {
                           return std::string(std::get<0>(one.param)) +
                                  nameOf(std::get<1>(one.param));
                         });

}  // namespace
}  // namespace surfeit
