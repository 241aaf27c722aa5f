// Photons at mirrors, glass and translucent sheets.
#include "sample/photon_scatter.h"

#include <gmock/gmock.h>

#include <cmath>
#include <glm/geometric.hpp>
#include <numbers>
#include <string>
#include <vector>

#include "cloud/ply/ply_reader.h"
#include "sample/scene_files.h"
#include "surfeit/sample.h"

namespace surfeit {
namespace {

using ::testing::HasSubstr;

TEST(PhotonScatter, GlassReflectsAsFresnelSays) {
  EXPECT_NEAR(fresnelReflectance(1, 1 / 1.5f), 0.04f, 1e-6);
  EXPECT_NEAR(fresnelReflectance(1, 1.5f), 0.04f, 1e-6);
  // Brewster's angle, tan = 1.5: only one of both polarizations is reflected
  const float brewster = std::cos(std::atan(1.5f));
  EXPECT_NEAR(fresnelReflectance(brewster, 1 / 1.5f), 0.5f * 0.147929f, 1e-5);
  EXPECT_EQ(fresnelReflectance(0.5f, 1.5f), 1);  // beyond the critical angle
  EXPECT_NEAR(fresnelReflectance(0, 1 / 1.5f), 1, 1e-6);
}

class PhotonMaterials : public SceneFiles {
 protected:
  struct Stored {
    glm::vec3 position, normal, power, incident, albedo;
  };

  void trace(const std::string& mesh, PhotonTracingOptions options) {
    options.caustic_output = path("caustic.ply");
    const auto stats = tracePhotons({mesh}, path("photons.ply"), options, notes_);
    ASSERT_TRUE(stats.ok()) << stats.status().message();
    stats_ = *stats;
    stored_ = readPhotons("photons.ply");
    caustic_ = readPhotons("caustic.ply");
    EXPECT_EQ(stats_.stored, stored_.size());
    EXPECT_EQ(stats_.caustic, caustic_.size());
  }
  std::vector<Stored> readPhotons(const std::string& name) const {
    Result<PlyReader> reader = PlyReader::open(path(name));
    EXPECT_TRUE(reader.ok()) << reader.status().message();
    if (!reader.ok()) return {};
    const RowLayout& element = reader->header().elements[0];
    EXPECT_EQ(element.row_bytes, sizeof(Stored));
    std::vector<Stored> photons(element.count);
    const auto bytes = std::as_writable_bytes(std::span(photons));
    EXPECT_TRUE(reader->seekElement(0).ok());
    for (std::size_t at = 0; at < bytes.size();) {
      const Result<std::size_t> rows = reader->readRows(bytes.subspan(at));
      EXPECT_TRUE(rows.ok() && *rows > 0);
      if (!rows.ok() || *rows == 0) break;
      at += *rows * element.row_bytes;
    }
    return photons;
  }

  // A square with that material; it faces `up` cross `right`... in the order of its corners.
  static void addSquare(const std::vector<glm::vec3>& corners, const std::string& material,
                        std::string& obj, int& vertices) {
    for (const glm::vec3& v : corners) obj += fmt::format("v {} {} {}\n", v.x, v.y, v.z);
    obj += fmt::format("usemtl {}\nf {} {} {} {}\n", material, vertices + 1, vertices + 2,
                       vertices + 3, vertices + 4);
    vertices += 4;
  }

  // A sphere about the origin with smooth normals.
  static void addSphere(float radius, const std::string& material, std::string& obj,
                        int& vertices) {
    constexpr int kRings = 96, kSegments = 192;
    for (int i = 0; i <= kRings; ++i) {
      for (int k = 0; k < kSegments; ++k) {
        const double t = std::numbers::pi * i / kRings, p = 2 * std::numbers::pi * k / kSegments;
        const glm::dvec3 n(std::sin(t) * std::cos(p), std::cos(t), std::sin(t) * std::sin(p));
        obj += fmt::format("v {0} {1} {2}\nvn {3} {4} {5}\n", double(radius) * n.x,
                           double(radius) * n.y, double(radius) * n.z, n.x, n.y, n.z);
      }
    }
    obj += "usemtl " + material + "\n";
    const auto corner = [&](int i, int k) {
      const int index = i * kSegments + k % kSegments + 1;
      return fmt::format(" {}//{}", index + vertices, index);
    };
    for (int i = 0; i < kRings; ++i) {
      for (int k = 0; k < kSegments; ++k) {
        obj +=
            "f" + corner(i, k) + corner(i, k + 1) + corner(i + 1, k + 1) + corner(i + 1, k) + "\n";
      }
    }
    vertices += (kRings + 1) * kSegments;
  }

  static double power(const std::vector<Stored>& photons) {
    double sum = 0;
    for (const Stored& photon : photons) sum += double(photon.power.r);
    return sum;
  }

  RecordedNotes notes_;
  PhotonTracingStats stats_;
  std::vector<Stored> stored_, caustic_;
};

// All walls reflect .5 diffusely and .3 as a mirror: power arrives once, and .8 times, and .8^2 ...
TEST_F(PhotonMaterials, MirrorsAndMatteWallsKeepTheEnergy) {
  write("box.mtl", "newmtl m\nKd .5 .5 .5\nKs .3 .3 .3\nillum 3\n");
  std::string obj = "mtllib box.mtl\nusemtl m\n";
  for (int i = 0; i < 8; ++i) obj += fmt::format("v {} {} {}\n", i & 1, (i >> 1) & 1, i >> 2);
  obj += "f 2 4 3 1\nf 7 8 6 5\nf 5 6 2 1\nf 4 8 7 3\nf 3 7 5 1\nf 6 8 4 2\n";
  PhotonTracingOptions options;
  options.photons = 50000;
  options.surroundings.lights.points.push_back({{0.5, 0.4, 0.3}, glm::vec3(1)});
  trace(write("box.obj", obj), options);
  const double emitted = 4 * std::numbers::pi;
  EXPECT_NEAR((stats_.stored_power.r + stats_.caustic_power.r) / emitted, 1 / (1 - 0.8), 0.1);
  // Light, then mirrors alone: .3 + .3^2 + ...
  EXPECT_NEAR(stats_.caustic_power.r / emitted, 0.3 / (1 - 0.3), 0.01);
  EXPECT_NEAR(power(caustic_), stats_.caustic_power.r, 1e-3);
}

TEST_F(PhotonMaterials, AMirrorSendsPhotonsToTheMirroredPlace) {
  write("m.mtl", "newmtl mirror\nKd 0 0 0\nKs .8 .8 .8\nillum 3\nnewmtl black\nKd 0 0 0\n");
  std::string obj = "mtllib m.mtl\n";
  int vertices = 0;
  // A mirror of .2 by .2 on the ground, and a wall at x = 2 that looks towards it
  addSquare({{-.1f, 0, .1f}, {.1f, 0, .1f}, {.1f, 0, -.1f}, {-.1f, 0, -.1f}}, "mirror", obj,
            vertices);
  addSquare({{2, 0, 2}, {2, 4, 2}, {2, 4, -2}, {2, 0, -2}}, "black", obj, vertices);
  PhotonTracingOptions options;
  options.photons = 400'000;
  options.surroundings.lights.directionals.push_back({{1, -1, 0}, glm::vec3(10)});
  trace(write("m.obj", obj), options);
  ASSERT_GT(caustic_.size(), 200u);
  for (const Stored& photon : caustic_) {
    ASSERT_NEAR(photon.position.x, 2, 1e-4);
    ASSERT_NEAR(photon.position.y, 2, 0.101);  // one for one up at 45 degrees
    ASSERT_NEAR(photon.position.z, 0, 0.101);
    ASSERT_NEAR(glm::distance(photon.incident, glm::normalize(glm::vec3(1, 1, 0))), 0, 1e-5);
  }
  const double arrives = 10 * 0.2 * 0.2 * std::sqrt(0.5);
  EXPECT_NEAR(power(caustic_) / (0.8 * arrives), 1, 0.1);
}

// A ball of glass focuses light along its axis at n R / (2 (n - 1)) from its middle, 1.5 R. At a
// distance z behind the middle a beam of half width h has the half width h |1 - z / 1.5|.
TEST_F(PhotonMaterials, AGlassBallFocusesWhereTheLensFormulaSays) {
  write("m.mtl", "newmtl glass\nillum 7\nNi 1.5\nnewmtl black\nKd 0 0 0\n");
  double spread[3] = {};
  const float distances[] = {1.5f, 2.25f, 3};
  for (int i = 0; i < 3; ++i) {
    std::string obj = "mtllib m.mtl\n";
    int vertices = 0;
    addSphere(1, "glass", obj, vertices);
    const float z = -distances[i];
    addSquare({{-.5f, -.5f, z}, {.5f, -.5f, z}, {.5f, .5f, z}, {-.5f, .5f, z}}, "black", obj,
              vertices);
    // A narrow beam: a black plate with a hole of .3 by .3 before the ball
    const float h = 0.15f, far = 3;
    addSquare({{-far, h, 2}, {far, h, 2}, {far, far, 2}, {-far, far, 2}}, "black", obj, vertices);
    addSquare({{-far, -far, 2}, {far, -far, 2}, {far, -h, 2}, {-far, -h, 2}}, "black", obj,
              vertices);
    addSquare({{-far, -h, 2}, {-h, -h, 2}, {-h, h, 2}, {-far, h, 2}}, "black", obj, vertices);
    addSquare({{h, -h, 2}, {far, -h, 2}, {far, h, 2}, {h, h, 2}}, "black", obj, vertices);
    PhotonTracingOptions options;
    options.photons = 300'000;
    options.surroundings.lights.directionals.push_back({{0, 0, -1}, glm::vec3(1)});
    trace(write("m.obj", obj), options);
    double sum = 0, total = 0;
    for (const Stored& photon : caustic_) {
      if (photon.position.z > z + 1e-3f || std::abs(photon.position.x) > 0.4f) continue;
      sum += double(photon.power.r) * double(photon.position.x) * double(photon.position.x);
      total += double(photon.power.r);
    }
    // What two surfaces let through, .96 each
    EXPECT_NEAR(total / (0.3 * 0.3 * 0.96 * 0.96), 1, 0.1) << distances[i];
    spread[i] = std::sqrt(sum / total) / (0.15 / std::sqrt(3));
  }
  EXPECT_LT(spread[0], 0.05);
  EXPECT_NEAR(spread[1], 0.5, 0.06);
  EXPECT_NEAR(spread[2], 1, 0.1);
  printf("beam of a glass ball, rms width over that of the hole: %.3f %.3f %.3f, lens 0 .5 1\n",
         spread[0], spread[1], spread[2]);
}

TEST_F(PhotonMaterials, GlassAbsorbsNothing) {
  write("m.mtl", "newmtl glass\nillum 7\nNi 1.5\nnewmtl black\nKd 0 0 0\n");
  std::string obj = "mtllib m.mtl\n";
  int vertices = 0;
  addSphere(0.4f, "glass", obj, vertices);
  obj += "usemtl black\n";
  for (int i = 0; i < 8; ++i) {
    obj += fmt::format("v {} {} {}\n", i & 1 ? 1 : -1, i & 2 ? 1 : -1, i & 4 ? 1 : -1);
  }
  for (const auto& f : {std::array{2, 4, 3, 1},
                        {7, 8, 6, 5},
                        {5, 6, 2, 1},
                        {4, 8, 7, 3},
                        {3, 7, 5, 1},
                        {6, 8, 4, 2}}) {
    obj += fmt::format("f {} {} {} {}\n", f[0] + vertices, f[1] + vertices, f[2] + vertices,
                       f[3] + vertices);
  }
  PhotonTracingOptions options;
  options.photons = 50'000;
  options.surroundings.lights.points.push_back({{0.7, 0.1, 0}, glm::vec3(1)});
  trace(write("m.obj", obj), options);
  EXPECT_NEAR((stats_.stored_power.r + stats_.caustic_power.r) / (4 * std::numbers::pi), 1, 0.01);
  EXPECT_LT(stats_.escaped, 20u);
  EXPECT_LT(stats_.lost_at_backs, 20u);
}

TEST_F(PhotonMaterials, ATranslucentSheetLightsWhatIsBehindIt) {
  write("m.mtl", "newmtl sheet\nKd .3 .3 .3\nTf .4 .4 .4\nnewmtl black\nKd 0 0 0\n");
  std::string obj = "mtllib m.mtl\n";
  int vertices = 0;
  addSquare({{-1, 0, 1}, {1, 0, 1}, {1, 0, -1}, {-1, 0, -1}}, "sheet", obj, vertices);
  addSquare({{-1, -.01f, 1}, {1, -.01f, 1}, {1, -.01f, -1}, {-1, -.01f, -1}}, "black", obj,
            vertices);
  for (const double direction : {-1.0, 1.0}) {
    if (direction > 0) {  // from behind: the black square looks the other way, out of the way
      obj = "mtllib m.mtl\n";
      vertices = 0;
      addSquare({{-1, 0, 1}, {1, 0, 1}, {1, 0, -1}, {-1, 0, -1}}, "sheet", obj, vertices);
      addSquare({{-1, .01f, -1}, {1, .01f, -1}, {1, .01f, 1}, {-1, .01f, 1}}, "black", obj,
                vertices);
    }
    PhotonTracingOptions options;
    options.photons = 100'000;
    options.surroundings.lights.directionals.push_back({{0, direction, 0}, glm::vec3(2)});
    trace(write("m.obj", obj), options);
    double sheet = 0, black = 0, through = 0;
    for (const Stored& photon : stored_) {
      const bool is_sheet = std::abs(photon.position.y) < 0.005f;
      const double power = double(photon.power.r);
      if (!is_sheet) black += power;
      if (is_sheet && photon.albedo.r < 0.35f) sheet += power;
      if (is_sheet && photon.albedo.r > 0.35f) {
        through += power * double(photon.albedo.r);
        ASSERT_GT(direction * double(photon.normal.y), 0);
        ASSERT_LT(glm::dot(photon.normal, photon.incident), 0);
      }
    }
    EXPECT_NEAR(sheet / 8, 1, 0.02);
    EXPECT_NEAR(through / (0.4 * 8), 1, 0.02);
    EXPECT_NEAR(black / (0.4 * 8), 1, 0.04);  // a little passes at the edges
    EXPECT_EQ(caustic_.size(), 0u);
  }
  EXPECT_THAT(notes_.notes, ::testing::Contains(HasSubstr("caustic.ply: no photon came over")));
}

}  // namespace
}  // namespace surfeit
