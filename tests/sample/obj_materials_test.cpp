// Materials of OBJ files that say less, or other things, than they should.
#include <gmock/gmock.h>

#include <numbers>

#include "sample/meshes/mesh.h"
#include "sample/scene_files.h"

namespace surfeit {
namespace {

using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

class ObjMaterialFiles : public SceneFiles {
 protected:
  // A square of two triangles with these materials and statements of faces.
  Mesh load(const std::string& materials, const std::string& faces = "usemtl A\nf 1 2 3 4\n") {
    notes_.notes.clear();
    // Both texels: a fifth of white, in codes and in lightness
    write("t.ppm", "P6\n1 1\n255\n\x33\x33\x33");
    write("m.mtl", materials);
    const std::string text =
        "mtllib m.mtl\nv 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\n";
    Result<Mesh> mesh =
        loadMeshes({write("m.obj", text + faces)}, glm::vec3(0.25f), notes_, {}, groups_);
    EXPECT_TRUE(mesh.ok()) << mesh.status().message();
    return mesh.ok() ? std::move(*mesh) : Mesh();
  }
  static SurfacePoint at(const Mesh& mesh, std::uint32_t triangle) {
    return surfacePoint(mesh, triangle, .3f, .3f);
  }
  SampleGroups groups_ = SampleGroups::kNone;
  RecordedNotes notes_;
};

constexpr float kPiFloat = std::numbers::pi_v<float>;

// Faces 1 and 2 of the file are without; a corner without is enough.
TEST_F(ObjMaterialFiles, FacesWithoutTextureCoordinatesHaveNoPictures) {
  const std::string material = "newmtl A\nKd .5 .5 .5\nKe 2 2 2\nd .8\n";
  const std::string faces = "usemtl A\nf 1/1 2/2 3/3\nf 1 3 4\nf 1/1 2/2 3\n";
  const float color = .5f * linearFromSrgb8(0x33), glow = 2 * kPiFloat * linearFromSrgb8(0x33);
  struct Case {
    std::string map;
    float albedo, emission, opacity;  // of the face with coordinates
  };
  const std::vector<Case> cases = {{"map_Kd", color, 2 * kPiFloat, .8f},
                                   {"map_Ke", .5f, glow, .8f},
                                   {"map_d", .5f, 2 * kPiFloat, .8f * .2f}};
  for (const Case& of : cases) {
    for (const SampleGroups groups : {SampleGroups::kNone, SampleGroups::kMaterial}) {
      groups_ = groups;
      const Mesh mesh = load(material + of.map + " t.ppm\n", faces);
      ASSERT_EQ(mesh.triangle.size(), 3u);
      EXPECT_NEAR(at(mesh, 0).albedo.x, of.albedo, 1e-5f) << of.map;
      EXPECT_NEAR(at(mesh, 0).emission.x, of.emission, 1e-5f) << of.map;
      EXPECT_NEAR(at(mesh, 0).opacity.r, of.opacity, 1e-5f) << of.map;
      for (const std::uint32_t bare : {1u, 2u}) {
        EXPECT_NEAR(at(mesh, bare).albedo.x, .5f, 1e-5f) << of.map;
        EXPECT_NEAR(at(mesh, bare).emission.x, 2 * kPiFloat, 1e-5f) << of.map;
        EXPECT_NEAR(at(mesh, bare).opacity.r, .8f, 1e-5f) << of.map;
      }
      EXPECT_THAT(notes_.notes,
                  ElementsAre(AllOf(HasSubstr("2 of 3 faces of material \"A\" have no texture"),
                                    HasSubstr("without " + of.map + " (unwrap"))));
    }
  }
}

TEST_F(ObjMaterialFiles, FilesWithoutTextureCoordinatesToo) {
  const Mesh mesh = load(
      "newmtl A\nKd .5 .5 .5\nKe 2 2 2\nmap_Kd t.ppm\nmap_Ke t.ppm\nmap_d t.ppm\nnewmtl B\n"
      "map_Kd t.ppm\nmap_Ke t.ppm\n",
      "usemtl A\nf 1 2 3 4\nusemtl B\nf 1 2 3\n");
  EXPECT_EQ(at(mesh, 0).albedo, glm::vec3(.5f));
  EXPECT_NEAR(at(mesh, 0).emission.x, 2 * kPiFloat, 1e-5f);
  EXPECT_EQ(at(mesh, 0).opacity.r, 1);
  // Without pictures, B says nothing
  EXPECT_EQ(at(mesh, 2).albedo, glm::vec3(.25f));
  EXPECT_EQ(at(mesh, 2).emission, glm::vec3(0));
  EXPECT_THAT(notes_.notes,
              ElementsAre(HasSubstr("map_Ke and no Ke"), HasSubstr("map_Kd and no Kd"),
                          AllOf(HasSubstr("1 of 1 faces of material \"A\""),
                                HasSubstr("without map_Kd, map_Ke, map_d")),
                          HasSubstr("1 of 1 faces of material \"B\"")));
  load("newmtl A\nKd .5 .5 .5\nnewmtl B\nKd 1 1 1\nmap_Kd t.ppm\n",
       "usemtl A\nf 1 2 3 4\nusemtl B\nf 1/1 2/2 3/3\n");
  EXPECT_THAT(notes_.notes, IsEmpty());
}

// opacity = 1 - (1 - d) Tf, unless Tf is what exporters write where nobody said anything.
TEST_F(ObjMaterialFiles, TfFiltersWhatDLetsThrough) {
  struct Case {
    std::string material;
    glm::vec3 opacity;
  };
  const std::vector<Case> cases = {{"d .2\nTf 1 .1 .5\n", {.2f, .92f, .6f}},
                                   {"Tr .8\nTf 1 .1 .5\n", {.2f, .92f, .6f}},
                                   {"d 0\nTf .9 .2 0\n", {.1f, .8f, 1}},
                                   {"d .2\nTf 1 1 1\n", glm::vec3(.2f)},
                                   {"d .2\nTf 0 0 0\n", glm::vec3(.2f)},
                                   {"d .2\nTf .5\n", glm::vec3(.6f)},
                                   {"illum 4\nd .2\nTf 1 .1 .5\n", {.2f, .92f, .6f}},
                                   {"d 1\nTf 1 .1 .5\n", glm::vec3(1)}};
  for (const Case& of : cases) {
    const Mesh mesh = load("newmtl A\nKd .5 .5 .5\nNi 1.5\n" + of.material);
    for (int c = 0; c < 3; ++c) {
      EXPECT_NEAR(at(mesh, 0).opacity[c], of.opacity[c], 1e-6f) << of.material << c;
    }
    EXPECT_EQ(mesh.hasTints(), of.opacity != glm::vec3(of.opacity.r)) << of.material;
    EXPECT_THAT(notes_.notes, IsEmpty()) << of.material;
  }
}

TEST_F(ObjMaterialFiles, NumbersOutOfTheirRangeAreTold) {
  struct Case {
    std::string material;
    glm::vec3 albedo;
    float emission, opacity;
    std::string said;
  };
  const glm::vec3 grey(.25f);
  const std::vector<Case> cases = {
      {"Kd 200 100 50\n",
       {linearFromSrgb8(200), linearFromSrgb8(100), linearFromSrgb8(50)},
       0,
       1,
       "material \"A\" has Kd 200 100 50: read as sRGB of 8 bits"},
      {"Kd 255 255 255\nmap_Kd t.ppm\n", glm::vec3(linearFromSrgb8(0x33)), 0, 1, "sRGB of 8 bits"},
      {"Kd 0.5 1.5 0.5\n", {.5f, 1.5f, .5f}, 0, 1, "Kd 0.5 1.5 0.5, which is above 1"},
      {"Kd 2 1 0\n", {2, 1, 0}, 0, 1, "which is above 1"},
      {"Kd 20.5 1 0\n", {20.5f, 1, 0}, 0, 1, "which is above 1"},
      {"Kd 300 1 0\n", {300, 1, 0}, 0, 1, "which is above 1"},
      {"Kd -0.1 .5 .5\n", {0, .5f, .5f}, 0, 1, "has Kd -0.1 0.5 0.5: read as 0 0.5 0.5"},
      {"Kd .25\nKe -3\n", grey, 0, 1, "has Ke -3 -3 -3: read as 0 0 0, expected 0 or more"},
      {"Kd .25\nKe 100 200 100\n", grey, 100 * kPiFloat, 1, ""},
      {"Kd .25\nd 50\n", grey, 0, 1, "has d 50 (or Tr -49): read as d 1, expected 0 to 1"},
      {"Kd .25\nillum 3\nKs 2 1 1\n", grey, 0, 1, "has Ks 2 1 1: read as 1 1 1, expected 0 to 1"},
      {"Kd .25\nTf .5 -1 .5\n", grey, 0, 1, "has Tf 0.5 -1 0.5: read as 0.5 0 0.5"},
      {"Kd .25\nKs 2 1 1\n", grey, 0, 1, ""},  // not read without a mirror
      {"Kd 0 1 .5\n", {0, 1, .5f}, 0, 1, ""},
  };
  for (const Case& of : cases) {
    const Mesh mesh = load("newmtl A\n" + of.material, "usemtl A\nf 1/1 2/2 3/3\n");
    const SurfacePoint point = at(mesh, 0);
    for (int i = 0; i < 3; ++i) EXPECT_NEAR(point.albedo[i], of.albedo[i], 1e-5f) << of.material;
    EXPECT_NEAR(point.emission.x, of.emission, 1e-3f) << of.material;
    EXPECT_EQ(point.opacity.r, of.opacity) << of.material;
    if (of.said.empty()) {
      EXPECT_THAT(notes_.notes, IsEmpty()) << of.material;
    } else {
      EXPECT_THAT(notes_.notes, ElementsAre(HasSubstr(of.said))) << of.material;
    }
  }
  // Too large for a float: no light without a limit
  const Mesh mesh = load("newmtl A\nKd .25\nKe 1e39 1 1\n");
  EXPECT_TRUE(std::isfinite(at(mesh, 0).emission.x));
  EXPECT_THAT(notes_.notes, ElementsAre(HasSubstr("has Ke 1e+39 1 1: read as")));
}

TEST_F(ObjMaterialFiles, MaterialsOfOneNameAreTold) {
  const Mesh twice = load("newmtl A\nKd 1 0 0\nnewmtl B\nKd 1 1 1\nnewmtl A\nKd 0 1 0\n");
  EXPECT_EQ(at(twice, 0).albedo, glm::vec3(1, 0, 0));
  EXPECT_THAT(notes_.notes,
              ElementsAre(HasSubstr("m.mtl: material \"A\" is defined again: the first")));
  write("n.mtl", "newmtl A\nKd 0 1 0\nnewmtl my  B\nKd 1 0 1\nnewmtl my  B\nKd 1 1 1\n");
  load("newmtl A\nKd 1 0 0\n", "mtllib n.mtl\nusemtl A\nf 1 2 3\n");
  EXPECT_THAT(notes_.notes, ElementsAre(HasSubstr("n.mtl: material \"A\" (and 1 more) is")));
  load("newmtl A\nKd 1 0 0\n", "mtllib m.mtl\nmtllib ./m.mtl m.mtl\nusemtl A\nf 1 2 3\n");
  EXPECT_THAT(notes_.notes, IsEmpty());  // one file
}

}  // namespace
}  // namespace surfeit
