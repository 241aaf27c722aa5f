// NURBS and Bezier curves of Houdini, and geometry of version 5, binary and as text.
#include <fmt/format.h>
#include <gmock/gmock.h>

#include <cmath>
#include <cstdint>
#include <string>
#include <vector>

#include "io/bgeo_json_bytes.h"
#include "sample/meshes/mesh.h"
#include "sample/meshes/spline.h"
#include "sample/scene_files.h"

namespace surfeit {
namespace {

using ::testing::Contains;
using ::testing::HasSubstr;

std::vector<CurvePoint> controlOf(const std::vector<glm::dvec3>& places) {
  std::vector<CurvePoint> control;
  for (const glm::dvec3& place : places) control.push_back({place, 1 + place.x, glm::vec3(0.5f)});
  return control;
}

std::vector<CurvePoint> along(const HoudiniBasis& basis, const std::vector<glm::dvec3>& places,
                              const std::vector<float>& weights = {}) {
  std::vector<CurvePoint> points;
  const Status status = evaluateSpline(basis, controlOf(places), weights, points);
  EXPECT_TRUE(status.ok()) << status.message();
  return points;
}

HoudiniBasis nurbs(std::uint32_t order, std::vector<float> knots, bool has_ends = true) {
  return {HoudiniBasis::Kind::kNurbs, order, has_ends, std::move(knots)};
}
HoudiniBasis bezier(std::uint32_t order) { return {HoudiniBasis::Kind::kBezier, order, true, {}}; }

TEST(Spline, RationalQuadraticsAreArcsOfCircles) {
  const float half = float(std::sqrt(0.5));
  for (const HoudiniBasis& basis : {nurbs(3, {0, 0, 0, 1, 1, 1}), nurbs(3, {0, 1}), bezier(3)}) {
    const std::vector<CurvePoint> points =
        along(basis, {{1, 0, 0}, {1, 1, 0}, {0, 1, 0}}, {1, half, 1});
    ASSERT_EQ(points.size(), std::size_t(kSplineSteps) + 1);
    for (const CurvePoint& point : points) {
      EXPECT_NEAR(std::hypot(point.position.x, point.position.y), 1, 1e-7);
    }
    EXPECT_NEAR(points.back().position.y, 1, 1e-12);
  }
}

TEST(Spline, CubicsOfOneSpanAreBezierCurves) {
  const std::vector<glm::dvec3> places = {{0, 0, 0}, {1, 2, 0}, {3, 2, 1}, {4, 0, 0}};
  const std::vector<CurvePoint> one = along(nurbs(4, {0, 1}), places),
                                other = along(bezier(4), places);
  ASSERT_EQ(one.size(), other.size());
  for (std::size_t i = 0; i < one.size(); ++i) {
    EXPECT_NEAR(glm::length(one[i].position - other[i].position), 0, 1e-12);
    EXPECT_NEAR(one[i].width, 1 + one[i].position.x, 1e-12);  // blended as places are
  }
  // The middle of a Bezier curve: (p0 + 3 p1 + 3 p2 + p3) / 8
  EXPECT_NEAR(one[kSplineSteps / 2].position.y, 1.5, 1e-12);
}

// B-splines reproduce lines: vertices at the Greville places of the knots.
TEST(Spline, SplinesOfVerticesOnALineRunEvenly) {
  const HoudiniBasis basis = nurbs(4, {0, 1, 2, 3});
  const std::vector<CurvePoint> points =
      along(basis, {{0, 0, 0}, {1. / 3, 0, 0}, {1, 0, 0}, {2, 0, 0}, {8. / 3, 0, 0}, {3, 0, 0}});
  ASSERT_EQ(points.size(), 3u * kSplineSteps + 1);
  for (std::size_t i = 0; i < points.size(); ++i) {
    EXPECT_NEAR(points[i].position.x, double(i) / kSplineSteps, 1e-12);
  }
  // Without ends it runs from the second to the last but one of these
  const std::vector<CurvePoint> open =
      along(nurbs(4, {1, 2, 3, 4, 5, 6}, false), {{0, 0, 0}, {1, 0, 0}, {2, 0, 0}, {3, 0, 0}});
  ASSERT_EQ(open.size(), std::size_t(kSplineSteps) + 1);
  EXPECT_NEAR(open.front().position.x, 1, 1e-12);
  EXPECT_NEAR(open.back().position.x, 2, 1e-12);
}

// --- Files

std::string words(const std::vector<std::int32_t>& numbers) {
  std::string bytes;
  for (const std::int32_t number : numbers) bytes += bigEndian(number);
  return bytes;
}
std::string floats(const std::vector<float>& numbers) {
  std::string bytes;
  for (const float number : numbers) bytes += bigEndian(number);
  return bytes;
}
std::string indices(const std::vector<std::uint16_t>& numbers) {
  std::string bytes;
  for (const std::uint16_t number : numbers) bytes += bigEndian(number);
  return bytes;
}

// Four points with pscale, three arcs of a quarter and a polygon of the same points.
constexpr float kRootOfHalf = 0.70710678f;
const std::string kGeoText =
    "PGEOMETRY V5\nNPoints 4 NPrims 5\nNPointGroups 0 NPrimGroups 0\n"
    "NPointAttrib 1 NVertexAttrib 1 NPrimAttrib 1 NAttrib 0\n"
    "PointAttrib\npscale 1 float 1\n"
    "1 0 0 1 (.01)\n1 1 0 .70710678 (.01)\n0 1 0 1 (.01)\n0 0 5 1 (.01)\n"
    "VertexAttrib\nuv 2 float 0 0\n"
    "PrimitiveAttrib\nname 1 index 1 arc\n"
    "NURBCurve 3 : Basis 3 end  0 1 \n 0 (0 0) 1 (0 0) 2 (0 0) [0]\n"
    "BezierCurve 3 : Basis 3 use 0 1 \n 0 (0 0) 1 (0 0) 2 (0 0) [0]\n"
    "Run 3 Poly\n 2 : 3 (0 0) 2 (0 0) [0]\n 2 : 0 (0 0) 3 (0 0) [0]\n"
    " 3 < 0 (0 0) 1 (0 0) 2 (0 0) [0]\nbeginExtra\nendExtra\n";

std::string geoBinary() {
  const auto name = [](const std::string& text) {
    return bigEndian(std::uint16_t(text.size())) + text;
  };
  std::string bytes = "BgeoV" + words({5, 4, 5, 0, 0, 1, 1, 1, 0});
  bytes += name("pscale") + bigEndian(std::uint16_t(1)) + words({0}) + floats({1});
  for (const std::vector<float>& point :
       {std::vector<float>{1, 0, 0, 1}, {1, 1, 0, kRootOfHalf}, {0, 1, 0, 1}, {0, 0, 5, 1}}) {
    bytes += floats(point) + floats({.01f});
  }
  bytes += name("uv") + bigEndian(std::uint16_t(2)) + words({0}) + floats({0, 0});
  bytes += name("name") + bigEndian(std::uint16_t(1)) + words({4, 1}) + name("arc");
  const std::string uv = floats({0, 0});
  const auto vertices = [&](const std::vector<std::uint16_t>& points) {
    std::string all;
    for (const std::uint16_t point : points) all += indices({point}) + uv;
    return all + words({0});
  };
  bytes +=
      words({2, 3}) + ":" + words({3}) + indices({1, 0}) + floats({0, 1}) + vertices({0, 1, 2});
  bytes +=
      words({4, 3}) + ":" + words({3}) + std::string("\1") + floats({0, 1}) + vertices({0, 1, 2});
  bytes += words({-1}) + indices({3}) + words({1});
  bytes += words({2}) + ":" + vertices({3, 2});
  bytes += words({2}) + ":" + vertices({0, 3});
  bytes += words({3}) + "<" + vertices({0, 1, 2});
  return bytes + std::string("\0\xFF", 2);
}

class HoudiniSplines : public SceneFiles {
 protected:
  // The area of the ribbons, over pi / 2 times the width.
  double lengthOf(const std::string& bytes, const std::string& name,
                  const CurveOptions& curves = {}) {
    const auto mesh = loadMeshes({write(name, bytes)}, glm::vec3(0.5f), notes_, curves);
    EXPECT_TRUE(mesh.ok()) << mesh.status().message();
    return mesh.ok() ? meshArea(*mesh) / (0.02 * M_PI / 2) : 0;
  }
  static double meshArea(const Mesh& mesh) {
    double area = 0;
    for (std::uint32_t i = 0; i < mesh.triangle.size(); ++i) area += triangleArea(mesh, i);
    return area;
  }
  RecordedNotes notes_;
};

TEST_F(HoudiniSplines, GeometryOfVersion5HasItsCurves) {
  const double straight = 2 * std::sqrt(26.);
  for (const bool is_text : {true, false}) {
    notes_ = {};
    const double length = lengthOf(is_text ? kGeoText : geoBinary(), is_text ? "a.geo" : "a.bgeo");
    EXPECT_NEAR(length, M_PI + straight, 0.01 * (M_PI + straight)) << is_text;
    EXPECT_THAT(notes_.notes, Contains(HasSubstr("1 closed polygons and curves are left out")));
  }
}

TEST_F(HoudiniSplines, WhatGeometryOfVersion5LacksIsRefusedByPlace) {
  const std::string bytes = geoBinary();
  const auto refusal = [&](const std::string& content, const std::string& name) {
    const auto mesh = loadMeshes({write(name, content)}, glm::vec3(0.5f), notes_, {});
    return mesh.ok() ? std::string() : mesh.status().message();
  };
  for (std::size_t size = 50; size + 2 < bytes.size(); size += 7) {
    EXPECT_THAT(refusal(bytes.substr(0, size), "a.bgeo"), HasSubstr("byte ")) << size;
  }
  std::string sphere = kGeoText;
  sphere.replace(sphere.find("Run 3 Poly"), 10, "Run 3 Tube");
  EXPECT_THAT(refusal(sphere, "a.geo"), HasSubstr("a primitive of type 'Tube'"));
}

TEST_F(HoudiniSplines, BinaryJsonHasThemToo) {
  const BgeoJsonBytes json;
  const auto attribute = [&](const std::string& name, int size, const std::vector<float>& values) {
    return json.attribute(
        name, "numeric",
        json.values(size, "fpreal32",
                    json.paged(1024, json.text("rawpagedata") + json.floats(values))));
  };
  const std::string attributes = attribute("P", 3, {1, 0, 0, 1, 1, 0, 0, 1, 0}) +
                                 attribute("Pw", 1, {1, kRootOfHalf, 1}) +
                                 attribute("pscale", 1, {.01f, .01f, .01f});
  const std::string no("\x30"), yes("\x31");
  const std::string basis = json.list(json.text("type"), json.text("NURBS"), json.text("order"),
                                      json.integer(3), json.text("endinterpolation"), yes,
                                      json.text("knots"), json.floats({0, 0, 0, 1, 1, 1}));
  const std::string single =
      json.list(json.list(json.text("type"), json.text("NURBCurve")),
                json.list(json.text("vertex"), json.integers({0, 1, 2}), json.text("closed"), no,
                          json.text("basis"), basis));
  const std::string run = json.list(
      json.list(json.text("type"), json.text("run"), json.text("runtype"), json.text("NURBCurve"),
                json.text("varyingfields"), json.list(json.text("vertex")),
                json.text("uniformfields"),
                "{" + json.text("closed") + no + json.text("basis") + basis + "}"),
      json.list(json.list(json.integers({0, 1, 2})), json.list(json.integers({2, 1, 0}))));
  for (const auto& [primitives, count] : {std::pair(single, 1), std::pair(run, 2)}) {
    const std::string file = json.geometry(
        3, attributes,
        json.text("pointref") + json.list(json.text("indices"), json.integers({0, 1, 2})),
        primitives);
    EXPECT_NEAR(lengthOf(file, "a.bgeo"), count * M_PI / 2, .01 * count);
  }
}

}  // namespace
}  // namespace surfeit
