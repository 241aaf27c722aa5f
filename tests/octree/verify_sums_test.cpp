// What a node tells of the surfels below, against them: every checksum is right.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <functional>
#include <string>
#include <vector>

#include "core/parallel.h"
#include "octree/relight/radiosity_rewriter.h"
#include "octree/scene_damage.h"
#include "octree/test_scenes.h"
#include "surfeit/scene.h"

namespace surfeit {
namespace {

using testing::Contains;
using testing::HasSubstr;
using testing::IsEmpty;

constexpr CloudChannels kAllAndOpacity = {.normal = true,
                                          .radius = true,
                                          .area = true,
                                          .radiosity = true,
                                          .albedo = true,
                                          .two_sided = true,
                                          .opacity = true};

std::vector<Surfel> twoSided(std::vector<Surfel> cloud) {
  for (std::size_t i = 0; i < cloud.size(); ++i) {
    cloud[i].flags |= kSurfelTwoSided;
    if (i % 3 == 0) cloud[i].normal = -cloud[i].normal;
  }
  return cloud;
}

std::vector<Surfel> translucent(std::vector<Surfel> cloud) {
  TestRandom random(8);
  for (Surfel& surfel : cloud) surfel.transparency = transparencyOf(double(random.between(.2f, 1)));
  return cloud;
}

// Each color by its own opacity.
std::vector<Surfel> tinted(std::vector<Surfel> cloud) {
  TestRandom random(8);
  const auto opacity = [&] { return double(random.between(.2f, 1)); };
  for (Surfel& surfel : cloud) surfel.setOpacity(opacity(), opacity() / 2, opacity() / 4);
  return cloud;
}

CloudChannels withTints(CloudChannels channels) {
  channels.opacity = channels.tint = true;
  return channels;
}

// Leaves in a heap: half of each kind, anywhere.
std::vector<Surfel> thicket(std::size_t count) {
  std::vector<Surfel> cloud = twoSided(sphereCloud(count));
  TestRandom random(9);
  for (std::size_t i = 0; i < count; ++i) {
    cloud[i].position *= random.unit();
    if (i % 2 == 0) cloud[i].flags = 0;
  }
  return cloud;
}

std::vector<Surfel> withoutNormals(std::vector<Surfel> cloud) {
  for (Surfel& surfel : cloud) {
    surfel.flags = kSurfelSphere;
    surfel.normal = glm::vec3(0);
  }
  return cloud;
}

// Two walls that may be seen from both sides, a room apart.
std::vector<Surfel> twoSidedWalls() {
  std::vector<Surfel> cloud = planeCloud(12, .1f);
  for (Surfel surfel : planeCloud(12, .1f)) {
    surfel.position.z = 1;
    surfel.normal.z = -1;
    surfel.radiosity *= 5.f;
    cloud.push_back(surfel);
  }
  for (Surfel& surfel : cloud) surfel.flags |= kSurfelTwoSided;
  return cloud;
}

struct NamedCloud {
  const char* name;
  std::vector<Surfel> cloud;
  CloudChannels channels = kAllAndOpacity;
};

std::vector<NamedCloud> cloudsOfEveryKind() {
  return {{"plane", planeCloud(20, .1f)},
          {"two-sided plane", twoSided(planeCloud(20, .1f))},
          {"box", boxCloud(9, .1f)},
          {"two-sided box", twoSided(boxCloud(9, .1f))},
          {"two-sided walls", twoSidedWalls()},
          {"sphere", sphereCloud(700)},
          {"thicket", thicket(700)},
          {"points", withoutNormals(sphereCloud(400))},
          {"all kinds", randomCloud(700), kAllChannels},
          {"translucent box", translucent(boxCloud(9, .1f))},
          {"translucent thicket", translucent(thicket(600))},
          {"tinted box", tinted(boxCloud(9, .1f)), withTints(kAllAndOpacity)},
          {"tinted thicket", tinted(thicket(600)), withTints(kAllAndOpacity)},
          {"tints of all kinds", tinted(randomCloud(700)), withTints(kAllChannels)},
          {"one surfel", randomCloud(1)},
          {"one point", withoutNormals(randomCloud(1))}};
}

class VerifySumsTest : public SceneTest {
 protected:
  std::string sceneOf(const std::vector<Surfel>& cloud, bool full_precision,
                      std::uint32_t leaf_capacity = 16) {
    IndexOptions options;
    options.full_precision = full_precision;
    options.leaf_capacity = leaf_capacity;
    return index(cloud, kAllAndOpacity, options);
  }

  // The scene with other radiosities, as bounce and relight write it.
  std::string litAgain(const std::string& scene_path) {
    class Waves : public RadiositySource {
     public:
      explicit Waves(const SceneFile& scene) : scene_(scene) {}
      Status read(std::uint32_t page, std::span<glm::vec3> radiosity) override {
        SceneFile::Scratch scratch;
        std::vector<Surfel> surfels(scene_.header().surfel_group_capacity);
        SURFEIT_RETURN_IF_ERROR(scene_.decodeSurfels(page, scratch, surfels).status());
        for (std::size_t i = 0; i < radiosity.size(); ++i) {
          radiosity[i] = glm::vec3(1) + 20.f * surfels[i].position * surfels[i].position;
        }
        return {};
      }

     private:
      const SceneFile& scene_;
    };
    const Result<SceneFile> scene = SceneFile::open(scene_path);
    EXPECT_TRUE(scene.ok());
    Result<PageFileWriter> writer =
        PageFileWriter::create(path("lit.sft"), 4712, scene->header().format_version);
    EXPECT_TRUE(writer.ok());
    Waves waves(*scene);
    withThreads(2,
                [&] { EXPECT_TRUE(rewriteRadiosity(*scene, waves, *writer, 2, progress_).ok()); });
    EXPECT_TRUE(writer->finish(rewrittenSceneFields(*scene), "{}").ok());
    return path("lit.sft");
  }

  std::vector<std::string> findingsAfter(const std::string& scene,
                                         const std::function<void(Node&)>& edit) {
    const Status status = editNodes(scene, path("edited.sft"), 0, [&](auto& nodes) {
      edit(nodes[0].node);
      nodes[0].node.forgetBounds();  // they would be told first
      nodes[0].normal_angle = kUnknownAngle;
    });
    EXPECT_TRUE(status.ok()) << status.message();
    return findingsOf(path("edited.sft"));
  }

  // Each edit of the root must be told, with a word that names what was changed.
  struct NodeEdit {
    const char* told;
    std::function<void(Node&)> edit;
  };
  void expectFound(const std::vector<Surfel>& cloud, const std::vector<NodeEdit>& edits) {
    for (const bool full_precision : {false, true}) {
      const std::string scene = sceneOf(cloud, full_precision);
      EXPECT_THAT(findingsAfter(scene, [](Node&) {}), IsEmpty());
      for (std::size_t i = 0; i < edits.size(); ++i) {
        SCOPED_TRACE(std::to_string(i) + (full_precision ? ", full precision" : ", quantized"));
        EXPECT_THAT(findingsAfter(scene, edits[i].edit), Contains(HasSubstr(edits[i].told)));
      }
    }
  }
};

TEST_F(VerifySumsTest, SoundScenesOfEveryKindHaveNoFindings) {
  for (const NamedCloud& kind : cloudsOfEveryKind()) {
    for (const bool full_precision : {false, true}) {
      for (const std::uint32_t leaf : {1u, 16u}) {
        SCOPED_TRACE(std::string(kind.name) + (full_precision ? ", full precision, " : ", ") +
                     std::to_string(leaf));
        IndexOptions options;
        options.full_precision = full_precision;
        options.leaf_capacity = leaf;
        const std::string scene = index(kind.cloud, kind.channels, options);
        EXPECT_THAT(findingsOf(scene, 2), IsEmpty());
        EXPECT_THAT(findingsOf(litAgain(scene), 2), IsEmpty());
      }
    }
  }
}

TEST_F(VerifySumsTest, SoundScenesOfEverySizeAndPlaceHaveNoFindings) {
  const struct {
    float scale;
    glm::vec3 offset;
  } places[] = {{1e-4f, glm::vec3(0)},   {1e4f, glm::vec3(0)},   {1, glm::vec3(1e3f, 0, 0)},
                {1e4f, glm::vec3(1e6f)}, {1e-18f, glm::vec3(0)}, {1e10f, glm::vec3(0)}};
  for (const NamedCloud& kind : cloudsOfEveryKind()) {
    for (const auto& place : places) {
      for (const bool full_precision : {false, true}) {
        SCOPED_TRACE(std::string(kind.name) + " times " + std::to_string(place.scale) +
                     (full_precision ? ", full precision" : ""));
        IndexOptions options;
        options.full_precision = full_precision;
        EXPECT_THAT(
            findingsOf(index(moved(kind.cloud, place.scale, place.offset), kind.channels, options)),
            IsEmpty());
      }
    }
  }
}

// Areas follow from radii, so that none is zero.
TEST_F(VerifySumsTest, CloudsOfTheLeastSizesAreSoundAndTold) {
  for (const float scale : {1e-8f, 1e-13f, 1e-20f, 1e-25f, 1e-30f, 1e-36f}) {
    SCOPED_TRACE(scale);
    progress_.notes.clear();
    const CloudChannels channels = {.normal = true, .radius = true, .radiosity = true};
    EXPECT_THAT(findingsOf(index(moved(sphereCloud(700), scale, glm::vec3(0)), channels)),
                IsEmpty());
    const auto told = Contains(HasSubstr("convert --units km:mm"));
    if (scale > 1e-9f) {
      EXPECT_THAT(progress_.notes, testing::Not(told));
    } else {
      EXPECT_THAT(progress_.notes, told);
    }
  }
}

TEST_F(VerifySumsTest, FacetsThatAreNotThoseBelowAreFound) {
  const auto with = [](const char* told, std::function<void(Node&)> edit) {
    return NodeEdit{told, [edit](Node& node) {
                      ASSERT_EQ(node.facet_count, 6);
                      edit(node);
                    }};
  };
  expectFound(translucent(boxCloud(9, .1f)),
              {with("area of facets", [](Node& n) { n.facets[0].area /= 2; }),
               with("area of facets", [](Node& n) { n.facets[5].area ^= 1 << 13; }),
               with("normal of facets",
                    [](Node& n) {
                      for (std::int16_t& axis : n.facets[1].normal) axis = std::int16_t(-axis);
                    }),
               with("front moment of facets",
                    [](Node& n) { std::swap(n.facets[1].normal, n.facets[2].normal); }),
               with("normal of facets",
                    [](Node& n) {
                      for (std::int16_t& axis : n.facets[1].normal)
                        axis = std::int16_t(axis / 4 * 3);
                    }),
               with("offset of facets", [](Node& n) { n.facets[2].offset[0] ^= 0x20; }),
               with("offset of facets", [](Node& n) { n.facets[2].offset[1] ^= 0x20; }),
               with("offset of facets", [](Node& n) { n.facets[3].offset[2] ^= 0x40; }),
               with("covariance of facets", [](Node& n) { n.facets[4].covariance[0] ^= 0x80; }),
               with("covariance of facets", [](Node& n) { n.facets[4].covariance[1] ^= 0x80; }),
               with("covariance of facets", [](Node& n) { n.facets[4].covariance[2] ^= 0x80; }),
               with("covariance of facets", [](Node& n) { n.facets[4].covariance[3] ^= 0x80; }),
               with("covariance of facets", [](Node& n) { n.facets[4].covariance[4] ^= 0x80; }),
               with("covariance of facets", [](Node& n) { n.facets[4].covariance[5] ^= 0x80; }),
               with("variance of the radiosity", [](Node& n) { n.radiosity_variance = 50; }),
               with("slope of the radiosity in red", [](Node& n) { n.slopes[2].codes[1] ^= 0x40; }),
               with("opacity of facets", [](Node& n) { n.facets[4].transparency = 0; }),
               with("facet radiosity in red", [](Node& n) { n.facets[0].radiosity.x *= 1.05f; }),
               with("facet radiosity in red", [](Node& n) { n.facets[5].radiosity.x *= .9f; }),
               with("facet radiosity in blue", [](Node& n) { n.facets[5].radiosity.z = .1f; }),
               with("facet radiosity",
                    [](Node& n) { std::swap(n.facets[0].radiosity, n.facets[1].radiosity); }),
               with("area of facets", [](Node& n) { n.flags |= kNodeTwoSided << 2; }),
               with("area of facets", [](Node& n) { n.facet_count = 5; })});
}

TEST_F(VerifySumsTest, TwoSidedFacetsThatAreNotThoseBelowAreFound) {
  expectFound(twoSided(boxCloud(9, .1f, 3)),
              {{"area of facets", [](Node& n) { n.flags &= std::uint8_t(~(kNodeTwoSided << 1)); }},
               {"square of the normals",
                [](Node& n) {
                  ASSERT_EQ(n.facet_count, 3);
                  std::swap(n.facets[1].normal[0], n.facets[1].normal[1]);
                  std::swap(n.facets[1].normal[1], n.facets[1].normal[2]);
                }},
               {"flatness of facets",
                [](Node& n) {
                  for (std::int16_t& axis : n.facets[1].normal) axis = std::int16_t(axis / 4 * 3);
                }},
               {"covariance of facets", [](Node& n) { n.facets[0].covariance[0] /= 2; }},
               {"offset of facets", [](Node& n) { n.facets[0].offset[1] ^= 0x40; }},
               {"area of facets", [](Node& n) { n.facets[0].area /= 2; }}});
}

// Facets that are not the groups that stored surfels give have light of what lies below all the
// same.
TEST_F(VerifySumsTest, LightOfFacetsIsBetweenThatBelowWhateverTheGroups) {
  const std::string scene = sceneOf(boxCloud(9, .1f), true);
  const auto regrouped = [](Node& n) {
    std::swap(n.facets[1].normal, n.facets[2].normal);  // sums hold, groups do not
    std::swap(n.facets[1].offset, n.facets[2].offset);
    std::swap(n.facets[1].area, n.facets[2].area);
    std::swap(n.facets[1].covariance, n.facets[2].covariance);
    n.facets[0].offset[0] = std::uint8_t(n.facets[0].offset[0] + 3);
    n.facets[1].offset[0] = std::uint8_t(n.facets[1].offset[0] - 3);
  };
  EXPECT_THAT(findingsAfter(scene, regrouped), IsEmpty());
  EXPECT_THAT(findingsAfter(scene,
                            [&](Node& n) {
                              regrouped(n);
                              n.facets[0].radiosity.x = 100;
                            }),
              Contains(HasSubstr("facet radiosity in red")));
}

TEST_F(VerifySumsTest, FacetsAboveSpheresAreFound) {
  std::vector<Surfel> cloud = boxCloud(9, .1f);
  const std::string faceted = sceneOf(cloud, true);
  for (std::size_t i = 0; i < 3; ++i) {
    cloud[i].flags = kSurfelSphere;
    cloud[i].normal = glm::vec3(0);
  }
  const Result<ReadScene> with_facets = readScene(faceted);
  ASSERT_TRUE(with_facets.ok());
  const Node facets = with_facets->nodes.front().node;
  ASSERT_TRUE(facets.hasFacets());
  EXPECT_THAT(findingsAfter(sceneOf(cloud, true),
                            [&](Node& n) {
                              ASSERT_TRUE(n.isRough());
                              n.facet_count = facets.facet_count;
                              n.facets = facets.facets;
                            }),
              Contains(HasSubstr("facets, expected none above spheres")));
}

TEST_F(VerifySumsTest, LooseOrNotIsByTheAreaBelow) {
  const NodeEdit turn = {"loose, expected otherwise",
                         [](Node& n) { n.flags ^= std::uint8_t(kNodeLoose); }};
  expectFound(withoutNormals(sphereCloud(700)), {turn});
  expectFound(thicket(700), {turn});
}

TEST_F(VerifySumsTest, PlaceNormalAndSpreadThatAreNotThoseBelowAreFound) {
  std::vector<NodeEdit> edits = {
      {"position x", [](Node& n) { n.position.x += .02f * n.radius; }},
      {"position y", [](Node& n) { n.position.y -= .02f * n.radius; }},
      {"position z", [](Node& n) { n.position.z += .02f * n.radius; }},
      {"flatness", [](Node& n) { n.flatness += .01f; }},
      {"flatness", [](Node& n) { n.flatness /= 2; }},
      {"normal", [](Node& n) { n.normal = -n.normal; }},
      {"normal",
       [](Node& n) {
         n.normal = {n.normal.y, n.normal.z, n.normal.x};
       }},
      {"variance of the radiosity", [](Node& n) { n.radiosity_variance += .2f; }},
      {"variance of the radiosity", [](Node& n) { n.radiosity_variance = 0; }},
      {"flat, expected otherwise", [](Node& n) { n.flags |= kNodeFlat; }}};
  for (std::size_t k = 0; k < SymmetricMatrix::kEntries; ++k) {
    edits.push_back({"covariance", [k](Node& n) {
                       n.covariance.entries[k] += (k == 0 ? -.06f : .06f) * n.radius * n.radius;
                     }});
  }
  std::vector<Surfel> cloud = sphereCloud(700);
  for (Surfel& surfel : cloud) surfel.area *= surfel.position.x > 0 ? 3 : 1;  // one side has more
  expectFound(cloud, edits);
}

TEST_F(VerifySumsTest, SlopesThatAreNotThoseBelowAreFound) {
  const NodeEdit blue = {"slope of the radiosity in blue",
                         [](Node& n) { n.slopes[0].codes[8] ^= 0x40; }};
  expectFound(planeCloud(20, .1f), {blue});
  std::vector<Surfel> cap = sphereCloud(6000);
  std::erase_if(cap, [](const Surfel& surfel) { return surfel.normal.z < .95f; });
  ASSERT_GT(cap.size(), 50u);
  for (Surfel& surfel : cap) surfel.radiosity = glm::vec3(1, 1, 2) * (1 + surfel.normal.x);
  expectFound(cap, {blue,
                    {"slope of the radiosity in red", [](Node& n) { n.slopes = {}; }},
                    {"slope of the radiosity in red",
                     [](Node& n) { n.slopes[0] = n.slopes[0].turned(); }}});
  expectFound(twoSided(cap),
              {blue, {"slope of the radiosity in red", [](Node& n) { n.slopes = {}; }}});
}

TEST_F(VerifySumsTest, FlatNodesThatAreNotFlatBelowAreFound) {
  expectFound(planeCloud(20, .1f),
              {{"not flat, expected otherwise",
                [](Node& n) {
                  n.flags = 0;
                  n.facet_count = 0;
                }},
               {"normal",
                [](Node& n) {
                  n.normal = {1, 0, 0};
                }},
               {"normal", [](Node& n) { n.normal = glm::normalize(glm::vec3(.02f, 0, 1)); }},
               {"two-sided part", [](Node& n) { n.flags |= kNodeTwoSided; }}});
  expectFound(
      twoSided(planeCloud(20, .1f)),
      {{"flatness", [](Node& n) { n.flags = kNodeFlat; }},
       {"flatness", [](Node& n) { n.flatness = .8f; }},
       {"square of the cosines",
        [](Node& n) {
          n.normal = {1, 0, 0};
        }},
       {"normal", [](Node& n) { n.normal = glm::normalize(glm::vec3(.02f, 0, 1)); }},
       {"covariance", [](Node& n) { n.covariance.entries[2] = .1f * n.radius * n.radius; }}});
}

TEST_F(VerifySumsTest, CoefficientsAndMomentsThatAreNotThoseBelowAreFound) {
  std::vector<NodeEdit> edits;
  for (std::size_t i = 0; i < kShCount; ++i) {
    edits.push_back({"coefficient of the area", [i](Node& n) {
                       ASSERT_TRUE(n.isRough());
                       n.rough.sh[i][kAreaKind] += .02f * n.area;
                     }});
    edits.push_back({"coefficient of the power in green", [i](Node& n) {
                       n.rough.sh[i][powerKind(1)] += .2f * n.area * n.radiosity.y;
                     }});
    edits.push_back({"band 4", [i](Node& n) { n.rough.area_band_4[i] += .05f * n.area; }});
    edits.push_back({"front moment", [i](Node& n) {
                       n.rough.front_moment[i / 3][int(i % 3)] += .03f * n.area * n.radius;
                     }});
  }
  edits.push_back({"coefficient of the power in red",
                   [](Node& n) { std::swap(n.rough.sh[0][1], n.rough.sh[0][3]); }});
  std::vector<Surfel> cloud = sphereCloud(700);
  for (Surfel& surfel : cloud) surfel.radiosity.x *= 3;
  expectFound(cloud, edits);
}

}  // namespace
}  // namespace surfeit
