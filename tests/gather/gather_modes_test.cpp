// Every mode, weight and output: packets against the scalar gather, and instruction sets against
// each other.
#include <fmt/format.h>

#include <bit>
#include <functional>
#include <string>

#include "batch/environment_file.h"
#include "gather/environment_pictures.h"
#include "gather/light/environment_map.h"
#include "gather/packet_clouds.h"
#include "gather/rules/gather_outputs.h"

namespace surfeit {
namespace {

// What instruction sets may differ by, and packets of equal receivers from the scalar gather. Where
// rounding decides whether two patches are of one thing, instruction sets differ by as much as the
// scalar gather may; that must be rare.
constexpr float kKernelTolerance = 1e-4f;
constexpr float kMostBeyondTolerance = 2e-3f;  // of all receivers
constexpr float kScalarTolerance = 3e-3f;

constexpr std::uint32_t kMost = kAllOutputs & ~std::uint32_t{kOutputEnvironment};

struct Case {
  std::string name;
  GatherRules rules;
};

Case makeCase(const std::string& name, GatherMode mode,
              const std::function<void(GatherRules&)>& change) {
  Case made = {name, GatherRules(mode, {})};
  change(made.rules);
  return made;
}

class GatherModes : public testing::Test {
 protected:
  GatherModes() {
    const std::string path = directory_.file("sky.exr");
    writeExr(TestPicture(64, 32,
                         [](int column, int row) {
                           return glm::vec3(.5f, .6f, .7f) +
                                  (column == 20 && row == 6 ? 500.f : 0.f);
                         }),
             path);
    Progress progress;
    GatherEnvironment environment;
    environment.path = path;
    environment.up = UpAxis::kZ;
    Result<EnvironmentMap> map = loadEnvironmentMap(environment, progress);
    EXPECT_TRUE(map.ok()) << map.status().message();
    environment_ =
        std::make_unique<LoadedEnvironment>(std::move(*map), GatherQuality().raster_resolution);
  }

  void surround(GatherRules& rules) const {
    rules.environment = &environment_->map;
    rules.environment_cube = &environment_->cube;
    rules.outputs |= kOutputEnvironment;
  }

  std::vector<Case> cases() const {
    using Distribution = GatherWeights::Distribution;
    using FalloffMode = GatherWeights::FalloffMode;
    constexpr GatherMode kOcclusion = GatherMode::kOcclusion, kBleeding = GatherMode::kBleeding;
    constexpr GatherMode kGlossy = GatherMode::kGlossy;
    const auto lookFrom = [](GatherRules& rules) { rules.eye = {3, -9, 4}; };
    const auto asItIs = [](GatherRules&) {};
    return {
        makeCase("occlusion", kOcclusion, asItIs),
        makeCase("bleeding", kBleeding, asItIs),
        makeCase("all outputs", kBleeding, [](GatherRules& rules) { rules.outputs = kMost; }),
        makeCase("environment", kBleeding,
                 [&](GatherRules& rules) {
                   rules.outputs = kMost;
                   surround(rules);
                 }),
        makeCase("by brightness", kOcclusion,
                 [&](GatherRules& rules) {
                   surround(rules);
                   rules.weights.by_brightness = true;
                 }),
        makeCase("bent normal", kOcclusion,
                 [](GatherRules& rules) { rules.outputs |= kOutputBentNormal; }),
        makeCase("uniform", kOcclusion,
                 [](GatherRules& rules) { rules.weights.distribution = Distribution::kUniform; }),
        makeCase("wide cone", kBleeding,
                 [](GatherRules& rules) { rules.weights.cone_angle = 1.3f; }),
        makeCase("cone", kBleeding, [](GatherRules& rules) { rules.weights.cone_angle = .5f; }),
        makeCase("exponential falloff", kBleeding,
                 [](GatherRules& rules) { rules.weights.falloff = .7f; }),
        makeCase("polynomial falloff", kOcclusion,
                 [](GatherRules& rules) {
                   rules.quality.max_distance = 3;
                   rules.weights.falloff = 1.5f;
                   rules.weights.falloff_mode = FalloffMode::kPolynomial;
                 }),
        makeCase("falloff in a cone", kOcclusion,
                 [](GatherRules& rules) {
                   rules.weights.cone_angle = .6f;
                   rules.weights.falloff = .7f;
                 }),
        makeCase("back sides", kBleeding,
                 [](GatherRules& rules) { rules.quality.sides = GatherSides::kBack; }),
        makeCase("glossy", kGlossy, lookFrom),
        makeCase("sharp", kGlossy,
                 [&](GatherRules& rules) {
                   lookFrom(rules);
                   rules.weights.roughness = 1;
                   rules.weights.cone_angle = .02f;
                 }),
        makeCase("rough", kGlossy,
                 [&](GatherRules& rules) {
                   lookFrom(rules);
                   rules.weights.roughness = .6f;
                 }),
        makeCase("glossy environment", kGlossy,
                 [&](GatherRules& rules) {
                   lookFrom(rules);
                   surround(rules);
                   rules.outputs |= kOutputBentNormal | kOutputIlluminationDirection;
                 }),
    };
  }

  TestDirectory directory_;
  std::unique_ptr<LoadedEnvironment> environment_;
};

// Where less than a tenth is open, its direction counts for less: that is the mean of little, and
// what rounding leaves of that may turn it.
GatherResult weighted(GatherResult result) {
  result.bent_normal *= std::min(1.f, 10 * (1 - result.occlusion));
  return result;
}

// The largest difference of any float; the scale of harmonics and environments does not matter.
float difference(const GatherResult& a, const GatherResult& b) {
  using Floats = std::array<float, kResultFloats>;
  const Floats x = std::bit_cast<Floats>(weighted(a)), y = std::bit_cast<Floats>(weighted(b));
  float largest = 0;
  for (std::size_t i = 0; i < x.size(); ++i) {
    largest = std::max(largest, std::abs(x[i] - y[i]) / std::max({1.f, x[i], y[i]}));
  }
  return largest;
}

TEST_F(GatherModes, EqualReceiversGiveWhatTheScalarGatherGives) {
  const Cloud cloud = mixedCloud();
  TestScene scene(cloud);
  for (const Case& tried : cases()) {
    SCOPED_TRACE(tried.name);
    PacketGatherer gatherer(tried.rules);
    float worst = 0, sum = 0;
    for (std::size_t run = 0; run < kRuns; ++run) {
      const Surfel& at = cloud[run * cloud.size() / kRuns];
      const std::vector<LocalReceiver> receivers(kPacketReceivers, {at.position, at.normal});
      const GatherResult expected = scene.gather(receivers[0], tried.rules);
      for (const GatherResult& result : gatherPacket(gatherer, scene, receivers)) {
        worst = std::max(worst, difference(result, expected));
      }
      sum += expected.occlusion;
    }
    fmt::print("{}: mean occlusion {:.3f}, largest difference {:.2g}\n", tried.name,
               sum / float(kRuns), worst);
    // The sun of an environment counts 3,000 times what is covered of its pixel (.0083, where
    // occlusion differs by 8e-7)
    EXPECT_LT(worst, tried.name == "environment" ? 4 * kScalarTolerance : kScalarTolerance);
    EXPECT_GT(sum, 0);
  }
}

TEST_F(GatherModes, InstructionSetsAgree) {
  const Cloud cloud = mixedCloud();
  TestScene scene(cloud);
  ASSERT_GE(packetKernels().size(), 2u);
  std::size_t count = 0, beyond_count = 0;
  for (const Case& tried : cases()) {
    // Pixels of a cone of .02 are a tenth as wide as those of others
    const float scale = tried.name == "sharp" ? 20.f : 1.f;
    std::deque<PacketGatherer> gatherers;  // which do not move
    for (const PacketKernel& kernel : packetKernels()) gatherers.emplace_back(tried.rules, kernel);
    for (std::size_t run = 0; run < kRuns; ++run) {
      const std::vector<LocalReceiver> receivers = neighbours(cloud, run * cloud.size() / kRuns);
      const std::vector<GatherResult> expected = gatherPacket(gatherers.back(), scene, receivers);
      for (std::size_t k = 0; k + 1 < gatherers.size(); ++k) {
        SCOPED_TRACE(tried.name + ", " + packetKernels()[k].name);
        const std::vector<GatherResult> results = gatherPacket(gatherers[k], scene, receivers);
        for (std::size_t i = 0; i < results.size(); ++i) {
          const float worst = difference(results[i], expected[i]);
          EXPECT_LT(worst, scale * kScalarTolerance);
          if (!(worst < scale * kKernelTolerance)) ++beyond_count;
          ++count;
        }
      }
    }
  }
  fmt::print("{} of {} receivers beyond the tolerance\n", beyond_count, count);
  EXPECT_LT(float(beyond_count), kMostBeyondTolerance * float(count));
}

TEST(GatherOutputs, ResultsArePackedAndUnpacked) {
  GatherResult result;
  std::array<float, kResultFloats> values;
  for (std::size_t i = 0; i < values.size(); ++i) values[i] = float(i) + 1;
  result = std::bit_cast<GatherResult>(values);
  for (std::uint32_t outputs = 1; outputs <= kAllOutputs; ++outputs) {
    std::array<float, kResultFloats + 1> row;
    row.fill(-1);
    packResult(result, outputs, row.data());
    EXPECT_EQ(resultNames(outputs, GatherMode::kBleeding).size(), resultFloats(outputs));
    EXPECT_EQ(row[resultFloats(outputs)], -1);
    const GatherResult unpacked = unpackResult(row.data(), outputs);
    EXPECT_EQ(unpacked.occlusion, (outputs & kOutputOcclusion) != 0 ? 1 : 0);
    EXPECT_EQ(unpacked.fluence.z, (outputs & kOutputFluence) != 0 ? 16 : 0);
    EXPECT_EQ(unpacked.radiance_sh[8].z, (outputs & kOutputRadianceSh) != 0 ? 43 : 0);
  }
  const auto names = resultNames(kOutputIrradiance | kOutputBentNormal, GatherMode::kGlossy);
  EXPECT_EQ(names.front(), "reflection_r");
  EXPECT_EQ(names.back(), "bent_normal_z");
}

}  // namespace
}  // namespace surfeit
