// The files in tests/golden stay readable, with the same contents, in every version to come. Set
// SURFEIT_UPDATE_GOLDEN=1 to write those of the present version anew: only while it has never been
// released.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <xxhash.h>
#include <zstd.h>

#include <cmath>
#include <cstddef>
#include <cstdlib>
#include <ostream>
#include <vector>

#include "octree/relight/radiosity_rewriter.h"
#include "octree/test_scenes.h"
#include "surfeit/version.h"

namespace surfeit {
namespace {

// A file, and hashes of what it decodes to.
struct Golden {
  const char* name;
  std::uint64_t surfel_hash, node_hash;
  bool has_groups, has_long_sides;
  std::uint32_t format_version = 2;
  bool has_tints = false;

  bool hasOpacity() const { return format_version == 3; }
  bool isPresent() const { return format_version > 1; }

  std::string path() const { return SURFEIT_TEST_SOURCE_DIR "/golden/" + std::string(name); }
  CloudChannels channels() const {
    CloudChannels channels = has_groups       ? kAllAndGroups
                             : has_long_sides ? kAllAndLongSides
                                              : kAllChannels;
    channels.opacity = hasOpacity();
    channels.tint = has_tints;
    return channels;
  }
  // For the names of the tests
  friend void PrintTo(const Golden& golden, std::ostream* out) { *out << golden.name; }
};
constexpr Golden kGoldens[] = {
    {"v1.sft", 12531938469041694647ull, 8557694847862354260ull, false, false, 1},
    {"v1_groups.sft", 12687918996693723113ull, 11431106272069044126ull, true, false, 1},
    {"v1_long_sides.sft", 16580172462110769372ull, 8557694847862354260ull, false, true, 1},
    {"v2.sft", 2005979540908680786ull, 10624684729359895245ull, false, false},
    {"v2_groups.sft", 8158081773073750635ull, 13900325422591587072ull, true, false},
    {"v2_long_sides.sft", 12405799463880451937ull, 8405447011785197977ull, false, true},
    {"v3_opacity.sft", 18046126813334765326ull, 14085505218838001281ull, false, false, 3},
    {"v3_tints.sft", 12002545482371922998ull, 5986286155895842687ull, false, false, 3, true},
};
// The zstd that compressed them: another one may store the same payloads in other bytes.
constexpr unsigned kZstdVersion = 10504;

// Surfels of all kinds by operations that IEEE 754 defines to the last bit.
std::vector<Surfel> goldenCloud(const Golden& golden) {
  std::vector<Surfel> cloud;
  for (int i = 0; i < 300; ++i) {
    const float t = float(i) / 300;
    Surfel surfel;
    surfel.position = {t, t * t, float(i * 37 % 300) / 300};
    glm::vec3 normal(0.5f - t, 1, t);
    surfel.normal = normal / std::sqrt(glm::dot(normal, normal));
    surfel.radius = 0.01f + 0.05f * t;
    surfel.area = 2 * surfel.radius * surfel.radius;
    surfel.radiosity = {t, 1 - t, 100 * t * t};
    surfel.albedo = {0.5f, t, 1};
    if (i % 10 == 3) surfel.flags = kSurfelTwoSided;
    if (i % 10 == 7) {
      surfel.flags = kSurfelSphere;
      surfel.normal = glm::vec3(0);
    }
    if (golden.hasOpacity()) surfel.transparency = static_cast<std::uint16_t>(i * 211);
    if (golden.has_tints) surfel.tint = {std::uint16_t(i * 7), std::uint16_t(-i * 200)};
    if (golden.has_groups) surfel.group = static_cast<std::uint8_t>(i / 50 * 11);
    cloud.push_back(surfel);
  }
  return golden.has_long_sides ? withLongSides(cloud) : cloud;
}

// The fields before the facets; version 1 has no cone of normals and no slab.
std::string fieldsOf(const Node& node, std::uint32_t format_version) {
  const char* const bytes = reinterpret_cast<const char*>(&node);
  const std::size_t end =
      format_version >= 2 ? offsetof(Node, area) : offsetof(Node, normal_cosine);
  return std::string(bytes, end) +
         std::string(bytes + offsetof(Node, area), bytes + offsetof(Node, facet_count));
}

// What there was before tints, then these.
std::uint64_t hashOf(const std::vector<Surfel>& surfels, const Golden& golden) {
  std::string bytes;
  for (const Surfel& surfel : surfels) {
    const std::size_t end = golden.has_tints ? sizeof surfel : offsetof(Surfel, tint);
    bytes.append(reinterpret_cast<const char*>(&surfel), end);
    EXPECT_EQ(surfel.isTinted() && !golden.has_tints, false);
  }
  return XXH3_64bits(bytes.data(), bytes.size());
}

class GoldenTest : public SceneTest, public testing::WithParamInterface<Golden> {};

TEST_P(GoldenTest, DecodesToTheSameContents) {
  const Golden& golden = GetParam();
  const char* update = std::getenv("SURFEIT_UPDATE_GOLDEN");
  if (update != nullptr && std::string(update) == "1" && golden.isPresent()) {
    writeBytes(golden.path(), bytesOf(index(goldenCloud(golden), golden.channels())));
  }
  EXPECT_THAT(findingsOf(golden.path()), testing::IsEmpty());
  const Result<ReadScene> scene = readScene(golden.path());
  ASSERT_TRUE(scene.ok()) << scene.status().message();
  ASSERT_EQ(scene->surfels.size(), 300u);
  EXPECT_EQ(scene->header.format_version, golden.format_version);
  EXPECT_EQ(scene->header.channels.group, golden.has_groups);
  EXPECT_EQ(scene->header.channels.opacity, golden.hasOpacity());
  EXPECT_EQ(scene->header.channels.tint, golden.has_tints);
  EXPECT_EQ(scene->header.channels.long_side, golden.has_long_sides);
  std::uint64_t node_hash = 0;
  for (const auto& [node, first] : scene->nodes) {
    const auto add = [&](const void* values, std::size_t bytes) {
      node_hash = XXH3_64bits_withSeed(values, bytes, node_hash);
    };
    const std::string fields = fieldsOf(node, golden.format_version);
    add(fields.data(), fields.size());
    for (std::size_t k = 0; k < node.facet_count; ++k) {
      const Facet facet = node.facet(k);
      add(&facet, offsetof(Facet, is_two_sided));  // those are flags of the node
      if (golden.hasOpacity()) add(&facet.opacity.r, sizeof facet.opacity.r);
      if (golden.has_tints) add(&facet.opacity.g, 2 * sizeof facet.opacity.g);
    }
    if (!node.hasFacets()) add(&node.rough, sizeof node.rough);
    if (golden.hasOpacity()) add(&node.transparency, sizeof node.transparency);
    if (golden.has_tints) add(&node.tint, sizeof node.tint);
    EXPECT_TRUE(golden.has_groups || node.groups == groupBit(0));
    if (golden.format_version == 1) {
      EXPECT_EQ(node.thickness, node.radius);
      EXPECT_EQ(node.normal_cosine, -1);
    }
  }
  EXPECT_EQ(hashOf(scene->surfels, golden), golden.surfel_hash);
  EXPECT_EQ(node_hash, golden.node_hash);
}

TEST_P(GoldenTest, IndexingWritesTheSameFile) {
  const Golden& golden = GetParam();
  if (!golden.isPresent()) GTEST_SKIP() << "nothing writes this version any more";
  const std::string scene = index(goldenCloud(golden), golden.channels());
  if (ZSTD_versionNumber() != kZstdVersion) {
    GTEST_SKIP() << "zstd " << ZSTD_versionNumber() << " may compress otherwise than "
                 << kZstdVersion;
  }
  EXPECT_TRUE(bytesOf(scene) == bytesOf(golden.path()));
}

// Lobes by the number of the surfel; radiosities stay.
class NumberedLobes : public RadiositySource {
 public:
  explicit NumberedLobes(const SceneFile& scene) : scene_(scene) {}
  Status read(std::uint32_t page, std::span<glm::vec3> radiosity) override {
    SceneFile::Scratch scratch;
    std::vector<Surfel> surfels(scene_.header().surfel_group_capacity);
    SURFEIT_RETURN_IF_ERROR(scene_.decodeSurfels(page, scratch, surfels).status());
    for (std::size_t i = 0; i < radiosity.size(); ++i) radiosity[i] = surfels[i].radiosity;
    return {};
  }
  Status read(std::uint32_t page, std::span<glm::vec3> radiosity, std::span<Lobe> lobes) override {
    for (std::size_t i = 0; i < lobes.size(); ++i) {
      const int n = int(page) * 512 + int(i);
      lobes[i].share = {std::uint8_t(n), std::uint8_t(7 * n), std::uint8_t(255 - n % 256)};
      lobes[i].mean = {std::int16_t(n * 97 % 18000), std::int16_t(n * 31 % 18000),
                       std::int16_t(-(n * 53 % 18000))};
    }
    return read(page, radiosity);
  }
  bool hasLobes() const override { return true; }

 private:
  const SceneFile& scene_;
};

class GoldenLobes : public SceneTest {
 protected:
  static std::string golden() { return SURFEIT_TEST_SOURCE_DIR "/golden/v4_lobes.sft"; }

  // Without spheres, which make nodes rough: those have no lobes.
  void write(const std::string& result) {
    std::vector<Surfel> cloud = goldenCloud(kGoldens[3]);
    std::erase_if(cloud, [](const Surfel& surfel) { return surfel.isSphere(); });
    const Result<SceneFile> scene = SceneFile::open(index(cloud, kAllChannels));
    ASSERT_TRUE(scene.ok()) << scene.status().message();
    NumberedLobes lobes(*scene);
    Result<PageFileWriter> writer =
        PageFileWriter::create(result, 4711, rewrittenVersion(*scene, true));
    ASSERT_TRUE(writer.ok());
    ASSERT_TRUE(rewriteRadiosity(*scene, lobes, *writer, 1, progress_).ok());
    ASSERT_TRUE(writer->finish(rewrittenSceneFields(*scene, true), "{}").ok());
  }
};

TEST_F(GoldenLobes, DecodeToTheSameContents) {
  const char* update = std::getenv("SURFEIT_UPDATE_GOLDEN");
  if (update != nullptr && std::string(update) == "1") write(golden());
  EXPECT_THAT(findingsOf(golden()), testing::IsEmpty());
  const Result<SceneFile> scene = SceneFile::open(golden());
  ASSERT_TRUE(scene.ok()) << scene.status().message();
  EXPECT_EQ(scene->header().format_version, 4u);
  EXPECT_TRUE(scene->header().has_lobes);
  SceneFile::Scratch scratch;
  std::uint64_t surfel_hash = 0, node_hash = 0;
  std::vector<Surfel> surfels(scene->header().surfel_group_capacity);
  std::vector<Lobe> lobes(surfels.size());
  for (std::uint32_t page = 0; page < scene->surfelPageCount(); ++page) {
    const auto count = scene->decodeSurfels(page, scratch, surfels, lobes);
    ASSERT_TRUE(count.ok()) << count.status().message();
    surfel_hash = XXH3_64bits_withSeed(lobes.data(), *count * sizeof(Lobe), surfel_hash);
  }
  std::vector<Node> nodes(scene->header().node_group_capacity);
  std::vector<NodeLobes> node_lobes(nodes.size());
  for (std::uint32_t page = 0; page < scene->nodePageCount(); ++page) {
    const auto count = scene->decodeNodes(page, scratch, nodes, node_lobes);
    ASSERT_TRUE(count.ok()) << count.status().message();
    node_hash = XXH3_64bits_withSeed(node_lobes.data(), *count * sizeof(NodeLobes), node_hash);
  }
  EXPECT_EQ(surfel_hash, 11905100813347156094ull);
  EXPECT_EQ(node_hash, 4515592917352379084ull);
}

TEST_F(GoldenLobes, RewritingGivesTheSameFile) {
  write(path("lobes.sft"));
  if (ZSTD_versionNumber() != kZstdVersion) {
    GTEST_SKIP() << "zstd " << ZSTD_versionNumber() << " may compress otherwise than "
                 << kZstdVersion;
  }
  EXPECT_TRUE(bytesOf(path("lobes.sft")) == bytesOf(golden()));
}

INSTANTIATE_TEST_SUITE_P(Files, GoldenTest, testing::ValuesIn(kGoldens), [](const auto& golden) {
  const std::string name = golden.param.name;
  return name.substr(0, name.find('.'));
});

}  // namespace
}  // namespace surfeit
