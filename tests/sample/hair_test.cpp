// Hair files and lines of OBJ files as ribbons.
#include <gmock/gmock.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <glm/geometric.hpp>
#include <numbers>
#include <random>
#include <string>
#include <vector>

#include "sample/hair_bytes.h"
#include "sample/meshes/curves.h"
#include "sample/scene_files.h"
#include "surfeit/sample.h"

namespace surfeit {
namespace {

using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;

class HairMesh : public SceneFiles {
 protected:
  static double strandArea(const Hair& hair) {
    double area = 0;
    std::size_t at = 0;
    for (const std::uint16_t segments : hair.segments) {
      for (int k = 0; k < segments; ++k, ++at) {
        const float a = hair.thickness.empty() ? hair.default_thickness : hair.thickness[at];
        const float b = hair.thickness.empty() ? hair.default_thickness : hair.thickness[at + 1];
        area += 0.5 * double(a + b) * double(glm::distance(hair.points[at], hair.points[at + 1]));
      }
      ++at;
    }
    return area;
  }

  std::vector<Surfel> sample(const std::string& file, const SampleOptions& options) {
    const auto stats = sampleMeshes({file}, path("out.ply"), options, notes_);
    EXPECT_TRUE(stats.ok()) << stats.status().message();
    if (!stats.ok()) return {};
    stats_ = *stats;
    return readCloud(path("out.ply"));
  }
  // Of the surfels, seen from that direction.
  static double projectedArea(const std::vector<Surfel>& surfels, const glm::vec3& from) {
    double area = 0;
    for (const Surfel& surfel : surfels) {
      area += double(surfel.area) * double(std::abs(glm::dot(surfel.normal, from)));
    }
    return area;
  }
  std::string messageOf(const std::string& file, const CurveOptions& curves = {}) {
    const auto mesh = loadMeshes({file}, glm::vec3(0.5f), notes_, curves);
    EXPECT_FALSE(mesh.ok());
    return mesh.ok() ? std::string() : mesh.status().message();
  }

  RecordedNotes notes_;
  SampleStats stats_;
};

TEST_F(HairMesh, FilesAreReadAsTheyWereWritten) {
  Hair hair;
  hair.strands = 2;
  hair.segments = {2, 1};
  hair.points = {{0, 0, 0}, {0, 1, 0}, {0, 2, 0}, {5, 0, 0}, {5, 0, 3}};
  hair.thickness = {0.1f, 0.1f, 0.1f, 0.2f, 0.4f};
  hair.transparency = {0, 0, 0, 0.5f, 0.5f};
  hair.colors = {{1, 0, 0}, {1, 0, 0}, {1, 0, 0}, {0, 0.5f, 0}, {0, 0.5f, 0}};
  const auto mesh = loadMeshes({write("a.hair", hair.bytes())}, glm::vec3(0.5f), notes_);
  ASSERT_TRUE(mesh.ok()) << mesh.status().message();
  EXPECT_TRUE(notes_.notes.empty());
  ASSERT_EQ(mesh->triangle.size(), 6u);
  ASSERT_EQ(mesh->position.size(), 10u);
  for (std::size_t i = 0; i < 5; ++i) {
    // Both sides of a ribbon stand about the point, pi / 2 times as far apart as it is wide
    const glm::vec3 a = mesh->position[2 * i], b = mesh->position[2 * i + 1];
    EXPECT_NEAR(glm::distance(0.5f * (a + b), hair.points[i]), 0, 1e-6);
    const float width = hair.thickness[i] * (1 - hair.transparency[i]);
    EXPECT_NEAR(glm::distance(a, b), width * float(std::numbers::pi / 2), 1e-6);
    EXPECT_NEAR(mesh->color[2 * i].x, i < 3 ? 1 : 0, 1e-6);
    EXPECT_NEAR(mesh->color[2 * i].y, i < 3 ? 0 : 0.2140411f, 1e-6);  // of sRGB .5
  }
}

TEST_F(HairMesh, DefaultsStandForArraysThatAreNotThere) {
  Hair hair;
  hair.strands = 3;
  hair.default_segments = 1;
  hair.default_thickness = 0.3f;
  hair.points = {{0, 0, 0}, {0, 1, 0}, {1, 0, 0}, {1, 1, 0}, {2, 0, 0}, {2, 1, 0}};
  const auto mesh = loadMeshes({write("a.hair", hair.bytes())}, glm::vec3(0.5f), notes_);
  ASSERT_TRUE(mesh.ok()) << mesh.status().message();
  double area = 0;
  for (std::uint32_t i = 0; i < mesh->triangle.size(); ++i) area += triangleArea(*mesh, i);
  EXPECT_NEAR(area, 3 * 0.3 * std::numbers::pi / 2, 1e-6);
  CurveOptions wider;
  wider.width = 0.6;
  const auto wide = loadMeshes({path("a.hair")}, glm::vec3(0.5f), notes_, wider);
  ASSERT_TRUE(wide.ok());
  area = 0;
  for (std::uint32_t i = 0; i < wide->triangle.size(); ++i) area += triangleArea(*wide, i);
  EXPECT_NEAR(area, 3 * 0.6 * std::numbers::pi / 2, 1e-6);
}

// A round strand of length l and width w looks l w sin(angle) large; over all directions pi / 4 of
// l w.
TEST_F(HairMesh, SurfelsLookAsLargeAsRoundStrandsFromEveryDirection) {
  const Hair hair = tuft(4000);
  SampleOptions options;
  options.count = 100'000;
  const std::vector<Surfel> surfels = sample(write("a.hair", hair.bytes()), options);
  for (const glm::vec3 from : {glm::vec3(1, 0, 0), glm::vec3(0, 1, 0), glm::vec3(0, 0, 1),
                               glm::normalize(glm::vec3(1, 2, -1))}) {
    double expected = 0;
    for (std::size_t i = 0; i + 1 < hair.points.size(); ++i) {
      if (i % 5 == 4) continue;
      const glm::vec3 along = hair.points[i + 1] - hair.points[i];
      expected += double(hair.default_thickness * glm::length(glm::cross(along, from)));
    }
    EXPECT_NEAR(projectedArea(surfels, from) / expected, 1, 0.02);
    EXPECT_NEAR(expected / strandArea(hair), std::numbers::pi / 4, 0.02);
  }
  for (const Surfel& surfel : surfels) ASSERT_TRUE(surfel.isTwoSided());
}

TEST_F(HairMesh, FewerStrandsAreWiderAndKeepTheArea) {
  Hair hair = tuft(4000);
  std::mt19937 random(9);
  for (std::size_t i = 0; i < hair.points.size(); ++i) {
    hair.thickness.push_back(0.01f + 0.01f * float(random() % 100) / 100);
  }
  SampleOptions options;
  options.count = 50'000;
  const std::string file = write("a.hair", hair.bytes());
  const std::vector<Surfel> all = sample(file, options);
  const std::uint64_t triangles = stats_.triangles;
  const double area = stats_.area;
  EXPECT_EQ(triangles, 4000u * 8);
  EXPECT_NEAR(area / (strandArea(hair) * std::numbers::pi / 2), 1, 0.02);
  for (const std::uint64_t kept : {1000, 100}) {
    options.surroundings.curves.strands = kept;
    const std::vector<Surfel> fewer = sample(file, options);
    EXPECT_EQ(stats_.triangles, kept * 8);
    EXPECT_NEAR(stats_.area / area, 1, 0.02);
    const double part = kept == 1000 ? 0.06 : 0.2;  // as many strands look in this direction
    EXPECT_NEAR(projectedArea(fewer, {0, 0, 1}) / projectedArea(all, {0, 0, 1}), 1, part);
  }
}

TEST(StrandChoice, KeepsOneOfEachRun) {
  for (const std::uint64_t count : {1, 7, 100, 1000}) {
    for (const std::uint64_t kept : {1, 3, 7, 99, 1000, 5000}) {
      const StrandChoice choice(count, kept);
      std::uint64_t found = 0;
      for (std::uint64_t i = 0; i < count; ++i) found += choice.keeps(i);
      EXPECT_EQ(found, std::min(count, kept));
    }
  }
}

TEST_F(HairMesh, EveryTruncationIsRefusedAndNoFlippedByteDoesHarm) {
  Hair hair = tuft(20);
  hair.thickness.assign(hair.points.size(), 0.02f);
  hair.colors.assign(hair.points.size(), glm::vec3(0.5f));
  const std::string good = hair.bytes();
  for (std::size_t size = 0; size < good.size(); size += size < 400 ? 1 : 97) {
    const auto mesh =
        loadMeshes({write("cut.hair", good.substr(0, size))}, glm::vec3(0.5f), notes_);
    ASSERT_FALSE(mesh.ok()) << size;
  }
  for (std::size_t at = 0; at < good.size(); at += at < 400 ? 1 : 53) {
    for (const char flip : {'\x01', '\x80', '\xff'}) {
      std::string bad = good;
      bad[at] = char(bad[at] ^ flip);
      const auto mesh = loadMeshes({write("bad.hair", bad)}, glm::vec3(0.5f), notes_);
      if (mesh.ok()) continue;
      EXPECT_THAT(mesh.status().message(), HasSubstr("bad.hair"));
    }
  }
}

TEST_F(HairMesh, WhatIsWrongIsTold) {
  Hair hair = tuft(20);
  hair.segments[3] = 5;
  EXPECT_THAT(messageOf(write("a.hair", hair.bytes())), HasSubstr("expected 100 in all strands"));
  hair = tuft(20);
  std::string bytes = hair.bytes();
  const std::uint32_t many = 0xffffffff;
  std::memcpy(bytes.data() + 8, &many, 4);
  EXPECT_THAT(messageOf(write("a.hair", bytes)), HasSubstr("expected 51539"));
  hair = tuft(20);
  hair.default_thickness = 0;
  EXPECT_THAT(messageOf(write("a.hair", hair.bytes())),
              HasSubstr("an area of 0, expected a finite one above 0: a thickness (--curve-width"));
  hair = tuft(20);
  hair.points[7].x = std::nanf("");
  EXPECT_THAT(messageOf(write("a.hair", hair.bytes())),
              AllOf(HasSubstr("a.hair: strand 1: found a point (nan, "),
                    HasSubstr("expected finite values")));
  // In a strand that is kept or not, and in the header
  hair = tuft(20);
  hair.thickness.assign(hair.points.size(), 0.02f);
  hair.thickness[7] = -.5f;
  const std::string said = "of width -0.5, expected a width of 0 or more (--curve-width gives one)";
  for (const std::uint64_t strands : {0, 1, 2}) {
    CurveOptions curves;
    curves.strands = strands;
    const auto mesh = loadMeshes({write("a.hair", hair.bytes())}, glm::vec3(1), notes_, curves);
    EXPECT_THAT(mesh.status().message(), AllOf(HasSubstr("a.hair: strand 1: "), HasSubstr(said)));
  }
  hair = tuft(20);
  hair.default_thickness = -.5f;
  EXPECT_THAT(messageOf(write("a.hair", hair.bytes())),
              AllOf(HasSubstr("strand 0"), HasSubstr(said)));
  hair = tuft(20);
  const auto mesh = loadMeshes({write("a.hair", hair.bytes() + "more")}, glm::vec3(1), notes_);
  EXPECT_TRUE(mesh.ok());
  EXPECT_THAT(notes_.notes.back(), HasSubstr("4 bytes behind the last array"));
}

TEST_F(HairMesh, ColorsAndTransparenciesThatAreCutAreTold) {
  Hair hair = tuft(2);
  hair.colors.assign(hair.points.size(), glm::vec3(0, .5f, 1));
  hair.colors[3].y = 1.5f;
  hair.transparency.assign(hair.points.size(), 0);
  hair.transparency[4] = -.5f;
  ASSERT_TRUE(loadMeshes({write("a.hair", hair.bytes())}, glm::vec3(1), notes_).ok());
  EXPECT_THAT(notes_.notes, ElementsAre(HasSubstr("a.hair: 2 points have a color or transp")));
  notes_.notes.clear();
  hair = tuft(2);
  hair.default_color = {255, 0, 0};
  ASSERT_TRUE(loadMeshes({write("a.hair", hair.bytes())}, glm::vec3(1), notes_).ok());
  EXPECT_THAT(notes_.notes, ElementsAre(HasSubstr("10 points have a color")));
}

TEST_F(HairMesh, LinesOfObjFilesAreCurvesWhereTheyGetAWidth) {
  const std::string file = write("a.obj",
                                 "v 0 0 0\nv 0 1 0\nv 0 2 0\nv 1 0 0\nv 1 3 0\nv 5 0 0\n"
                                 "v 6 0 0\nv 5 0 -1\nl 1 2 3\nl 4 5\nf 6 7 8\n");
  const auto plain = loadMeshes({file}, glm::vec3(0.5f), notes_);
  ASSERT_TRUE(plain.ok());
  EXPECT_EQ(plain->triangle.size(), 1u);
  EXPECT_FALSE(plain->hasTwoSides());
  EXPECT_THAT(notes_.notes.back(), HasSubstr("--curve-width gives lines one"));
  CurveOptions curves;
  curves.width = 0.1;
  const auto mesh = loadMeshes({file}, glm::vec3(0.5f), notes_, curves);
  ASSERT_TRUE(mesh.ok()) << mesh.status().message();
  EXPECT_EQ(mesh->triangle.size(), 7u);
  double area = 0;
  for (std::uint32_t i = 0; i < mesh->triangle.size(); ++i) {
    if (mesh->materials[mesh->triangle_material[i]].is_two_sided) area += triangleArea(*mesh, i);
  }
  EXPECT_NEAR(area, 5 * 0.1 * std::numbers::pi / 2, 1e-6);
}

}  // namespace
}  // namespace surfeit
