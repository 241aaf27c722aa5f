// The gate on every change: occlusion and irradiance at 2,000 receivers a scene,
// against 1,024 rays each on the true triangles. The errors are printed; the limits stand a third
// above what was measured when they were set, and may only go down.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <cstdlib>
#include <filesystem>
#include <string>

#include "fidelity/fidelity_case.h"

namespace surfeit {
namespace {

constexpr std::uint64_t kReceivers = 2000;
constexpr int kRays = 1024;

TEST_F(Fidelity, CornellBoxWithSpheres) {
  ASSERT_EQ(std::system(fmt::format("'{}' '{}' >/dev/null", CORNELL_SCENE, path("")).c_str()), 0);
  ASSERT_NO_FATAL_FAILURE(sample(path("cornell.obj"), {}, kReceivers));
  measure("cornell", QualityPreset::kStandard, kRays, {0.0063, 0.0048, 0.045});
}

TEST_F(Fidelity, BunnyOnAPlane) {
  const std::string mesh = std::string(SURFEIT_SHARED_DATA_DIR) + "/meshes/bunny.ply";
  if (!std::filesystem::exists(mesh)) GTEST_SKIP() << mesh << " is not here";
  Surroundings surroundings;
  surroundings.ground.enabled = true;
  surroundings.lights.directionals.push_back({{-1, -2, -0.5f}, {3, 3, 3}});
  ASSERT_NO_FATAL_FAILURE(sample(mesh, surroundings, kReceivers));
  measure("bunny", QualityPreset::kStandard, kRays, {0.0051, 0.002, 0.058});
}

}  // namespace
}  // namespace surfeit
