#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <atomic>
#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <limits>
#include <mutex>
#include <numeric>
#include <random>
#include <string>
#include <vector>

#include "gather/test_clouds.h"
#include "surfeit/bake.h"
#include "surfeit/bounce.h"
#include "surfeit/progress.h"

namespace surfeit {
namespace {

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();

// Coarse, so that the tests are fast.
GatherOptions fastOptions(int threads = 1, std::uint64_t memory_bytes = 256 << 20) {
  GatherOptions options;
  options.quality.max_solid_angle = 0.3f;
  options.quality.raster_resolution = 4;
  options.threads = threads;
  options.memory_bytes = memory_bytes;
  return options;
}

// Counts what it is told of a phase, and cancels once so much is done in all phases together.
class TestProgress : public Progress {
 public:
  explicit TestProgress(std::uint64_t cancel_at = ~std::uint64_t{0}) : cancel_at_(cancel_at) {}

  void beginPhase(std::string_view, std::uint64_t total, std::string_view) override {
    total_ = total;
    done_ = 0;
  }
  void advance(std::uint64_t count) override {
    done_ += count;
    done_in_all_ += count;
  }
  void note(const std::string& message) override {
    const std::lock_guard lock(mutex_);
    notes_.push_back(message);
  }
  bool isCancelled() const override { return done_in_all_ >= cancel_at_; }

  std::uint64_t total() const { return total_; }
  std::uint64_t done() const { return done_; }
  // How many notes hold the text.
  std::ptrdiff_t notesWith(const std::string& text) const {
    return std::count_if(notes_.begin(), notes_.end(), [&text](const std::string& note) {
      return note.find(text) != std::string::npos;
    });
  }

 private:
  const std::uint64_t cancel_at_;
  std::atomic<std::uint64_t> total_{0}, done_{0}, done_in_all_{0};
  std::mutex mutex_;
  std::vector<std::string> notes_;
};

// The least budget that works, by the word of the message that refuses a smaller one.
std::uint64_t leastBudgetNamed(const Status& refused) {
  EXPECT_EQ(refused.code(), StatusCode::kBudgetTooSmall);
  const std::string& message = refused.message();
  const std::size_t end = message.find(" MiB is the least that works");
  EXPECT_NE(end, std::string::npos) << message;
  if (end == std::string::npos) return 0;
  const std::size_t begin = message.rfind(' ', end - 1) + 1;
  return static_cast<std::uint64_t>(std::stod(message.substr(begin)) * (1 << 20)) + 1;
}

// A scene of 3,200 surfels in its own directory, and gathers there.
class GatherCloud : public testing::Test {
 protected:
  void SetUp() override { makeScene(floorAndSphere(40), scene_); }

  Result<GatherStats> gather(const std::string& receivers, const std::string& result,
                             const GatherOptions& options) {
    return gatherCloud(scene_, directory_.file(receivers), directory_.file(result), options,
                       progress_);
  }
  // Expects success, and returns the result.
  Table gatherTable(const std::string& receivers, const GatherOptions& options) {
    const auto stats = gather(receivers, "result.ply", options);
    EXPECT_TRUE(stats.ok()) << stats.status().message();
    return stats.ok() ? readTable(directory_.file("result.ply")) : Table();
  }
  std::string gatherBytes(const std::string& receivers, const GatherOptions& options) {
    const auto stats = gather(receivers, "result.ply", options);
    EXPECT_TRUE(stats.ok()) << stats.status().message();
    return stats.ok() ? readBytes(directory_.file("result.ply")) : "";
  }
  std::uint64_t leastBudget(const std::string& receivers, int threads,
                            GatherMode mode = GatherMode::kOcclusion) {
    GatherOptions options = fastOptions(threads, 1);
    options.mode = mode;
    return leastBudgetNamed(gather(receivers, "refused.ply", options).status());
  }

  TestDirectory directory_;
  const std::string scene_ = directory_.file("scene.sft");
  TestProgress progress_;
};

TEST_F(GatherCloud, ThreadsAndBudgetDoNotChangeTheResult) {
  // Small budgets sort on disk, large ones in memory
  writeTable(receiversOf(120000), directory_.file("receivers.ply"));
  const std::string expected = gatherBytes("receivers.ply", fastOptions(1));
  ASSERT_FALSE(expected.empty());
  for (const int threads : {2, 5}) {
    const std::uint64_t least = leastBudget("receivers.ply", threads);
    for (const std::uint64_t budget : {least, least * 2}) {
      EXPECT_TRUE(gatherBytes("receivers.ply", fastOptions(threads, budget)) == expected)
          << threads << " threads, " << budget << " bytes";
    }
  }
}

TEST_F(GatherCloud, BleedingDoesNotDependOnThreadsEither) {
  writeTable(receiversOf(2000), directory_.file("receivers.ply"));
  GatherOptions options = fastOptions(1);
  options.mode = GatherMode::kBleeding;
  const std::string expected = gatherBytes("receivers.ply", options);
  options.threads = 3;
  options.memory_bytes = leastBudget("receivers.ply", 3, options.mode);
  EXPECT_TRUE(gatherBytes("receivers.ply", options) == expected);

  const Table result = readTable(directory_.file("result.ply"));
  for (const char* name : {"occlusion", "irradiance_r", "irradiance_g", "irradiance_b"}) {
    const std::vector<double> values = result.column(name);
    ASSERT_EQ(values.size(), 2000u) << name;
    EXPECT_TRUE(std::all_of(values.begin(), values.end(), [](double v) { return v >= 0; })) << name;
    EXPECT_GT(*std::max_element(values.begin(), values.end()), 0) << name;
  }
}

TEST_F(GatherCloud, ShuffledReceiversGiveShuffledResults) {
  Table receivers = receiversOf(1000);
  writeTable(receivers, directory_.file("receivers.ply"));
  Table expected = gatherTable("receivers.ply", fastOptions(2));
  ASSERT_EQ(expected.rows.size(), 1000u);

  std::vector<std::size_t> order(1000);
  std::iota(order.begin(), order.end(), std::size_t{0});
  std::shuffle(order.begin(), order.end(), std::mt19937(7));
  Table shuffled = receivers;
  for (std::size_t i = 0; i < 1000; ++i) shuffled.rows[i] = receivers.rows[order[i]];
  writeTable(shuffled, directory_.file("shuffled.ply"));
  const Table result = gatherTable("shuffled.ply", fastOptions(2));
  ASSERT_EQ(result.rows.size(), 1000u);
  for (std::size_t i = 0; i < 1000; ++i) EXPECT_EQ(result.rows[i], expected.rows[order[i]]);
}

TEST_F(GatherCloud, OrderAndPropertiesAreKept) {
  Table receivers = receiversOf(500);
  receivers.addProperty("red", ValueType::kUint8);
  receivers.addProperty("time", ValueType::kFloat64);
  receivers.addProperty("class", ValueType::kInt16);
  receivers.addProperty("radius");  // zero: no concern of a receiver
  for (std::vector<double>& row : receivers.rows) {
    row.insert(row.end(), {double(row.size() % 256), 1e10 + row[6] / 3, -row[6], 0});
  }
  // float columns hold floats
  for (std::vector<double>& row : receivers.rows) {
    for (std::size_t i = 0; i < 6; ++i) row[i] = double(float(row[i]));
  }

  std::string expected;
  for (const PlyEncoding encoding :
       {PlyEncoding::kBinaryLittleEndian, PlyEncoding::kBinaryBigEndian, PlyEncoding::kAscii}) {
    writeTable(receivers, directory_.file("receivers.ply"), encoding);
    const Table result = gatherTable("receivers.ply", fastOptions());
    std::vector<std::string> names = receivers.names();
    names.push_back("occlusion");
    ASSERT_EQ(result.names(), names);
    ASSERT_EQ(result.rows.size(), 500u);
    for (std::size_t i = 0; i < 500; ++i) {
      std::vector<double> kept = result.rows[i];
      kept.pop_back();
      ASSERT_EQ(kept, receivers.rows[i]) << "row " << i;
    }
    for (std::size_t i = 0; i < receivers.properties.size(); ++i) {
      EXPECT_EQ(result.properties[i].type, receivers.properties[i].type);
    }
    EXPECT_EQ(result.properties.back().type, ValueType::kFloat32);

    const std::string bytes = readBytes(directory_.file("result.ply"));
    if (expected.empty()) expected = bytes;
    EXPECT_TRUE(bytes == expected) << "encoding " << int(encoding);
  }
}

TEST_F(GatherCloud, EarlierResultsAreReplacedWhereTheyStand) {
  Table receivers;
  receivers.addProperty("occlusion", ValueType::kUint8);
  receivers.addProperty("irradiance_r", ValueType::kFloat64);
  const Table plain = receiversOf(100);
  for (const RowProperty& property : plain.properties) {
    receivers.addProperty(property.name, property.type);
  }
  for (const std::vector<double>& row : plain.rows) {
    receivers.rows.push_back({77, 88});
    receivers.rows.back().insert(receivers.rows.back().end(), row.begin(), row.end());
  }
  writeTable(plain, directory_.file("plain.ply"));
  writeTable(receivers, directory_.file("receivers.ply"));

  // Irradiance is a result of bleeding, and a property like any other of occlusion
  GatherOptions options = fastOptions();
  const Table occlusion = gatherTable("receivers.ply", options);
  EXPECT_EQ(occlusion.names(), receivers.names());
  EXPECT_EQ(occlusion.properties[0].type, ValueType::kFloat32);
  EXPECT_EQ(occlusion.properties[1].type, ValueType::kFloat64);
  EXPECT_EQ(occlusion.column("irradiance_r"), std::vector<double>(100, 88));
  EXPECT_EQ(occlusion.column("occlusion"), gatherTable("plain.ply", options).column("occlusion"));

  options.mode = GatherMode::kBleeding;
  const Table bleeding = gatherTable("receivers.ply", options);
  std::vector<std::string> names = receivers.names();
  names.insert(names.end(), {"irradiance_g", "irradiance_b"});
  EXPECT_EQ(bleeding.names(), names);
  EXPECT_EQ(bleeding.properties[1].type, ValueType::kFloat32);
  const Table expected = gatherTable("plain.ply", options);
  for (const char* name : {"irradiance_r", "irradiance_g", "irradiance_b", "id", "nz"}) {
    EXPECT_EQ(bleeding.column(name), expected.column(name)) << name;
  }
}

TEST_F(GatherCloud, ResultMayReplaceTheReceiversButNotTheScene) {
  writeTable(receiversOf(100), directory_.file("receivers.ply"));
  ASSERT_TRUE(gather("receivers.ply", "receivers.ply", fastOptions()).ok());
  EXPECT_EQ(readTable(directory_.file("receivers.ply")).column("occlusion").size(), 100u);
  EXPECT_EQ(gather("receivers.ply", "scene.sft", fastOptions()).status().code(),
            StatusCode::kInvalidArgument);
}

TEST_F(GatherCloud, InvalidReceiversGetNan) {
  Table receivers = receiversOf(200);
  receivers.rows[17][0] = kNan;
  receivers.rows[18][2] = std::numeric_limits<double>::infinity();
  receivers.rows[50][4] = kNan;
  receivers.rows[199] = {0, 0, 0, 0, 0, 1e-9, 199};  // a normal too short to point
  receivers.rows[60] = {0, 0, 0.1, 0, 0, 0, 60};     // none: the whole sphere
  writeTable(receivers, directory_.file("receivers.ply"));

  const auto stats = gather("receivers.ply", "result.ply", fastOptions(2));
  ASSERT_TRUE(stats.ok()) << stats.status().message();
  EXPECT_EQ(stats->receivers, 200u);
  EXPECT_EQ(stats->invalid_receivers, 4u);
  EXPECT_EQ(progress_.notesWith("NaN"), 1);
  EXPECT_EQ(progress_.notesWith("record 17"), 1);
  EXPECT_EQ(progress_.done(), progress_.total());
  const std::vector<double> occlusion =
      readTable(directory_.file("result.ply")).column("occlusion");
  for (const int i : {17, 18, 50, 199}) EXPECT_TRUE(std::isnan(occlusion[std::size_t(i)])) << i;
  EXPECT_EQ(std::count_if(occlusion.begin(), occlusion.end(), [](double v) { return v >= 0; }),
            196);

  GatherOptions strict = fastOptions(2);
  strict.strict = true;
  const auto refused = gather("receivers.ply", "strict.ply", strict);
  EXPECT_EQ(refused.status().code(), StatusCode::kCorruption);
  EXPECT_NE(refused.status().message().find("record 17"), std::string::npos)
      << refused.status().message();
  EXPECT_TRUE(directory_.holdsOnly({"scene.sft", "receivers.ply", "result.ply"}));
}

TEST_F(GatherCloud, ReceiversWithoutNormalsGatherOverTheSphere) {
  Table receivers;
  for (const char* name : {"x", "y", "z"}) receivers.addProperty(name);
  receivers.rows = {{0, 0, 1}, {100, 0, 0}};
  writeTable(receivers, directory_.file("receivers.ply"));
  const std::vector<double> occlusion =
      gatherTable("receivers.ply", fastOptions()).column("occlusion");
  EXPECT_EQ(progress_.notesWith("normals"), 1);
  ASSERT_EQ(occlusion.size(), 2u);
  EXPECT_GE(occlusion[0], 0);
  EXPECT_NEAR(occlusion[1], 0, 1e-3);
}

TEST_F(GatherCloud, MeshesServeAsReceivers) {
  writeBytes(directory_.file("mesh.ply"),
             "ply\nformat ascii 1.0\nelement info 1\nproperty int version\n"
             "element vertex 3\nproperty float x\nproperty float y\nproperty float z\n"
             "property list uchar int uses\n"
             "element face 1\nproperty list uchar int vertex_indices\nend_header\n"
             "7\n0 0 0 1 5\n1 0 0 2 5 6\n0 1 0 0\n3 0 1 2\n");
  const Table result = gatherTable("mesh.ply", fastOptions());
  EXPECT_EQ(result.names(), (std::vector<std::string>{"x", "y", "z", "occlusion"}));
  EXPECT_EQ(result.column("x"), (std::vector<double>{0, 1, 0}));
  EXPECT_EQ(progress_.notesWith("not kept"), 3);
}

TEST_F(GatherCloud, NoReceiversGiveAnEmptyResult) {
  writeTable(receiversOf(0), directory_.file("receivers.ply"));
  const Table result = gatherTable("receivers.ply", fastOptions(2));
  EXPECT_EQ(result.rows.size(), 0u);
  EXPECT_EQ(result.names().back(), "occlusion");
}

TEST_F(GatherCloud, TooSmallABudgetNamesTheLeastThatWorks) {
  writeTable(receiversOf(300), directory_.file("receivers.ply"));
  for (const int threads : {1, 4, 16}) {
    const std::uint64_t least = leastBudget("receivers.ply", threads);
    // The figure is rounded up to a tenth of a mebibyte
    const auto refused = gather("receivers.ply", "result.ply",
                                fastOptions(threads, least - (std::uint64_t{1} << 20) / 8));
    EXPECT_EQ(refused.status().code(), StatusCode::kBudgetTooSmall);
    EXPECT_NE(refused.status().message().find("scene.sft"), std::string::npos);
    EXPECT_TRUE(directory_.holdsOnly({"scene.sft", "receivers.ply"}));
    EXPECT_TRUE(gather("receivers.ply", "result.ply", fastOptions(threads, least)).ok());
    std::filesystem::remove(directory_.file("result.ply"));
  }
}

TEST_F(GatherCloud, StatsAddUp) {
  writeTable(receiversOf(2000), directory_.file("receivers.ply"));
  const std::uint64_t least = leastBudget("receivers.ply", 2);
  for (const std::uint64_t budget : {least, std::uint64_t{256} << 20}) {
    const auto stats = gather("receivers.ply", "result.ply", fastOptions(2, budget));
    ASSERT_TRUE(stats.ok());
    EXPECT_EQ(stats->receivers, 2000u);
    EXPECT_EQ(stats->invalid_receivers, 0u);
    EXPECT_EQ(stats->threads, 2);
    EXPECT_EQ(stats->memory_bytes, budget);
    EXPECT_GT(stats->gather_seconds, 0);
    for (const GatherCacheStats* cache : {&stats->node_cache, &stats->surfel_cache}) {
      EXPECT_GT(cache->requests, 0u);
      EXPECT_EQ(cache->hits + cache->misses, cache->requests);
      EXPECT_LE(cache->peak_bytes, cache->budget_bytes);
      EXPECT_GT(cache->bytes_read, 0u);
      if (cache->budget_bytes >= cache->decoded_bytes) {
        EXPECT_EQ(cache->evictions, 0u);
      }
    }
  }
}

TEST_F(GatherCloud, ProgressReachesItsTotal) {
  writeTable(receiversOf(1000), directory_.file("receivers.ply"));
  ASSERT_TRUE(gather("receivers.ply", "result.ply", fastOptions(2)).ok());
  EXPECT_EQ(progress_.total(), 1000u);
  EXPECT_EQ(progress_.done(), 1000u);
}

TEST_F(GatherCloud, CancellingLeavesNothing) {
  writeTable(receiversOf(1000), directory_.file("receivers.ply"));
  for (const std::uint64_t cancel_at : {0, 1, 300, 999, 1000, 1700, 2000}) {
    for (const int threads : {1, 3}) {
      TestProgress progress(cancel_at);
      const auto stats = gatherCloud(scene_, directory_.file("receivers.ply"),
                                     directory_.file("result.ply"), fastOptions(threads), progress);
      EXPECT_EQ(stats.status().code(), StatusCode::kInterrupted) << cancel_at;
      EXPECT_TRUE(directory_.holdsOnly({"scene.sft", "receivers.ply"}));
    }
  }
}

TEST_F(GatherCloud, OptionsThatCannotWorkAreRefused) {
  writeTable(receiversOf(10), directory_.file("receivers.ply"));
  const auto refused = [this](auto change) {
    GatherOptions options = fastOptions();
    change(options);
    const auto stats = gather("receivers.ply", "result.ply", options);
    return stats.status().code() == StatusCode::kInvalidArgument &&
           directory_.holdsOnly({"scene.sft", "receivers.ply"});
  };
  const float nan = static_cast<float>(kNan);
  EXPECT_TRUE(refused([](auto& o) { o.quality.max_solid_angle = -0.1f; }));
  EXPECT_TRUE(refused([&](auto& o) { o.quality.max_solid_angle = nan; }));
  EXPECT_TRUE(refused([](auto& o) { o.quality.raster_resolution = 0; }));
  EXPECT_TRUE(refused([](auto& o) { o.quality.raster_resolution = 7; }));
  EXPECT_TRUE(refused([](auto& o) { o.quality.raster_resolution = 66; }));
  EXPECT_TRUE(refused([](auto& o) { o.quality.bias = -1; }));
  EXPECT_TRUE(refused([&](auto& o) { o.quality.near_field_radii = nan; }));
  EXPECT_TRUE(refused([](auto& o) { o.quality.max_distance = 0; }));
  EXPECT_TRUE(refused([](auto& o) { o.threads = -1; }));
  EXPECT_TRUE(refused([](auto& o) { o.threads = 1 << 20; }));
}

TEST_F(GatherCloud, InputThatCannotBeReadIsRefused) {
  writeTable(receiversOf(10), directory_.file("receivers.ply"));
  const auto code = [this](const std::string& scene, const std::string& receivers,
                           const std::string& result) {
    return gatherCloud(directory_.file(scene), directory_.file(receivers), directory_.file(result),
                       fastOptions(), progress_)
        .status()
        .code();
  };
  EXPECT_EQ(code("none.sft", "receivers.ply", "result.ply"), StatusCode::kIoError);
  EXPECT_EQ(code("scene.sft", "none.ply", "result.ply"), StatusCode::kIoError);
  EXPECT_EQ(code("scene.sft", "receivers.ply", "none/result.ply"), StatusCode::kIoError);
  EXPECT_EQ(code("receivers.ply", "receivers.ply", "result.ply"), StatusCode::kCorruption);
  EXPECT_EQ(code("scene.sft", "scene.sft", "result.ply"), StatusCode::kCorruption);
  Table flat;
  flat.addProperty("x");
  flat.rows = {{1}};
  writeTable(flat, directory_.file("flat.ply"));
  EXPECT_EQ(code("scene.sft", "flat.ply", "result.ply"), StatusCode::kCorruption);
  EXPECT_TRUE(directory_.holdsOnly({"scene.sft", "receivers.ply", "flat.ply"}));
}

TEST_F(GatherCloud, DamagedPagesAreCorruptionAndNoResult) {
  writeTable(receiversOf(200), directory_.file("receivers.ply"));
  GatherOptions options = fastOptions(2);
  options.quality.max_solid_angle = 0;  // opens every node, and so reads every page
  const std::string bytes = readBytes(scene_);
  for (int i = 0; i < 40; ++i) {
    std::string damaged = bytes;
    damaged[bytes.size() * std::size_t(i) / 40 + 11] ^= 0x10;
    writeBytes(scene_, damaged);
    const auto stats = gather("receivers.ply", "result.ply", options);
    ASSERT_FALSE(stats.ok()) << "byte " << bytes.size() * std::size_t(i) / 40 + 11;
    EXPECT_EQ(stats.status().code(), StatusCode::kCorruption) << stats.status().message();
    EXPECT_TRUE(directory_.holdsOnly({"scene.sft", "receivers.ply"}));
  }
}

TEST(GatherCloudOutOfCore, CacheOfATenthOfTheSceneGivesTheSameResult) {
  TestDirectory directory;
  const std::string scene = directory.file("scene.sft");
  makeScene(floorAndSphere(300), scene);
  writeTable(receiversOf(3000), directory.file("receivers.ply"));
  const auto gather = [&](const std::string& result, std::uint64_t memory_bytes) {
    Progress progress;
    GatherOptions options = fastOptions(2, memory_bytes);
    options.quality.max_solid_angle = 0.05f;
    return gatherCloud(scene, directory.file("receivers.ply"), directory.file(result), options,
                       progress);
  };
  const auto in_core = gather("in_core.ply", std::uint64_t{1} << 30);
  ASSERT_TRUE(in_core.ok()) << in_core.status().message();
  EXPECT_EQ(in_core->node_cache.evictions + in_core->surfel_cache.evictions, 0u);

  const std::uint64_t least = leastBudgetNamed(gather("refused.ply", 1).status());
  const auto out_of_core = gather("out_of_core.ply", least);
  ASSERT_TRUE(out_of_core.ok()) << out_of_core.status().message();
  const GatherCacheStats& nodes = out_of_core->node_cache;
  const GatherCacheStats& surfels = out_of_core->surfel_cache;
  EXPECT_LE(10 * (nodes.budget_bytes + surfels.budget_bytes),
            nodes.decoded_bytes + surfels.decoded_bytes);
  EXPECT_GT(nodes.evictions + surfels.evictions, 0u);
  EXPECT_TRUE(readBytes(directory.file("out_of_core.ply")) ==
              readBytes(directory.file("in_core.ply")));
}

// By its name, by a symbolic link and by another name of the same file.
TEST_F(GatherCloud, AResultThatIsTheSceneIsRefusedByAnyName) {
  writeTable(receiversOf(10), directory_.file("receivers.ply"));
  const std::string scene = directory_.file("scene.sft"), before = readBytes(scene);
  std::filesystem::create_symlink(scene, directory_.file("link.ply"));
  std::filesystem::create_hard_link(scene, directory_.file("again.ply"));
  for (const char* name : {"scene.sft", "link.ply", "again.ply"}) {
    const Status gathered = gatherCloud(scene, directory_.file("receivers.ply"),
                                        directory_.file(name), fastOptions(), progress_)
                                .status();
    EXPECT_EQ(gathered.code(), StatusCode::kInvalidArgument) << name;
    EXPECT_THAT(gathered.message(), testing::HasSubstr("would replace the scene")) << name;
    const Status bounced = bounceScene(scene, directory_.file(name), {}, progress_).status();
    EXPECT_THAT(bounced.message(), testing::HasSubstr("would replace the scene")) << name;
    EXPECT_TRUE(readBytes(scene) == before) << name;
  }
}

}  // namespace
}  // namespace surfeit
