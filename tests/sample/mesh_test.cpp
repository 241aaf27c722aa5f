#include "sample/meshes/mesh.h"

#include <gmock/gmock.h>

#include <glm/geometric.hpp>

#include "sample/scene_files.h"

namespace surfeit {
namespace {

using ::testing::HasSubstr;

class MeshFiles : public SceneFiles {
 protected:
  Result<Mesh> load(const std::vector<std::string>& paths) {
    return loadMeshes(paths, glm::vec3(0.5f), notes_);
  }
  std::string error(const std::string& path) {
    const Result<Mesh> mesh = load({path});
    EXPECT_EQ(mesh.status().code(), StatusCode::kCorruption);
    return mesh.status().message();
  }
  RecordedNotes notes_;
};

TEST_F(MeshFiles, PolygonsBecomeFans) {
  const Result<Mesh> mesh = load({write("cube.ply", cubePly(false))});
  ASSERT_TRUE(mesh.ok()) << mesh.status().message();
  EXPECT_EQ(mesh->triangle.size(), 12u);
  for (std::uint32_t i = 0; i < 12; ++i) {
    EXPECT_NEAR(triangleArea(*mesh, i), 0.5, 1e-6);
    const SurfacePoint point = surfacePoint(*mesh, i, 0.25f, 0.25f);
    EXPECT_GT(glm::dot(point.normal, point.position - glm::vec3(0.5f)), 0);  // outwards
    EXPECT_EQ(point.albedo, glm::vec3(0.5f));
  }
}

TEST_F(MeshFiles, PlyNormalsAndSrgbColorsAreInterpolated) {
  const Result<Mesh> mesh = load({write(
      "m.ply",
      "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float "
      "z\nproperty float nx\nproperty float ny\nproperty float nz\nproperty uchar red\nproperty "
      "uchar green\nproperty uchar blue\nelement face 1\nproperty list uchar int "
      "vertex_index\nend_header\n0 0 0 0 0 1 128 255 0\n1 0 0 0 1 1 128 255 0\n0 1 0 0 0 1 128 255 "
      "255\n3 0 1 2\n")});
  ASSERT_TRUE(mesh.ok()) << mesh.status().message();
  const SurfacePoint point = surfacePoint(*mesh, 0, 0.5f, 0.5f);
  EXPECT_NEAR(point.albedo.x, 0.2158605f, 1e-5f);
  EXPECT_NEAR(point.albedo.z, 0.5f, 1e-5f);
  const glm::vec3 expected = glm::normalize(glm::vec3(0, 1, 2));
  EXPECT_NEAR(glm::distance(point.normal, expected), 0, 1e-5f);
  EXPECT_EQ(point.geometric_normal, glm::vec3(0, 0, 1));
}

TEST_F(MeshFiles, SeveralMeshesAreJoinedWhateverAttributesTheyHave) {
  const std::string cube = write("cube.ply", cubePly(false));
  const std::string obj = write("m.obj",
                                "v 0 0 5\nv 1 0 5\nv 0 1 5\nvn 0 0 -1\nvt 0 0\n"
                                "f 1/1/1 2/1/1 3/1/1\n");
  const Result<Mesh> mesh = load({cube, obj, cube});
  ASSERT_TRUE(mesh.ok()) << mesh.status().message();
  EXPECT_EQ(mesh->triangle.size(), 25u);
  EXPECT_EQ(mesh->normal.size(), mesh->position.size());
  EXPECT_EQ(mesh->uv.size(), mesh->position.size());
  EXPECT_GT(mesh->position.capacity(), mesh->position.size());
  // The cube keeps its own normals; the OBJ's shading normal turns the front round
  EXPECT_EQ(surfacePoint(*mesh, 24, 0.3f, 0.3f).normal,
            surfacePoint(*mesh, 24, 0.3f, 0.3f).geometric_normal);
  EXPECT_EQ(surfacePoint(*mesh, 12, 0.3f, 0.3f).geometric_normal, glm::vec3(0, 0, -1));
}

TEST_F(MeshFiles, DegenerateFacesAreSkippedAndTold) {
  const Result<Mesh> mesh = load({write(
      "m.ply", plyText({{0, 0, 0}, {1, 0, 0}, {0, 1, 0}}, {{0, 1, 2}, {0, 0, 1}, {0, 1}, {}}))});
  ASSERT_TRUE(mesh.ok()) << mesh.status().message();
  EXPECT_EQ(mesh->triangle.size(), 1u);
  EXPECT_EQ(mesh->degenerate_faces, 3u);
  ASSERT_EQ(notes_.notes.size(), 1u);
  EXPECT_THAT(notes_.notes[0], HasSubstr("3 faces without area"));
}

TEST_F(MeshFiles, BadMeshesAreRefusedNamingFileAndFace) {
  const std::vector<glm::vec3> triangle = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}};
  EXPECT_THAT(error(write("index.ply", plyText(triangle, {{0, 1, 2}, {0, 1, 3}}))),
              HasSubstr("index.ply: face 1: vertex 3, expected 0 to 2"));
  EXPECT_THAT(error(write("negative.ply", plyText(triangle, {{0, 1, -1}}))),
              HasSubstr("face 0: vertex -1"));
  EXPECT_THAT(error(write("nan.ply", plyText({{0, 0, 0}, {NAN, 0, 0}, {0, 1, 0}}, {{0, 1, 2}}))),
              HasSubstr("nan.ply"));
  EXPECT_THAT(error(write("empty.ply", plyText(triangle, {}))), HasSubstr("no triangles"));
  EXPECT_THAT(error(write("flat.ply", plyText(triangle, {{0, 0, 0}}))),
              HasSubstr("no triangles (1 faces without area)"));
  EXPECT_THAT(error(write("cloud.ply",
                          "ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nproperty "
                          "float y\nproperty float z\nend_header\n0 0 0\n")),
              HasSubstr("no element face"));
  EXPECT_THAT(error(write("what.stl", "solid")), HasSubstr("found STL, expected PLY, OBJ"));
  EXPECT_EQ(load({path("missing.ply")}).status().code(), StatusCode::kIoError);
  EXPECT_EQ(load({}).status().code(), StatusCode::kInvalidArgument);
}

TEST_F(MeshFiles, GroundPlaneLiesBelowAndFacesUp) {
  for (int axis = 0; axis < 3; ++axis) {
    Result<Mesh> mesh = load({write("cube.ply", cubePly(false))});
    ASSERT_TRUE(mesh.ok());
    GroundPlane ground;
    ground.enabled = true;
    ground.up = UpAxis(axis);
    addGroundPlane(ground, *mesh);
    ASSERT_EQ(mesh->triangle.size(), 14u);
    const SurfacePoint point = surfacePoint(*mesh, 13, 0.3f, 0.3f);
    glm::vec3 up(0);
    up[axis] = 1;
    EXPECT_NEAR(glm::distance(point.normal, up), 0, 1e-6f);
    EXPECT_LT(point.position[axis], 0);
    EXPECT_GT(point.position[axis], -1e-3f);
    const double edge = 2 * std::sqrt(3.0);
    EXPECT_NEAR(triangleArea(*mesh, 12) + triangleArea(*mesh, 13), edge * edge, 1e-4);
  }
}

TEST_F(MeshFiles, SharedLionLoadsWhole) {
  const std::string lion = SURFEIT_SHARED_DATA_DIR "/meshes/lion_reconstruction.ply";
  if (!std::filesystem::exists(lion)) GTEST_SKIP() << "no shared data";
  const Result<Mesh> mesh = load({lion});
  ASSERT_TRUE(mesh.ok()) << mesh.status().message();
  EXPECT_EQ(mesh->triangle.size() + mesh->degenerate_faces, 909943u);
  EXPECT_EQ(mesh->color.size(), mesh->position.size());
}

TEST_F(MeshFiles, VerticesAreReadAsThoseOfClouds) {
  const std::string head = "ply\nformat ascii 1.0\nelement vertex 3\n";
  const std::string tail = "element face 1\nproperty list uchar int vertex_indices\nend_header\n";
  const std::string rows = "0 0 0 128 255 0\n1 0 0 128 255 0\n0 1 0 128 255 0\n3 0 1 2\n";
  for (const std::string names :
       {"property double X\nproperty double Y\nproperty double Z\nproperty ushort Red\nproperty "
        "ushort Green\nproperty ushort Blue\n",
        "property float x\nproperty float y\nproperty float z\nproperty int r\nproperty int "
        "g\nproperty int b\n",
        "property float x\nproperty float y\nproperty float z\nproperty float "
        "diffuse_red\nproperty float diffuse_green\nproperty float diffuse_blue\n"}) {
    const Result<Mesh> mesh = load({write("m.ply", head + names + tail + rows)});
    ASSERT_TRUE(mesh.ok()) << mesh.status().message();
    EXPECT_NEAR(surfacePoint(*mesh, 0, .3f, .3f).albedo.x, 0.2158605f, 1e-5f) << names;
    EXPECT_EQ(notes_.notes.size(), 1u) << names;
    notes_.notes.clear();
  }
}

TEST_F(MeshFiles, ColorsOfFacesAreTold) {
  const Result<Mesh> mesh = load({write(
      "m.ply",
      "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float "
      "z\nelement face 1\nproperty list uchar int vertex_indices\nproperty uchar red\nproperty "
      "uchar "
      "green\nproperty uchar blue\nend_header\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2 200 0 0\n")});
  ASSERT_TRUE(mesh.ok()) << mesh.status().message();
  EXPECT_THAT(notes_.notes, testing::ElementsAre(HasSubstr("colors of faces are not read")));
}

TEST_F(MeshFiles, FacesOfWhichEdgesCrossAreTold) {
  const Result<Mesh> mesh =
      load({write("m.ply", plyText({{0, 0, 0}, {2, 2, 0}, {2, 0, 0}, {0, 2, 0}, {-1, 1, 0}},
                                   {{0, 1, 2, 3, 4}}))});
  ASSERT_TRUE(mesh.ok()) << mesh.status().message();
  EXPECT_THAT(notes_.notes, testing::ElementsAre(HasSubstr("edges of 1 faces cross")));
}

TEST_F(MeshFiles, FilesShareAnOrigin) {
  const auto square = [](double x, double y) {
    return fmt::format("v {} {} 0\nv {} {} 0\nv {} {} 0\nf 1 2 3\n", x, y, x + 1, y, x, y + 1);
  };
  const Result<Mesh> mesh =
      load({write("a.obj", square(5e5, 5e6)), write("b.obj", square(5e5 + 10.125, 5e6))});
  ASSERT_TRUE(mesh.ok());
  EXPECT_NE(mesh->origin, glm::dvec3(0));
  EXPECT_EQ(glm::dvec3(mesh->position[3]) - glm::dvec3(mesh->position[0]),
            glm::dvec3(10.125, 0, 0));
}

}  // namespace
}  // namespace surfeit
