#include "octree/relight/radiosity_rewriter.h"

#include <gtest/gtest.h>

#include <cstring>
#include <functional>

#include "core/parallel.h"
#include "octree/node/node_sums.h"
#include "octree/test_scenes.h"
#include "storage/page_codec.h"

namespace surfeit {
namespace {

// New radiosities as a function of the surfel.
using Light = std::function<glm::vec3(const Surfel&)>;

glm::vec3 wavesOfLight(const Surfel& surfel) {
  return glm::vec3(.6f) + .5f * glm::vec3(std::sin(9 * surfel.position.x),
                                          std::cos(7 * surfel.position.y),
                                          std::sin(5 * surfel.position.z));
}
glm::vec3 otherLight(const Surfel& surfel) { return 20.f * surfel.position * surfel.position; }
glm::vec3 darkness(const Surfel&) { return glm::vec3(0); }

class LightSource : public RadiositySource {
 public:
  LightSource(const SceneFile& scene, Light light) : scene_(scene), light_(std::move(light)) {}
  using RadiositySource::read;
  Status read(std::uint32_t page, std::span<glm::vec3> radiosity) override {
    SceneFile::Scratch scratch;
    std::vector<Surfel> surfels(scene_.header().surfel_group_capacity);
    SURFEIT_ASSIGN_OR_RETURN(const std::uint32_t count,
                             scene_.decodeSurfels(page, scratch, surfels));
    EXPECT_EQ(count, radiosity.size());
    for (std::size_t i = 0; i < radiosity.size(); ++i) radiosity[i] = light_(surfels[i]);
    return {};
  }

 private:
  const SceneFile& scene_;
  const Light light_;
};

class RadiosityRewriterTest : public SceneTest {
 protected:
  static constexpr std::uint64_t kIdentity = 4711;

  Result<glm::dvec3> tryRewrite(const std::string& from, const std::string& to, const Light& light,
                                int threads = 2) {
    SURFEIT_ASSIGN_OR_RETURN(const SceneFile scene, SceneFile::open(from));
    LightSource source(scene, light);
    SURFEIT_ASSIGN_OR_RETURN(PageFileWriter writer,
                             PageFileWriter::create(to, kIdentity, scene.header().format_version));
    Result<glm::dvec3> mean = Status::failed("not run");
    withThreads(threads,
                [&] { mean = rewriteRadiosity(scene, source, writer, threads, progress_); });
    if (!mean.ok()) return mean;
    SURFEIT_RETURN_IF_ERROR(writer.finish(rewrittenSceneFields(scene), "{}"));
    return mean;
  }

  std::string rewrite(const std::string& from, const std::string& name, const Light& light,
                      int threads = 2) {
    const Result<glm::dvec3> mean = tryRewrite(from, path(name), light, threads);
    EXPECT_TRUE(mean.ok()) << mean.status().message();
    return path(name);
  }

  static ReadScene read(const std::string& scene_path) {
    Result<ReadScene> scene = readScene(scene_path);
    EXPECT_TRUE(scene.ok()) << scene.status().message();
    return scene.ok() ? std::move(*scene) : ReadScene();
  }
};

// A node with what a rewriting changes set to zero.
Node withoutLight(Node node) {
  node.radiosity = glm::vec3(0);
  for (std::size_t k = 0; k < node.facet_count; ++k) node.facets[k].radiosity = glm::vec3(0);
  if (!node.hasFacets()) {
    for (auto& kinds : node.rough.sh) kinds[1] = kinds[2] = kinds[3] = 0;
  }
  return node;
}

bool sameBytes(const Node& a, const Node& b) {
  if (std::memcmp(&a, &b, offsetof(Node, facet_count)) != 0) return false;
  if (a.facet_count != b.facet_count || a.hidden != b.hidden) return false;
  if (a.hasFacets()) return a.facets == b.facets;
  return std::memcmp(&a.rough, &b.rough, sizeof a.rough) == 0;
}

// Two sheets, one close behind the other, that face along a diagonal.
std::vector<Surfel> layeredCloud() {
  const glm::vec3 n = glm::normalize(glm::vec3(1, 2, 3));
  const glm::vec3 u = glm::normalize(glm::cross(n, glm::vec3(0, 1, 0))), v = glm::cross(n, u);
  std::vector<Surfel> cloud;
  for (int i = 0; i < 2 * 60 * 60; ++i) {
    Surfel& surfel = cloud.emplace_back();
    const float x = float(i % 60), y = float(i / 60 % 60), depth = i < 60 * 60 ? 0.f : .2f;
    surfel.position = x * u + y * v - depth * n;
    surfel.normal = n;
    surfel.area = 1;
    surfel.radius = .71f;
    surfel.radiosity = glm::vec3(1);
  }
  return cloud;
}
glm::vec3 lightOfFrontLayer(const Surfel& surfel) {
  return glm::vec3(glm::dot(surfel.position, glm::vec3(1, 2, 3)) > -.3f ? 3.f : .5f);
}

TEST_F(RadiosityRewriterTest, LayersHaveLightOfTheirOwn) {
  for (const bool full_precision : {true, false}) {
    IndexOptions options;
    options.full_precision = full_precision;
    std::vector<Surfel> cloud = layeredCloud();
    const std::string scene = index(cloud, kAllChannels, options);
    for (Surfel& surfel : cloud) surfel.radiosity = lightOfFrontLayer(surfel);
    const ReadScene expected = read(index(cloud, kAllChannels, options));
    const std::string rewritten = rewrite(scene, "lit.sft", lightOfFrontLayer);
    EXPECT_TRUE(findingsOf(rewritten).empty());
    const ReadScene found = read(rewritten);
    EXPECT_TRUE(found.header.has_layers);
    ASSERT_EQ(found.nodes.size(), expected.nodes.size());
    std::size_t hidden = 0;
    for (std::size_t i = 0; i < found.nodes.size(); ++i) {
      const Node &a = found.nodes[i].node, &b = expected.nodes[i].node;
      ASSERT_EQ(a.hidden, b.hidden);
      ASSERT_EQ(a.facet_count, b.facet_count);
      hidden += a.hidden;
      for (std::size_t k = 0; k < a.facet_count; ++k) {
        ASSERT_EQ(a.facets[k].hidden, b.facets[k].hidden);
        EXPECT_NEAR(a.facets[k].radiosity.x, b.facets[k].radiosity.x, .02f);
        hidden += a.facets[k].hidden;
      }
    }
    EXPECT_GT(hidden, 100u);
  }
}

// One pane of patches whose opacities differ, all around the same place.
TEST_F(RadiosityRewriterTest, FacetsOfEachOpacityHaveLightOfTheirOwn) {
  const auto lightOfOpacity = [](const Surfel& surfel) {
    return glm::vec3(surfel.opacity() > .5f ? 3.f : .5f);
  };
  for (const bool full_precision : {true, false}) {
    IndexOptions options;
    options.full_precision = full_precision;
    CloudChannels channels = kAllChannels;
    channels.opacity = true;
    std::vector<Surfel> cloud = layeredCloud();
    cloud.resize(cloud.size() / 2);
    for (std::size_t i = 0; i < cloud.size(); ++i) {
      const float opacity = (i % 60 + i / 60) % 2 == 0 ? .3f : .7f;
      cloud[i].setOpacity(opacity, opacity, opacity);
    }
    const std::string scene = index(cloud, channels, options);
    const std::string rewritten = rewrite(scene, "lit.sft", lightOfOpacity);
    EXPECT_TRUE(findingsOf(rewritten).empty());
    std::size_t facets = 0;
    for (const auto& [node, first] : read(rewritten).nodes) {
      for (std::size_t k = 0; k < node.facet_count; ++k, ++facets) {
        EXPECT_NEAR(node.facets[k].radiosity.x, node.facets[k].opacity().x > .5f ? 3 : .5f, .02f);
      }
    }
    EXPECT_GT(facets, 100u);
  }
}

TEST_F(RadiosityRewriterTest, AtFullPrecisionItIsWhatIndexingGives) {
  IndexOptions options;
  options.full_precision = true;
  CloudChannels dark = kAllChannels;
  dark.radiosity = false;
  for (const CloudChannels& channels : {kAllChannels, dark}) {
    SCOPED_TRACE(channels.radiosity);
    std::vector<Surfel> cloud = randomCloud(60000);
    const std::string scene = index(cloud, channels, options);
    for (Surfel& surfel : cloud) surfel.radiosity = wavesOfLight(surfel);
    const ReadScene expected = read(index(cloud, kAllChannels, options));
    const ReadScene found = read(rewrite(scene, "new.sft", wavesOfLight));
    EXPECT_EQ(read(scene).header.has_variances, channels.radiosity);
    EXPECT_EQ(read(scene).header.has_slopes, channels.radiosity);
    EXPECT_TRUE(found.header.has_variances && found.header.has_slopes);

    ASSERT_EQ(found.surfels.size(), expected.surfels.size());
    EXPECT_EQ(std::memcmp(found.surfels.data(), expected.surfels.data(),
                          expected.surfels.size() * sizeof(Surfel)),
              0);
    ASSERT_EQ(found.nodes.size(), expected.nodes.size());
    for (std::size_t i = 0; i < found.nodes.size(); ++i) {
      ASSERT_TRUE(sameBytes(found.nodes[i].node, expected.nodes[i].node)) << "node " << i;
    }
  }
}

TEST_F(RadiosityRewriterTest, EverythingButLightKeepsItsValues) {
  std::vector<Surfel> cloud = randomCloud(20000);
  const std::vector<Surfel> plane = planeCloud(150, 0.01f);
  cloud.insert(cloud.end(), plane.begin(), plane.end());
  for (const CloudChannels& channels : {kAllChannels, kAllAndGroups}) {
    SCOPED_TRACE(channels.group);
    const std::string path = index(inGroups(cloud, 40), channels);
    const ReadScene before = read(path), after = read(rewrite(path, "new.sft", wavesOfLight));
    EXPECT_EQ(after.header.channels.group, channels.group);
    ASSERT_EQ(after.surfels.size(), before.surfels.size());
    for (std::size_t i = 0; i < before.surfels.size(); ++i) {
      Surfel kept = after.surfels[i];
      const glm::vec3 expected = wavesOfLight(before.surfels[i]);
      ASSERT_LT(glm::length(kept.radiosity - expected), 1e-3f * glm::length(expected)) << i;
      kept.radiosity = before.surfels[i].radiosity;
      ASSERT_EQ(std::memcmp(&kept, &before.surfels[i], sizeof kept), 0) << i;
    }
    ASSERT_EQ(after.nodes.size(), before.nodes.size());
    for (std::size_t i = 0; i < before.nodes.size(); ++i) {
      ASSERT_TRUE(sameBytes(withoutLight(after.nodes[i].node), withoutLight(before.nodes[i].node)))
          << i;
    }
    EXPECT_EQ(findingsOf(this->path("new.sft")), std::vector<std::string>{});
  }
}

TEST_F(RadiosityRewriterTest, AFileOfVersionOneStaysOne) {
  const std::string before = SURFEIT_TEST_SOURCE_DIR "/golden/v1.sft";
  const std::string after = rewrite(before, "new.sft", wavesOfLight);
  EXPECT_EQ(findingsOf(after), std::vector<std::string>{});
  const ReadScene a = read(before), b = read(after);
  EXPECT_EQ(b.header.format_version, 1u);
  ASSERT_EQ(a.nodes.size(), b.nodes.size());
  for (std::size_t i = 0; i < a.nodes.size(); ++i) {
    EXPECT_TRUE(sameBytes(withoutLight(a.nodes[i].node), withoutLight(b.nodes[i].node))) << i;
  }
  EXPECT_EQ(bytesOf(rewrite(rewrite(before, "dark.sft", darkness), "twice.sft", wavesOfLight)),
            bytesOf(after));
}

// Mean radiosity and the power that a node sends: what a gather takes from it.
TEST_F(RadiosityRewriterTest, NodesHaveTheLightOfTheirSurfels) {
  const ReadScene scene = read(rewrite(index(randomCloud(20000)), "new.sft", wavesOfLight));
  double worst = 0, worst_power = 0;
  for (const auto& [node, first] : scene.nodes) {
    NodeSums sums;
    for (std::size_t i = 0; i < node.surfel_count; ++i) sums.add(scene.surfels[first + i]);
    for (int c = 0; c < 3; ++c) {
      const double mean = sums.radiosity[c] / sums.area;
      worst = std::max(worst, std::abs(double(node.radiosity[c]) - mean) / mean);
      if (!node.isRough()) continue;
      for (int i = 0; i < kShCount; ++i) {
        const double error = double(node.rough.sh[i][powerKind(c)]) - sums.sh[i][powerKind(c)];
        worst_power = std::max(worst_power, std::abs(error) / sums.radiosity[c]);
      }
    }
  }
  EXPECT_LT(worst, 1e-3);
  EXPECT_LT(worst_power, 5e-3);  // of the largest coefficient, about
}

TEST_F(RadiosityRewriterTest, MeanRadiosityIsByArea) {
  const std::vector<Surfel> cloud = randomCloud(5000);
  const std::string scene = index(cloud);
  glm::dvec3 power(0);
  double area = 0;
  for (const Surfel& surfel : cloud) {
    power += double(surfel.area) * glm::dvec3(wavesOfLight(surfel));
    area += double(surfel.area);
  }
  const Result<glm::dvec3> mean = tryRewrite(scene, path("new.sft"), wavesOfLight);
  ASSERT_TRUE(mean.ok()) << mean.status().message();
  EXPECT_LT(glm::length(*mean - power / area), 1e-4);
}

// The light that a scene had before leaves no trace, nor does the form in which it was stored.
TEST_F(RadiosityRewriterTest, RewritingTwiceIsRewritingOnce) {
  for (const bool full_precision : {false, true}) {
    IndexOptions options;
    options.full_precision = full_precision;
    const std::string scene = index(randomCloud(30000), kAllChannels, options);
    const std::string once = rewrite(scene, "once.sft", otherLight);
    const std::string dark = rewrite(scene, "dark.sft", darkness);
    EXPECT_EQ(bytesOf(rewrite(dark, "twice.sft", otherLight)), bytesOf(once));
    EXPECT_NE(bytesOf(dark), bytesOf(once));
  }
}

TEST_F(RadiosityRewriterTest, ThreadsDoNotChangeTheBytes) {
  const std::string scene = index(randomCloud(60000));
  const std::string expected = bytesOf(rewrite(scene, "one.sft", wavesOfLight, 1));
  for (const int threads : {2, 7}) {
    EXPECT_EQ(bytesOf(rewrite(scene, "many.sft", wavesOfLight, threads)), expected) << threads;
  }
}

TEST_F(RadiosityRewriterTest, AnyShapeOfTreeIsSwept) {
  std::vector<std::vector<Surfel>> clouds = {randomCloud(1), randomCloud(16), randomCloud(17),
                                             randomCloud(3000), randomCloud(40000)};
  for (Surfel& surfel : clouds[3]) surfel.position = {1, 2, 3};  // one leaf of several pages
  for (std::size_t i = 0; i < 20000; ++i) clouds[4][i].position = clouds[4].back().position;
  for (const std::uint32_t leaf_capacity : {1u, 16u, 4096u}) {
    for (const std::vector<Surfel>& cloud : clouds) {
      SCOPED_TRACE(cloud.size());
      IndexOptions options;
      options.leaf_capacity = leaf_capacity;
      const std::string scene = index(cloud, kAllChannels, options);
      EXPECT_EQ(findingsOf(rewrite(scene, "new.sft", wavesOfLight)), std::vector<std::string>{});
    }
  }
}

// Two node pages of a level in each other's place, under a directory that is sound.
TEST_F(RadiosityRewriterTest, RefusesNodesThatAreNotInTheOrderOfTheTree) {
  const std::string scene_path = index(randomCloud(30000));
  const Result<SceneFile> scene = SceneFile::open(scene_path);
  ASSERT_TRUE(scene.ok());
  const PageFile& file = scene->pages();
  const auto& first = scene->header().level_first_page;
  std::size_t level = 0;
  while (first[level + 1] - first[level] < 4) ++level;
  const std::uint32_t swapped = first[level] + 1;

  Result<PageFileWriter> writer = PageFileWriter::create(path("swapped.sft"), kIdentity);
  ASSERT_TRUE(writer.ok());
  AlignedBuffer stored;
  std::vector<std::byte> payload, compressed;
  level = 0;
  for (std::uint32_t page = 0; page < file.pageCount(); ++page) {
    const std::uint32_t other = page == swapped ? page + 1 : page == swapped + 1 ? page - 1 : page;
    ASSERT_TRUE(file.readPage(other, stored, payload).ok());
    ASSERT_TRUE(compressPage(payload, compressed).ok());
    const auto bytes = static_cast<std::uint32_t>(payload.size());
    while (level < kCurveLevels && first[level + 1] <= page) ++level;
    ASSERT_TRUE((page < file.nodePageCount() ? writer->addNodePage(compressed, bytes, level)
                                             : writer->addSurfelPage(compressed, bytes))
                    .ok());
  }
  ASSERT_TRUE(writer->finish(file.sceneFields(), "{}").ok());
  const Result<glm::dvec3> mean = tryRewrite(path("swapped.sft"), path("refused.sft"), darkness);
  EXPECT_EQ(mean.status().code(), StatusCode::kCorruption);
  EXPECT_NE(mean.status().message().find("order of the tree"), std::string::npos)
      << mean.status().message();
  EXPECT_FALSE(std::filesystem::exists(path("refused.sft")));
}

TEST_F(RadiosityRewriterTest, ADamagedPageIsNamed) {
  const std::string scene = index(randomCloud(30000));
  std::string bytes = bytesOf(scene);
  bytes[bytes.size() / 2] = char(bytes[bytes.size() / 2] ^ 1);
  writeBytes(scene, bytes);
  const Result<glm::dvec3> mean = tryRewrite(scene, path("refused.sft"), darkness);
  EXPECT_EQ(mean.status().code(), StatusCode::kCorruption);
  EXPECT_NE(mean.status().message().find("page"), std::string::npos) << mean.status().message();
}

}  // namespace
}  // namespace surfeit
