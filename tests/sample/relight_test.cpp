// Light anew in a scene against the same meshes sampled with that light, and against the formulas
// of the lights.
#include "surfeit/relight.h"

#include <gmock/gmock.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <glm/geometric.hpp>

#include "octree/indexed_surfels.h"
#include "octree/read/scene_file.h"
#include "sample/scene_files.h"
#include "surfeit/index.h"
#include "surfeit/scene.h"
#include "surfels/rows/surfel_writer.h"

namespace surfeit {
namespace {

using ::testing::HasSubstr;

class Relighting : public SceneFiles {
 protected:
  // A floor with a box above it, which throws a shadow.
  std::string boxOnFloor(const std::string& name = "box.ply", float height = 0.5f) {
    std::vector<glm::vec3> vertices = {{-2, 0, 2}, {2, 0, 2}, {2, 0, -2}, {-2, 0, -2}};
    for (int i = 0; i < 8; ++i) {
      vertices.emplace_back((i & 1) - 0.5f, float((i >> 1) & 1) * 0.7f + height, (i >> 2) - 0.5f);
    }
    std::vector<std::vector<int>> faces = {{0, 2, 3, 1}, {4, 5, 7, 6}, {0, 1, 5, 4},
                                           {2, 6, 7, 3}, {0, 4, 6, 2}, {1, 3, 7, 5}};
    for (std::vector<int>& face : faces) {
      for (int& vertex : face) vertex += 4;
    }
    faces.push_back({0, 1, 2, 3});
    return write(name, plyText(vertices, faces));
  }

  static Lights sharpLights() {
    Lights lights;
    lights.points.push_back({{0.8, 2.5, -0.3}, glm::vec3(6, 5, 4)});
    lights.directionals.push_back({{0.3f, -1, 0.6f}, glm::vec3(1, 2, 3)});
    return lights;
  }

  std::string sampled(const std::string& mesh, const std::string& name,
                      const SampleOptions& options, bool full_precision = false) {
    const auto stats = sampleMeshes({mesh}, path("cloud.ply"), options, notes_);
    EXPECT_TRUE(stats.ok()) << stats.status().message();
    return index(path("cloud.ply"), name, full_precision);
  }
  std::string index(const std::string& cloud, const std::string& name,
                    bool full_precision = false) {
    IndexOptions options;
    options.full_precision = full_precision;
    const auto indexed = indexClouds({cloud}, path(name), options, notes_);
    EXPECT_TRUE(indexed.ok()) << indexed.status().message();
    return path(name);
  }
  std::string cloudOf(const std::vector<Surfel>& surfels, const CloudChannels& channels) {
    Result<SurfelWriter> writer = SurfelWriter::create(path("few.ply"), channels);
    EXPECT_TRUE(writer.ok()) << writer.status().message();
    EXPECT_TRUE(writer->write(surfels).ok());
    EXPECT_TRUE(writer->finish().ok());
    return path("few.ply");
  }

  std::vector<Surfel> relit(const std::string& scene, const RelightOptions& options,
                            const std::string& name = "relit.sft") {
    const Result<RelightStats> stats = relightScene(scene, path(name), options, notes_);
    EXPECT_TRUE(stats.ok()) << stats.status().message();
    if (stats.ok()) stats_ = *stats;
    return stats.ok() ? surfelsOf(path(name)) : std::vector<Surfel>();
  }
  Status refusal(const std::string& scene, const RelightOptions& options) {
    const Status status = relightScene(scene, path("none.sft"), options, notes_).status();
    EXPECT_FALSE(std::filesystem::exists(path("none.sft")));
    return status;
  }

  // Surfels that differ in anything but the radiosity.
  static std::size_t movedSurfels(const std::vector<Surfel>& a, std::vector<Surfel> b) {
    std::size_t moved = 0;
    for (std::size_t i = 0; i < a.size(); ++i) {
      b[i].radiosity = a[i].radiosity;
      moved += std::memcmp(&a[i], &b[i], sizeof(Surfel)) != 0;
    }
    return moved;
  }
  // Surfels of which a color differs by more than that part of it and of the lights.
  static std::size_t differing(const std::vector<Surfel>& a, const std::vector<Surfel>& b,
                               float part) {
    std::size_t count = 0;
    for (std::size_t i = 0; i < a.size(); ++i) {
      const glm::vec3 difference = glm::abs(a[i].radiosity - b[i].radiosity);
      count += std::max({difference.r, difference.g, difference.b}) >
               part * (0.2f + glm::length(a[i].radiosity));
    }
    return count;
  }
  static glm::dvec3 power(const std::vector<Surfel>& surfels) {
    glm::dvec3 sum(0);
    for (const Surfel& s : surfels) sum += double(s.area) * glm::dvec3(s.radiosity);
    return sum;
  }

  RecordedNotes notes_;
  RelightStats stats_;
};

TEST_F(Relighting, EqualsTheMeshSampledWithTheLight) {
  const std::string mesh = boxOnFloor();
  SampleOptions dark, lit;
  dark.count = lit.count = 20000;
  lit.surroundings.lights = sharpLights();
  RelightOptions options;
  options.lights = sharpLights();
  options.meshes = {mesh};
  for (const bool full_precision : {true, false}) {
    auto expected = surfelsOf(sampled(mesh, "lit.sft", lit, full_precision));
    // The scene's albedo of 8 bits reflects; the sampler's was .5
    for (Surfel& surfel : expected) surfel.radiosity *= surfel.albedo / 0.5f;
    const std::string scene = sampled(mesh, "dark.sft", dark, full_precision);
    const auto found = relit(scene, options);
    ASSERT_EQ(found.size(), expected.size());
    EXPECT_EQ(movedSurfels(expected, found), 0u);
    EXPECT_EQ(differing(expected, found, full_precision ? 1e-6f : 1e-3f), 0u);
    const std::size_t dim = std::size_t(std::count_if(
        found.begin(), found.end(), [](const Surfel& s) { return s.radiosity == glm::vec3(0); }));
    EXPECT_GT(dim, found.size() / 50);  // there are shadows
    EXPECT_EQ(stats_.lit_surfels, found.size() - dim);

    const auto report = verifyScene(path("relit.sft"), 2, notes_);
    ASSERT_TRUE(report.ok());
    EXPECT_TRUE(report->findings.empty()) << report->findings.front();
  }
}

// The formula at each surfel: albedo I cos / d^F, scaled to be physical at the falloff distance.
TEST_F(Relighting, PointLightsFallOffAsAsked) {
  const std::string mesh = write("floor.ply", floorPly(8));
  SampleOptions dark;
  dark.count = 3000;
  const std::string scene = sampled(mesh, "dark.sft", dark, true);
  RelightOptions options;
  options.meshes = {mesh};
  options.lights.points.push_back({{0.5, 1.5, -1}, glm::vec3(6, 5, 4)});
  options.lights.falloff_distance = 3;
  for (const float falloff : {0.f, 1.f, 2.f, 4.f}) {
    options.lights.falloff = falloff;
    for (const Surfel& surfel : relit(scene, options)) {
      const glm::dvec3 towards = glm::dvec3(0.5, 1.5, -1) - glm::dvec3(surfel.position);
      const double distance = glm::length(towards), cosine = towards.y / distance;
      const double part = cosine / 9 * std::pow(3 / distance, double(falloff));
      ASSERT_NEAR(surfel.radiosity.r, 6 * double(surfel.albedo.r) * part, 2e-5 * 6 * part);
    }
  }
}

TEST_F(Relighting, AllOtherBytesOfThePagesStay) {
  const std::string mesh = boxOnFloor();
  SampleOptions lit;
  lit.count = 20000;
  lit.surroundings.lights = sharpLights();
  const std::string scene = sampled(mesh, "lit.sft", lit);
  RelightOptions options;
  options.lights = sharpLights();
  options.meshes = {mesh};
  options.gain = 3;
  EXPECT_EQ(movedSurfels(surfelsOf(scene), relit(scene, options)), 0u);
  const auto before = readSceneInfo(scene), after = readSceneInfo(path("relit.sft"));
  EXPECT_EQ(before->node_pages, after->node_pages);
  EXPECT_EQ(before->surfel_pages, after->surfel_pages);
  EXPECT_EQ(before->level_pages, after->level_pages);
}

TEST_F(Relighting, AreaLightsAndEmissiveMeshesAgreeWithinTheirNoise) {
  write("lamp.mtl", "newmtl grey\nKd .5 .5 .5\nnewmtl lamp\nKd .2 .2 .2\nKe 4 3 2\n");
  const std::string mesh = write("lamp.obj",
                                 "mtllib lamp.mtl\nv -2 0 2\nv 2 0 2\nv 2 0 -2\nv -2 0 -2\n"
                                 "v -.3 1 -.3\nv .3 1 -.3\nv .3 1 .3\nv -.3 1 .3\n"
                                 "usemtl grey\nf 1 2 3 4\nusemtl lamp\nf 5 6 7 8\n");
  SampleOptions dark, lit;
  lit.count = dark.count = 10000;
  lit.surroundings.lights.samples = 64;
  lit.surroundings.lights.areas.push_back({{0, 1.5, 0}, {.5f, 0, 0}, {0, 0, .5f}, glm::vec3(2)});
  const glm::dvec3 expected = power(surfelsOf(sampled(mesh, "lit.sft", lit, true)));
  RelightOptions options;
  options.lights = lit.surroundings.lights;
  options.meshes = {mesh};
  const glm::dvec3 found = power(relit(sampled(mesh, "dark.sft", dark, true), options));
  for (int c = 0; c < 3; ++c) EXPECT_NEAR(found[c] / expected[c], 1, 2e-3);

  // The area light alone, and the emissive triangles as a layer on it
  options.meshes_emit = false;
  const glm::dvec3 area = power(relit(path("dark.sft"), options, "area.sft"));
  EXPECT_LT(area.r, 0.9 * found.r);
  options.meshes_emit = options.adds = true;
  options.lights.areas.clear();
  const glm::dvec3 layers = power(relit(path("area.sft"), options, "layers.sft"));
  for (int c = 0; c < 3; ++c) EXPECT_NEAR(layers[c] / found[c], 1, 1e-6);
  EXPECT_THAT(notes_.notes, ::testing::Contains(HasSubstr("--no-mesh-light")));
}

TEST_F(Relighting, LayersWithGainsAddUp) {
  const std::string mesh = boxOnFloor();
  SampleOptions key, both;
  key.count = both.count = 5000;
  key.surroundings.lights.points = sharpLights().points;
  both.surroundings.lights = sharpLights();
  both.surroundings.lights.directionals[0].irradiance *= 0.5f;
  RelightOptions fill;
  fill.lights.directionals = sharpLights().directionals;
  fill.meshes = {mesh};
  fill.adds = true;
  fill.gain = 0.5;
  const auto found = relit(sampled(mesh, "key.sft", key, true), fill);
  const auto expected = surfelsOf(sampled(mesh, "both.sft", both, true));
  EXPECT_EQ(movedSurfels(expected, found), 0u);
  EXPECT_EQ(differing(expected, found, 1e-6f), 0u);

  // The same light in place of the old one is the second layer alone
  fill.adds = false;
  const auto alone = relit(path("key.sft"), fill, "alone.sft");
  const glm::dvec3 sum = power(alone) + power(surfelsOf(path("key.sft")));
  EXPECT_NEAR(power(found).g / sum.g, 1, 1e-6);
  EXPECT_THAT(readSceneInfo(path("alone.sft"))->provenance, HasSubstr("\"relight\""));
}

TEST_F(Relighting, WithoutMeshesEveryKindOfSurfelGetsTheFormula) {
  Surfel disk;
  disk.normal = {0, 1, 0};
  disk.radius = 0.1f;
  disk.area = 0.03f;
  disk.albedo = {.5f, .25f, 1};
  std::vector<Surfel> surfels(3, disk);
  surfels[1].position = {0, 0, 1};
  surfels[1].flags = kSurfelTwoSided;
  surfels[2].position = {0, 0, -1};
  surfels[2].normal = glm::vec3(0);
  surfels[2].flags = kSurfelSphere;
  const std::string scene =
      index(cloudOf(surfels, {true, true, true, false, true, true}), "few.sft", true);
  RelightOptions options;
  options.lights.directionals.push_back({{0, -4, 3}, glm::vec3(10)});
  for (const Surfel& surfel : relit(scene, options)) {
    const float received = surfel.isSphere() ? 2.5f : surfel.isTwoSided() ? 4 : 8;
    EXPECT_NEAR(surfel.radiosity.r, .5f * received, 1e-5f);
    EXPECT_NEAR(surfel.radiosity.b, received, 1e-5f);
  }
  EXPECT_THAT(notes_.notes, ::testing::Contains(HasSubstr("no shadows")));

  options.lights.directionals.clear();
  options.lights.points.push_back({{0, 3, 4}, glm::vec3(50)});
  for (const Surfel& surfel : relit(scene, options, "point.sft")) {
    const double z = 4 - double(surfel.position.z), d = std::sqrt(9 + z * z);
    const double cosine = surfel.isSphere() ? 0.25 : (surfel.isTwoSided() ? 0.5 : 1) * 3 / d;
    EXPECT_NEAR(surfel.radiosity.b, 50 * cosine / (d * d), 1e-5);
  }
}

TEST_F(Relighting, OtherMeshesCastTheShadows) {
  const std::string floor = write("floor.ply", floorPly(4));
  SampleOptions dark;
  dark.count = 2000;
  const std::string scene = sampled(floor, "floor.sft", dark, true);
  RelightOptions options;
  options.lights.directionals.push_back({{0, -1, 0}, glm::vec3(2)});
  options.meshes = {write(
      "caster.ply", plyText({{-1, 1, -1}, {0, 1, -1}, {0, 1, 1}, {-1, 1, 1}}, {{0, 1, 2, 3}}))};
  for (const Surfel& surfel : relit(scene, options)) {
    const glm::vec3& p = surfel.position;
    const bool is_under = p.x > -1 && p.x < 0 && std::abs(p.z) < 1;
    EXPECT_NEAR(surfel.radiosity.r, is_under ? 0 : 1, 1e-3f) << p.x << " " << p.z;
  }
  // From so far above that the rays start over the caster
  options.shadow_bias = 1.5;
  (void)relit(scene, options, "biased.sft");
  EXPECT_EQ(stats_.lit_surfels, stats_.surfels);
}

TEST_F(Relighting, ThreadsDoNotChangeTheBytes) {
  const std::string mesh = boxOnFloor();
  SampleOptions dark;
  dark.count = 10000;
  const std::string scene = sampled(mesh, "dark.sft", dark);
  RelightOptions options;
  options.lights.areas.push_back({{0, 3, 0}, {1, 0, 0}, {0, 0, 1}, glm::vec3(2)});
  options.meshes = {mesh};
  options.threads = 1;
  (void)relit(scene, options, "one.sft");
  options.threads = 4;
  (void)relit(scene, options, "four.sft");
  EXPECT_EQ(read(path("one.sft")), read(path("four.sft")));
  // Another light is another file
  options.lights.areas[0].radiance = glm::vec3(2.001f);
  (void)relit(scene, options, "other.sft");
  EXPECT_NE(SceneFile::open(path("other.sft"))->pages().identity(),
            SceneFile::open(path("one.sft"))->pages().identity());
}

TEST_F(Relighting, WhatCannotWorkIsRefused) {
  SampleOptions dark;
  dark.count = 100;
  const std::string scene = sampled(write("floor.ply", floorPly(4)), "floor.sft", dark);
  RelightOptions options;
  EXPECT_THAT(refusal(scene, options).message(), HasSubstr("--light-point"));
  options.lights = sharpLights();
  options.gain = -1;
  EXPECT_EQ(refusal(scene, options).code(), StatusCode::kInvalidArgument);
  options.gain = 1;
  options.shadow_bias = NAN;
  EXPECT_EQ(refusal(scene, options).code(), StatusCode::kInvalidArgument);
  options.shadow_bias = 0;
  options.ground.enabled = true;
  EXPECT_THAT(refusal(scene, options).message(), HasSubstr("--mesh"));
  options.ground.enabled = false;
  options.lights.with_emission = true;
  EXPECT_THAT(refusal(scene, options).message(), HasSubstr("--add"));
  options.lights.with_emission = false;
  EXPECT_EQ(relightScene(scene, scene, options, notes_).status().code(),
            StatusCode::kInvalidArgument);

  Surfel surfel;
  surfel.normal = {0, 1, 0};
  surfel.radius = surfel.area = 1;
  const std::string bare = index(cloudOf({surfel}, {true, true, true}), "bare.sft");
  const Status no_albedo = refusal(bare, options);
  EXPECT_EQ(no_albedo.code(), StatusCode::kCorruption);
  EXPECT_THAT(no_albedo.message(), HasSubstr("albedo_r"));

  CancelAfter cancelled(0);
  SampleOptions many;
  many.count = 20000;
  const std::string large = sampled(boxOnFloor(), "large.sft", many);
  EXPECT_EQ(relightScene(large, path("none.sft"), options, cancelled).status().code(),
            StatusCode::kInterrupted);
  EXPECT_FALSE(std::filesystem::exists(path("none.sft")));
}

}  // namespace
}  // namespace surfeit
