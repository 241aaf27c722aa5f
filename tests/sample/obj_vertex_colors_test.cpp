#include "sample/meshes/obj_vertex_colors.h"

#include <gmock/gmock.h>

#include <array>

#include "sample/meshes/mesh.h"
#include "sample/scene_files.h"

namespace surfeit {
namespace {

using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

constexpr float kHalf = 0.2140411f;  // linear, of sRGB .5

// A triangle whose vertices have these numbers behind their places.
class ObjVertexColorFiles : public SceneFiles {
 protected:
  Mesh load(const std::array<std::string, 3>& behind, const std::string& more = "") {
    notes_.notes.clear();
    const std::string text = "v 0 0 0" + behind[0] + "\nv 1 0 0" + behind[1] + "\nv 0 1 0" +
                             behind[2] + "\n" + more + "f 1 2 3\n";
    Result<Mesh> mesh = loadMeshes({write("m.obj", text)}, glm::vec3(0.25f), notes_);
    EXPECT_TRUE(mesh.ok()) << mesh.status().message();
    return mesh.ok() ? std::move(*mesh) : Mesh();
  }
  // Of the three corners.
  static std::array<glm::vec3, 3> albedos(const Mesh& mesh) {
    return {surfacePoint(mesh, 0, 0, 0).albedo, surfacePoint(mesh, 0, 1, 0).albedo,
            surfacePoint(mesh, 0, 0, 1).albedo};
  }
  RecordedNotes notes_;
};

TEST_F(ObjVertexColorFiles, VerticesWithoutAColorAreWhiteAndOthersKeepTheirs) {
  const glm::vec3 red(1, 0, 0), white(1);
  const auto first = albedos(load({" 1 0 0", "", ""}));
  EXPECT_THAT(first, ElementsAre(red, white, white));
  EXPECT_THAT(notes_.notes, ElementsAre(HasSubstr("m.obj: 2 of 3 vertices have no color")));
  const auto last = albedos(load({"", " 1.0", " 255 0 0"}));  // a weight is no color
  EXPECT_THAT(last, ElementsAre(white, white, red));
  EXPECT_THAT(notes_.notes, ElementsAre(HasSubstr("0-255"), HasSubstr("2 of 3 vertices")));
  const auto none = albedos(load({"", " 1", ""}));
  EXPECT_EQ(none[2], glm::vec3(0.25f));
  EXPECT_THAT(notes_.notes, IsEmpty());
}

TEST_F(ObjVertexColorFiles, WholeNumbersAreCodesAndOthersLight) {
  struct Case {
    std::string behind;
    float red;
    std::string said;
  };
  const std::vector<Case> cases = {
      {" 0.5 1 0", kHalf, ""},
      {" 1 1 0", 1, ""},
      {" 255 0 128", 1, "are 0-255 (the largest is 255): read as sRGB of 8 bits"},
      {" 2 0 1", 2 / 255.f / 12.92f, "0-255"},
      {" 127.5 64.25 0", kHalf, "0-255"},
      {" 65535 0 128", 1, "are 0-65535 (the largest is 65535): read as sRGB of 16 bits"},
      {" 2.5 0 0", linearFromSrgb(2.5f), "reach 2.5, which is more than white (1)"},
      {" 1.0001 0 0", linearFromSrgb(1.0001f), "reach 1.0001"},
      {" -0.5 0.5 0", 0, "3 values of colors of vertices are below 0: read as 0"},
  };
  for (const Case& of : cases) {
    const Mesh mesh = load({of.behind, of.behind, of.behind});
    EXPECT_NEAR(albedos(mesh)[0].x, of.red, 1e-5f * std::max(of.red, 1e-2f)) << of.behind;
    if (of.said.empty()) {
      EXPECT_THAT(notes_.notes, IsEmpty()) << of.behind;
    } else {
      EXPECT_THAT(notes_.notes, ElementsAre(HasSubstr(of.said))) << of.behind;
    }
  }
}

TEST_F(ObjVertexColorFiles, AlphaIsNotReadAndToldWhereItIsNotFull) {
  const Mesh mesh = load({" 1 0 0 0.5", " 1 0 0 1", " 1 0 0"});
  EXPECT_EQ(albedos(mesh)[0], glm::vec3(1, 0, 0));
  EXPECT_THAT(notes_.notes,
              ElementsAre(AllOf(HasSubstr("alpha of 2 vertices"), HasSubstr("the least is 0.5"))));
  load({" 1 0 0 1", " 1 0 0 1", " 1 0 0 1"});
  EXPECT_THAT(notes_.notes, IsEmpty());
  load({" 255 0 0 255", " 255 0 0 255", " 255 0 0 128"});
  EXPECT_THAT(notes_.notes, ElementsAre(HasSubstr("0-255"), HasSubstr("the least is 128")));
}

TEST_F(ObjVertexColorFiles, ColorsOfZBrushAreTold) {
  const std::string lines = "#MRGB ffff0000ff00ff00\n#MRGB ff0000ff\n# MRGB\n";
  EXPECT_EQ(albedos(load({"", "", ""}, lines))[0], glm::vec3(0.25f));
  EXPECT_THAT(notes_.notes, ElementsAre(AllOf(HasSubstr("2 lines with colors of ZBrush (#MRGB)"),
                                              HasSubstr("v x y z r g b"))));
  load({" 1 0 0", " 1 0 0", " 1 0 0"}, lines);
  EXPECT_THAT(notes_.notes, IsEmpty());
}

// Ribbons of lines have colors, too.
TEST_F(ObjVertexColorFiles, LinesHaveThem) {
  CurveOptions curves;
  curves.width = 0.1;
  const Result<Mesh> mesh = loadMeshes({write("m.obj", "v 0 0 0 1 0 0\nv 1 0 0\nl 1 2\n")},
                                       glm::vec3(0.25f), notes_, curves);
  ASSERT_TRUE(mesh.ok()) << mesh.status().message();
  EXPECT_THAT(mesh->color,
              ElementsAre(glm::vec3(1, 0, 0), glm::vec3(1, 0, 0), glm::vec3(1), glm::vec3(1)));
  EXPECT_THAT(notes_.notes, ElementsAre(HasSubstr("1 of 2 vertices have no color")));
}

}  // namespace
}  // namespace surfeit
