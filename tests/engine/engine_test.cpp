#include <gmock/gmock.h>

#include <cstdint>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <limits>
#include <string>
#include <vector>

#include "cloud/cloud_formats.h"
#include "engine/engine_scenes.h"
#include "surfeit/bake.h"
#include "surfels/rows/surfel_writer.h"

namespace surfeit {
namespace {

using testing::HasSubstr;

constexpr std::uint64_t kSeed = 5;

std::vector<Receiver> receiversOfSeed(std::uint64_t seed, std::size_t count) {
  return manyOf(receiversOf(makeRandomScene(seed)), count);
}

TEST_F(EngineTest, ASceneTellsWhatItsFileHolds) {
  const std::string file_path = sceneFile(kSeed);
  Engine engine = makeEngine();
  const Scene scene = valueOrFail(engine.open(file_path));
  const SceneInfo read = valueOrFail(readSceneInfo(file_path));
  EXPECT_EQ(scene.info().surfels, read.surfels);
  EXPECT_EQ(scene.info().provenance, read.provenance);
  EXPECT_EQ(scene.path(), file_path);
}

// Calls of whole clusters give what one call gives, byte for byte; so do gatherers of other
// budgets.
TEST_F(EngineTest, CallsOfWholeClustersAreOneCall) {
  const std::string file_path = sceneFile(kSeed);
  const std::vector<Receiver> receivers = receiversOfSeed(kSeed, 2000);
  Engine engine = makeEngine();
  const Scene scene = valueOrFail(engine.open(file_path));
  Gatherer gatherer = valueOrFail(engine.gatherer(scene, bleedingSettings()));
  const std::vector<GatherResult> at_once = gatherAt(gatherer, receivers);
  EXPECT_GT(differenceOf(at_once, std::vector<GatherResult>(receivers.size())).mean_occlusion, .05);

  std::vector<GatherResult> by_calls(receivers.size());
  for (std::size_t begin = 0; begin < receivers.size(); begin += 256) {
    const std::size_t count = std::min<std::size_t>(256, receivers.size() - begin);
    ASSERT_TRUE(gatherer.gather(&receivers[begin], count, &by_calls[begin]).ok());
  }
  EXPECT_TRUE(haveSameBytes(at_once, by_calls));
  EXPECT_EQ(gatherer.receivers(), 2 * receivers.size());

  Engine small = makeEngine(24 * kMiB);
  Gatherer other =
      valueOrFail(small.gatherer(valueOrFail(small.open(file_path)), bleedingSettings()));
  EXPECT_TRUE(haveSameBytes(at_once, gatherAt(other, receivers)));
}

TEST_F(EngineTest, OneReceiverAtATimeIsNearlyTheSame) {
  Engine engine = makeEngine();
  const Scene scene = valueOrFail(engine.open(sceneFile(kSeed)));
  Gatherer gatherer = valueOrFail(engine.gatherer(scene, bleedingSettings()));
  const std::vector<Receiver> receivers = receiversOf(makeRandomScene(kSeed));
  const std::vector<GatherResult> at_once = gatherAt(gatherer, receivers);
  for (const std::size_t size : {1u, 16u}) {
    std::vector<GatherResult> by_calls(receivers.size());
    for (std::size_t begin = 0; begin < receivers.size(); begin += size) {
      const std::size_t count = std::min(size, receivers.size() - begin);
      ASSERT_TRUE(gatherer.gather(&receivers[begin], count, &by_calls[begin]).ok());
    }
    const Difference difference = differenceOf(by_calls, at_once);
    EXPECT_LT(difference.mean_occlusion, .001) << size;
    EXPECT_LT(difference.mean_light, .005) << size;
  }
}

// The job on files stands on the same gather, in the order of the input or of the curve.
TEST_F(EngineTest, TheJobOnFilesGivesTheSame) {
  const std::string file_path = sceneFile(kSeed);
  const std::vector<Receiver> valid = receiversOfSeed(kSeed, 700);
  for (const auto& [max_variation, order] :
       {std::pair{0.f, ReceiverOrder::kInput}, std::pair{.02f, ReceiverOrder::kInput},
        std::pair{0.f, ReceiverOrder::kHilbert}, std::pair{.02f, ReceiverOrder::kHilbert}}) {
    std::vector<Receiver> receivers = valid;
    if (order == ReceiverOrder::kHilbert) receivers[77].normal = {1e-9f, 0, 0};  // too short
    const std::string cloud = path("receivers.ply");
    std::ofstream file(cloud);
    file << "ply\nformat ascii 1.0\nelement vertex " << receivers.size()
         << "\nproperty double x\nproperty double y\nproperty double z\nproperty float nx\n"
            "property float ny\nproperty float nz\nend_header\n";
    file.precision(17);
    for (const Receiver& each : receivers) {
      file << each.position.x << ' ' << each.position.y << ' ' << each.position.z << ' '
           << each.normal.x << ' ' << each.normal.y << ' ' << each.normal.z << '\n';
    }
    file.close();
    GatherOptions options;
    options.mode = GatherMode::kBleeding;
    options.quality.max_variation = max_variation;
    options.order = order;
    options.memory_bytes = 64 * kMiB;
    Progress progress;
    const auto stats = gatherCloud(file_path, cloud, path("result.ply"), options, progress);
    ASSERT_TRUE(stats.ok()) << stats.status().message();

    Engine engine = makeEngine();
    Gatherer gatherer = valueOrFail(engine.gatherer(valueOrFail(engine.open(file_path)), options));
    const std::vector<GatherResult> results = order == ReceiverOrder::kInput
                                                  ? gatherAt(gatherer, receivers)
                                                  : gatherAlong(gatherer, receivers);
    const auto reader = valueOrFail(openRowReader(path("result.ply")));
    AlignedBuffer buffer;
    const Bytes rows = valueOrFail(reader->readRows(receivers.size(), buffer));
    const RowProperty* const occlusion = reader->element().find("occlusion");
    const RowProperty* const green = reader->element().find("irradiance_g");
    ASSERT_TRUE(occlusion != nullptr && green != nullptr);
    for (std::size_t i = 0; i < receivers.size(); ++i) {
      if (std::isnan(results[i].occlusion)) continue;
      const std::byte* const row = rows.data() + i * reader->element().row_bytes;
      EXPECT_EQ(float(rowValue(row + occlusion->offset, occlusion->type)), results[i].occlusion);
      EXPECT_EQ(float(rowValue(row + green->offset, green->type)), results[i].irradiance.y);
    }
  }
}

TEST_F(EngineTest, InvalidReceiversGetNoNumberAndTheOthersTheirs) {
  Engine engine = makeEngine();
  const Scene scene = valueOrFail(engine.open(sceneFile(kSeed)));
  GatherSettings settings = bleedingSettings();
  Gatherer gatherer = valueOrFail(engine.gatherer(scene, settings));
  std::vector<Receiver> receivers = receiversOfSeed(kSeed, 16);
  const std::vector<GatherResult> valid = gatherAt(gatherer, receivers);
  const double nan = std::numeric_limits<double>::quiet_NaN();
  receivers.push_back({glm::dvec3(nan, 0, 0), glm::vec3(0, 1, 0), glm::vec3(0)});
  receivers.push_back({glm::dvec3(1e30, 0, 0), glm::vec3(0, 1, 0), glm::vec3(0)});
  receivers.push_back({glm::dvec3(0), glm::vec3(0, float(nan), 0), glm::vec3(0)});
  receivers.push_back({glm::dvec3(0), glm::vec3(0, 1e-20f, 0), glm::vec3(0)});
  const std::vector<GatherResult> results = gatherAt(gatherer, receivers);
  for (std::size_t i = 0; i < results.size(); ++i) {
    EXPECT_EQ(std::isnan(results[i].occlusion), i >= 16) << i;
    EXPECT_EQ(std::isnan(results[i].irradiance.x), i >= 16) << i;
    EXPECT_EQ(results[i].fluence.x, 0) << i;  // was not asked for
  }
  EXPECT_EQ(gatherer.invalidReceivers(), 4u);

  settings.mode = GatherMode::kGlossy;  // and nobody says where they are looked at from
  Gatherer glossy = valueOrFail(engine.gatherer(scene, settings));
  EXPECT_TRUE(std::isnan(gatherAt(glossy, {receivers[0]})[0].irradiance.x));
  receivers[0].view = -receivers[0].normal;
  EXPECT_FALSE(std::isnan(gatherAt(glossy, {receivers[0]})[0].irradiance.x));
}

TEST_F(EngineTest, GathersUnderAnEnvironment) {
  Engine engine = makeEngine();
  const Scene scene = valueOrFail(engine.open(sceneFile(kSeed)));
  const std::vector<glm::vec3> white(32 * 16, glm::vec3(1));
  EnvironmentPixels sky;
  sky.width = 32;
  sky.height = 16;
  sky.pixels = white.data();
  Gatherer gatherer = valueOrFail(engine.gatherer(scene, bleedingSettings(), &sky));
  constexpr float kRadiosity = 3.14159265f;  // of radiance 1
  for (const GatherResult& result : gatherAt(gatherer, receiversOfSeed(kSeed, 64))) {
    EXPECT_NEAR(result.environment.y, kRadiosity * (1 - result.occlusion), .01f);
  }
  sky.height = 20;
  EXPECT_THAT(engine.gatherer(scene, bleedingSettings(), &sky).status().message(),
              HasSubstr("twice as wide as high"));
}

TEST_F(EngineTest, ABudgetThatIsTooSmallNamesTheLeastThatWorks) {
  const std::string file_path = sceneFile(kSeed);
  const Status no_engine = Engine::create({.memory_bytes = kMiB, .threads = 1}).status();
  EXPECT_EQ(no_engine.code(), StatusCode::kBudgetTooSmall);
  // What it names does
  const auto named = [](const Status& status) {
    const std::string& text = status.message();
    const std::size_t end = text.find(" MiB is the least");
    return std::uint64_t(std::stod(text.substr(text.rfind(' ', end - 1) + 1)) * double(kMiB));
  };
  EngineOptions options;
  options.threads = 1;
  options.memory_bytes = named(no_engine);
  // A small scene may fit into what the figure was rounded up by
  Engine least = valueOrFail(Engine::create(options));
  const Status no_scene = least.open(file_path).status();
  if (!no_scene.ok()) {
    ASSERT_EQ(no_scene.code(), StatusCode::kBudgetTooSmall);
    options.memory_bytes = named(no_scene);
  }
  Engine larger = valueOrFail(Engine::create(options));
  const Scene scene = valueOrFail(larger.open(file_path));
  const Status no_gatherer = larger.gatherer(scene, bleedingSettings()).status();
  ASSERT_EQ(no_gatherer.code(), StatusCode::kBudgetTooSmall);
  options.memory_bytes = named(no_gatherer);
  Engine enough = valueOrFail(Engine::create(options));
  Gatherer gatherer =
      valueOrFail(enough.gatherer(valueOrFail(enough.open(file_path)), bleedingSettings()));
  gatherAt(gatherer, receiversOfSeed(kSeed, 256));
  EXPECT_LE(enough.statistics().held_bytes, options.memory_bytes);
}

TEST_F(EngineTest, TenScenesShareOneBudget) {
  Engine engine = makeEngine(20 * kMiB);
  std::vector<Scene> scenes;
  std::vector<Gatherer> gatherers;
  std::vector<std::vector<Receiver>> receivers;
  for (std::uint64_t seed = 1; seed <= 10; ++seed) {
    scenes.push_back(valueOrFail(engine.open(sceneFile(seed))));
    receivers.push_back(receiversOfSeed(seed, 64));
  }
  for (std::size_t i = 0; i < scenes.size(); ++i) {
    Gatherer gatherer = valueOrFail(engine.gatherer(scenes[i], bleedingSettings()));
    const std::vector<GatherResult> results = gatherAt(gatherer, receivers[i]);
    Engine alone = makeEngine();
    Gatherer expected =
        valueOrFail(alone.gatherer(valueOrFail(alone.open(scenes[i].path())), bleedingSettings()));
    EXPECT_TRUE(haveSameBytes(results, gatherAt(expected, receivers[i]))) << i + 1;
  }
  const EngineStatistics statistics = engine.statistics();
  EXPECT_EQ(statistics.scenes, 10u);
  EXPECT_EQ(statistics.gatherers, 0u);
  EXPECT_EQ(statistics.receivers, 640u);
  EXPECT_GT(statistics.surfel_cache.requests, 0u);
  EXPECT_LE(statistics.held_bytes + statistics.node_cache.budget_bytes +
                statistics.surfel_cache.budget_bytes,
            20 * kMiB);
  EXPECT_FALSE(engine.windows().empty());
}

// Numbers of pages are used again, and nothing of the scene before is found under them.
TEST_F(EngineTest, ScenesComeAndGo) {
  Engine engine = makeEngine();
  const std::string paths[] = {sceneFile(1), sceneFile(2), sceneFile(3)};
  const Scene stays = valueOrFail(engine.open(paths[0]));
  for (int round = 0; round < 6; ++round) {
    const std::uint64_t seed = 1 + std::uint64_t(round) % 3;
    const std::vector<Receiver> receivers = receiversOfSeed(seed, 64);
    Gatherer gatherer =
        valueOrFail(engine.gatherer(valueOrFail(engine.open(paths[seed - 1])), bleedingSettings()));
    Engine alone = makeEngine();
    Gatherer expected =
        valueOrFail(alone.gatherer(valueOrFail(alone.open(paths[seed - 1])), bleedingSettings()));
    EXPECT_TRUE(haveSameBytes(gatherAt(gatherer, receivers), gatherAt(expected, receivers)));
  }
  EXPECT_EQ(engine.statistics().scenes, 1u);
}

TEST_F(EngineTest, HandlesMayGoInAnyOrder) {
  const std::vector<Receiver> receivers = receiversOfSeed(kSeed, 16);
  auto engine = std::make_unique<Engine>(makeEngine());
  auto scene = std::make_unique<Scene>(valueOrFail(engine->open(sceneFile(kSeed))));
  Gatherer gatherer = valueOrFail(engine->gatherer(*scene, bleedingSettings()));
  const std::vector<GatherResult> before = gatherAt(gatherer, receivers);
  engine.reset();
  EXPECT_GT(scene->info().surfels, 0u);
  scene.reset();
  EXPECT_TRUE(haveSameBytes(before, gatherAt(gatherer, receivers)));
}

TEST_F(EngineTest, AFilesBytesAreAScene) {
  const std::string file_path = sceneFile(kSeed);
  std::ifstream file(file_path, std::ios::binary);
  const std::vector<char> bytes((std::istreambuf_iterator<char>(file)), {});
  Engine engine = makeEngine();
  const std::vector<Receiver> receivers = receiversOfSeed(kSeed, 64);
  Gatherer from_file =
      valueOrFail(engine.gatherer(valueOrFail(engine.open(file_path)), bleedingSettings()));
  const Scene held = valueOrFail(engine.openBytes(bytes.data(), bytes.size(), "held"));
  Gatherer from_bytes = valueOrFail(engine.gatherer(held, bleedingSettings()));
  EXPECT_TRUE(haveSameBytes(gatherAt(from_file, receivers), gatherAt(from_bytes, receivers)));
  EXPECT_GE(engine.statistics().held_bytes, bytes.size());
  const Status cut = engine.openBytes(bytes.data(), bytes.size() / 2, "half").status();
  EXPECT_EQ(cut.code(), StatusCode::kCorruption);
  EXPECT_THAT(cut.message(), HasSubstr("half"));
}

TEST_F(EngineTest, FailuresAreValues) {
  Engine engine = makeEngine();
  EXPECT_EQ(engine.open(path("none.sft")).status().code(), StatusCode::kIoError);
  const Scene scene = valueOrFail(engine.open(sceneFile(kSeed)));
  GatherSettings settings;
  settings.quality.raster_resolution = 7;
  EXPECT_EQ(engine.gatherer(scene, settings).status().code(), StatusCode::kInvalidArgument);
  settings = {};
  settings.groups = std::uint64_t{1} << 40;
  EXPECT_THAT(engine.gatherer(scene, settings).status().message(), HasSubstr("groups"));
  Engine other = makeEngine();
  EXPECT_THAT(other.gatherer(scene, {}).status().message(), HasSubstr("another engine"));
  EXPECT_THAT(engine.gatherer(std::vector<Instance>{}, {}).status().message(),
              HasSubstr("no instance"));

  class Cancelled : public Progress {
    bool isCancelled() const override { return true; }
  };
  Gatherer gatherer = valueOrFail(engine.gatherer(scene, {}));
  const Receiver receiver;
  GatherResult result;
  const Cancelled cancelled;
  EXPECT_EQ(gatherer.gather(&receiver, 1, &result, &cancelled).code(), StatusCode::kInterrupted);
  EXPECT_TRUE(gatherer.gather(&receiver, 1, &result).ok());
}

// A damaged page fails the calls that need it, with its name, and nothing else.
TEST_F(EngineTest, ADamagedPageFailsTheCall) {
  const std::string file_path = sceneFile(kSeed), damaged = path("damaged.sft");
  std::filesystem::copy_file(file_path, damaged);
  {
    std::fstream file(damaged, std::ios::binary | std::ios::in | std::ios::out);
    for (int i = 0; i < 4000; ++i) {  // within the pages, after the header
      file.seekp(600 + i);
      file.put(char(i));
    }
  }
  Engine engine = makeEngine();
  const Result<Scene> scene = engine.open(damaged);
  ASSERT_TRUE(scene.ok()) << scene.status().message();
  Gatherer gatherer = valueOrFail(engine.gatherer(*scene, bleedingSettings()));
  const std::vector<Receiver> receivers = receiversOfSeed(kSeed, 64);
  std::vector<GatherResult> results(receivers.size());
  const Status status = gatherer.gather(receivers.data(), receivers.size(), results.data());
  EXPECT_EQ(status.code(), StatusCode::kCorruption);
  EXPECT_THAT(status.message(), HasSubstr("damaged.sft"));
  Gatherer sound =
      valueOrFail(engine.gatherer(valueOrFail(engine.open(file_path)), bleedingSettings()));
  gatherAt(sound, receivers);
}

}  // namespace
}  // namespace surfeit
