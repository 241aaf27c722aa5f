// Curves of Houdini's geometry are the strands of a hair file.
#include <gmock/gmock.h>

#include <cstdint>
#include <numbers>
#include <string>
#include <vector>

#include "io/bgeo_json_bytes.h"
#include "sample/hair_bytes.h"
#include "sample/meshes/mesh.h"
#include "sample/scene_files.h"
#include "surfeit/sample.h"

namespace surfeit {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;

using Json = BgeoJsonBytes;

// An attribute of one value, or three, for each point.
std::string bgeoNumbers(const Json& json, const std::string& name, int size,
                        const std::vector<float>& values) {
  return json.attribute(
      name, "numeric",
      json.values(size, "fpreal32",
                  json.paged(1024, json.text("rawpagedata") + json.floats(values))));
}

std::string bgeoPlaces(const Json& json, const std::vector<glm::vec3>& points) {
  std::vector<float> values;
  for (const glm::vec3& point : points) {
    values.insert(values.end(), {point.x, point.y, point.z});
  }
  return bgeoNumbers(json, "P", 3, values);
}

std::vector<std::int32_t> bgeoIndices(std::size_t count) {
  std::vector<std::int32_t> numbers;
  for (std::size_t i = 0; i < count; ++i) numbers.push_back(std::int32_t(i));
  return numbers;
}

std::string bgeoTopology(const Json& json, const std::vector<std::int32_t>& points) {
  return json.text("pointref") + json.list(json.text("indices"), json.integers(points));
}

std::string bgeoPrimitive(const Json& json, const std::string& type, const std::string& body) {
  return json.list(json.list(json.text("type"), json.text(type)), body);
}

// A run of curves, with these numbers of vertices.
std::string bgeoRun(const Json& json, const std::string& type, int count,
                    const std::vector<std::int32_t>& vertices, const std::string& key = "nvertices",
                    int start = 0) {
  return bgeoPrimitive(
      json, type,
      json.list(json.text("startvertex"), json.integer(start), json.text("nprimitives"),
                json.integer(count), json.text(key), json.integers(vertices)));
}

class HoudiniCurvesMesh : public SceneFiles {
 protected:
  std::vector<Surfel> sample(const std::string& file, std::uint64_t strands) {
    SampleOptions options;
    options.count = 5000;
    options.surroundings.curves.strands = strands;
    const auto stats = sampleMeshes({file}, path("out.ply"), options, notes_);
    EXPECT_TRUE(stats.ok()) << stats.status().message();
    return stats.ok() ? readCloud(path("out.ply")) : std::vector<Surfel>();
  }
  std::string messageOf(const std::string& bytes, const std::string& name = "a.bgeo",
                        const CurveOptions& curves = {}) {
    const auto mesh = loadMeshes({write(name, bytes)}, glm::vec3(0.5f), notes_, curves);
    EXPECT_FALSE(mesh.ok());
    return mesh.ok() ? std::string() : mesh.status().message();
  }
  // A geometry of the hair's points and widths, white as hair files are, with these primitives.
  static std::string geometryOf(const Json& json, const Hair& hair, const std::string& primitives) {
    return json.geometry(
        std::int32_t(hair.points.size()),
        bgeoPlaces(json, hair.points) + bgeoNumbers(json, "width", 1, hair.thickness) +
            bgeoNumbers(json, "Cd", 3, std::vector<float>(3 * hair.points.size(), 1.f)),
        bgeoTopology(json, bgeoIndices(hair.points.size())), primitives);
  }

  RecordedNotes notes_;
};

// Strands of different lengths, with widths of their own.
Hair unevenTuft() {
  Hair hair = tuft(300);
  std::mt19937 random(3);
  for (std::size_t i = 0; i < hair.points.size(); ++i) {
    hair.thickness.push_back(0.01f + 0.01f * float(random() % 100) / 100);
  }
  // The first five strands become one
  hair.segments.erase(hair.segments.begin(), hair.segments.begin() + 5);
  hair.segments.insert(hair.segments.begin(), 24);
  hair.strands = std::uint32_t(hair.segments.size());
  return hair;
}

// However Houdini writes them down.
TEST_F(HoudiniCurvesMesh, CurvesHaveTheSurfelsOfTheSameStrandsInAHairFile) {
  const Hair hair = unevenTuft();
  const std::string hair_file = write("a.hair", hair.bytes());
  for (const std::uint64_t strands : {0, 40}) {
    const std::vector<Surfel> expected = sample(hair_file, strands);
    ASSERT_GT(expected.size(), 1000u);
    for (const bool is_big_endian : {false, true}) {
      const Json json{is_big_endian};
      std::vector<std::int32_t> counts;
      for (const std::uint16_t segments : hair.segments) counts.push_back(segments + 1);
      const int count = int(counts.size());
      std::string singles, old_run;
      std::int32_t vertex = 0;
      for (const std::int32_t corners : counts) {
        std::vector<std::int32_t> vertices;
        for (std::int32_t k = 0; k < corners; ++k) vertices.push_back(vertex++);
        singles += bgeoPrimitive(json, "Poly",
                                 json.list(json.text("vertex"), json.integers(vertices),
                                           json.text("closed"), std::string("\x30")));
        old_run += json.list(json.integers(vertices));
      }
      const std::string old_head =
          json.list(json.text("type"), json.text("run"), json.text("runtype"), json.text("Poly"),
                    json.text("varyingfields"), json.list(json.text("vertex")),
                    json.text("uniformfields"), "{" + json.text("closed") + "\x30}");
      const std::string forms[] = {
          bgeoRun(json, "PolygonCurve_run", count, counts),
          bgeoRun(json, "PolygonCurve_run", count, {25, 1, 5, count - 1}, "nvertices_rle"),
          bgeoRun(json, "PolygonCurve_run", 1, {25}) +
              bgeoRun(json, "PolygonCurve_run", count - 1, {5, count - 1}, "nvertices_rle", 25),
          bgeoPrimitive(json, "c_r",
                        json.list(json.text("s_v"), json.integer(0), json.text("n_p"),
                                  json.integer(count), json.text("r_v"),
                                  json.list(json.integer(25), json.integer(1), json.integer(5),
                                            json.integer(count - 1)))),
          singles,
          json.list(old_head, json.list(old_run)),
      };
      int form = 0;
      for (const std::string& primitives : forms) {
        const std::string file = write("a.bgeo", geometryOf(json, hair, primitives));
        EXPECT_TRUE(areEqual(sample(file, strands), expected)) << form << is_big_endian << strands;
        ++form;
      }
    }
  }
  for (const std::string& note : notes_.notes) EXPECT_THAT(note, HasSubstr("no light"));
}

// Points stand in any order, some are shared; pscale is a radius, Cd a linear albedo.
TEST_F(HoudiniCurvesMesh, AttributesOfPointsFollowTheCurves) {
  const Json json;
  const std::vector<glm::vec3> points = {{0, 2, 0}, {9, 9, 9}, {0, 0, 0}, {0, 1, 0}, {3, 0, 0}};
  const std::string attributes =
      bgeoPlaces(json, points) + bgeoNumbers(json, "pscale", 1, {0.1f, 7, 0.3f, 0.2f, 0.4f}) +
      bgeoNumbers(json, "Cd", 3,
                  {0.1f, 0.2f, 0.3f, 7, 7, 7, 0.4f, 0.5f, 0.6f, 0.7f, 0.8f, 0.9f, 0, 1, 0.5f});
  write("a.bgeo", json.geometry(5, attributes, bgeoTopology(json, {2, 3, 0, 2, 4}),
                                bgeoRun(json, "PolygonCurve_run", 2, {3, 2})));
  const auto mesh = loadMeshes({path("a.bgeo")}, glm::vec3(0.5f), notes_);
  ASSERT_TRUE(mesh.ok()) << mesh.status().message();
  ASSERT_EQ(notes_.notes.size(), 1u);
  EXPECT_THAT(notes_.notes[0], HasSubstr("1 points that no curve has"));
  ASSERT_EQ(mesh->position.size(), 10u);
  EXPECT_EQ(mesh->triangle.size(), 6u);
  const std::size_t order[] = {2, 3, 0, 2, 4};
  const float radius[] = {0.3f, 0.2f, 0.1f, 0.3f, 0.4f};
  const glm::vec3 color[] = {
      {0.4f, 0.5f, 0.6f}, {0.7f, 0.8f, 0.9f}, {0.1f, 0.2f, 0.3f}, {0.4f, 0.5f, 0.6f}, {0, 1, 0.5f}};
  for (std::size_t i = 0; i < 5; ++i) {
    const glm::vec3 a = mesh->position[2 * i], b = mesh->position[2 * i + 1];
    EXPECT_NEAR(glm::distance(0.5f * (a + b), points[order[i]]), 0, 1e-6);
    EXPECT_NEAR(glm::distance(a, b), 2 * radius[i] * float(std::numbers::pi / 2), 1e-6);
    EXPECT_EQ(mesh->color[2 * i], color[i]);
    EXPECT_EQ(mesh->color[2 * i + 1], color[i]);
  }
  // Without Cd the albedo of meshes without one; the width of all strands
  CurveOptions curves;
  curves.width = 0.5;
  write("b.bgeo", json.geometry(5, bgeoPlaces(json, points), bgeoTopology(json, {2, 3, 0, 2, 4}),
                                bgeoRun(json, "PolygonCurve_run", 2, {3, 2})));
  const auto plain = loadMeshes({path("b.bgeo")}, glm::vec3(0.25f), notes_, curves);
  ASSERT_TRUE(plain.ok()) << plain.status().message();
  EXPECT_EQ(plain->color[3], glm::vec3(0.25f));
  EXPECT_NEAR(glm::distance(plain->position[0], plain->position[1]),
              0.5f * float(std::numbers::pi / 2), 1e-6);
}

TEST_F(HoudiniCurvesMesh, WhatIsNoCurveIsTold) {
  const Json json;
  const Hair hair = unevenTuft();
  const std::string others =
      bgeoRun(json, "Polygon_run", 3, {4, 3}, "nvertices_rle") +
      bgeoPrimitive(json, "Sphere", json.list(json.text("vertex"), json.integer(0))) +
      bgeoRun(json, "PolygonCurve_run", 1, {25});
  ASSERT_TRUE(
      loadMeshes({write("a.bgeo", geometryOf(json, hair, others))}, glm::vec3(0.5f), notes_).ok());
  ASSERT_EQ(notes_.notes.size(), 3u);
  EXPECT_THAT(notes_.notes[0], HasSubstr("3 closed polygons and curves are left out"));
  EXPECT_THAT(notes_.notes[1], HasSubstr("other primitives are left out: 1 Sphere"));
  EXPECT_THAT(notes_.notes[2], HasSubstr("points that no curve has"));
}

TEST_F(HoudiniCurvesMesh, WhatCannotBeReadIsRefused) {
  const Json json;
  const Hair hair = unevenTuft();
  const auto refusal = [&](const std::string& primitives) {
    return messageOf(geometryOf(json, hair, primitives));
  };
  const auto spline = [&](const char* type, int order, const std::vector<std::int32_t>& vertices,
                          const std::vector<float>& knots) {
    return bgeoPrimitive(json, type,
                         json.list(json.text("vertex"), json.integers(vertices),
                                   json.text("closed"), std::string("\x30"), json.text("basis"),
                                   json.list(json.text("order"), json.integer(order),
                                             json.text("knots"), json.floats(knots))));
  };
  EXPECT_THAT(refusal(spline("NURBCurve", 4, {0, 1}, {})), HasSubstr("curve 0: 2 vertices"));
  EXPECT_THAT(refusal(spline("NURBCurve", 3, {0, 1, 2}, {0, 1, 2, 3, 4, 5, 6})),
              HasSubstr("7 knots, expected 6"));
  EXPECT_THAT(refusal(spline("NURBCurve", 3, {0, 1, 2}, {0, 0, 0, 1, 1, .5f})),
              HasSubstr("do not rise"));
  EXPECT_THAT(refusal(spline("BezierCurve", 4, {0, 1, 2, 3, 4}, {})),
              HasSubstr("expected a multiple of 3"));
  EXPECT_THAT(refusal(spline("NURBCurve", 99, {0, 1, 2}, {})), HasSubstr("order 99"));
  EXPECT_THAT(refusal(""), HasSubstr("found no open curves"));
  EXPECT_THAT(refusal(bgeoRun(json, "Polygon_run", 1, {4})), HasSubstr("found no open curves"));
  EXPECT_THAT(refusal(bgeoRun(json, "PolygonCurve_run", 2, {4})), HasSubstr("a run of 2 curves"));
  EXPECT_THAT(refusal(bgeoRun(json, "PolygonCurve_run", 1, {9999})), HasSubstr("9999 vertices"));
  EXPECT_THAT(refusal(bgeoRun(json, "PolygonCurve_run", 1, {0, 1 << 30}, "nvertices_rle")),
              HasSubstr("0 vertices"));
  EXPECT_THAT(refusal(bgeoRun(json, "PolygonCurve_run", 1, {-1})), HasSubstr("found -1"));
  EXPECT_THAT(messageOf(json.geometry(2, bgeoPlaces(json, {{0, 0, 0}, {0, 1, 0}}),
                                      bgeoTopology(json, {0, 1}),
                                      bgeoRun(json, "PolygonCurve_run", 1, {2}))),
              HasSubstr("--curve-width"));
  EXPECT_THAT(messageOf(json.geometry(2, bgeoPlaces(json, {{0, 0, 0}, {0, 1, 0}}),
                                      bgeoTopology(json, {0, 2}),
                                      bgeoRun(json, "PolygonCurve_run", 1, {2}))),
              HasSubstr("point 2, expected less than 2"));
  EXPECT_THAT(messageOf("BgeoV\0\0\0\5", "old.bgeo"), HasSubstr("file ends early"));
  EXPECT_THAT(messageOf("PGEOMETRY V5\n", "old.geo"), HasSubstr("expected 'NPoints'"));
  EXPECT_THAT(messageOf("[\n\t\"fileversion\"", "text.geo"), HasSubstr("as text"));
  EXPECT_THAT(messageOf("scf1", "a.bgeo.sc"), HasSubstr(".bgeo.sc is not read"));
}

TEST_F(HoudiniCurvesMesh, EveryTruncationIsRefusedAndNoFlippedByteDoesHarm) {
  const Json json;
  Hair hair = tuft(20);
  hair.thickness.assign(hair.points.size(), 0.02f);
  const std::string good =
      geometryOf(json, hair, bgeoRun(json, "PolygonCurve_run", 20, {5, 20}, "nvertices_rle"));
  ASSERT_TRUE(loadMeshes({write("good.bgeo", good)}, glm::vec3(0.5f), notes_).ok());
  for (std::size_t size = 0; size < good.size(); size += size < 300 ? 1 : 13) {
    const auto mesh =
        loadMeshes({write("cut.bgeo", good.substr(0, size))}, glm::vec3(0.5f), notes_);
    ASSERT_FALSE(mesh.ok()) << size;
  }
  for (std::size_t at = 0; at < good.size(); at += at < 300 ? 1 : 7) {
    for (const char flip : {'\x01', '\x80', '\xff'}) {
      std::string bad = good;
      bad[at] = char(bad[at] ^ flip);
      const auto mesh = loadMeshes({write("bad.bgeo", bad)}, glm::vec3(0.5f), notes_);
      if (mesh.ok()) continue;
      EXPECT_THAT(mesh.status().message(), HasSubstr("bad.bgeo"));
    }
  }
}

// The end of a name counts, not what stands within.
TEST_F(HoudiniCurvesMesh, NamesOfMeshesMayHoldItsExtension) {
  write("wall.geometry.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n");
  const auto mesh = loadMeshes({path("wall.geometry.obj")}, glm::vec3(0.5f), notes_);
  ASSERT_TRUE(mesh.ok()) << mesh.status().message();
  EXPECT_EQ(mesh->triangle.size(), 1u);
}

}  // namespace
}  // namespace surfeit
