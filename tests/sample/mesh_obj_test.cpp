#include <gmock/gmock.h>

#include <glm/geometric.hpp>

#include "sample/mesh.h"
#include "sample/scene_files.h"

namespace surfeit {
namespace {

using ::testing::HasSubstr;

class ObjFiles : public SceneFiles {
 protected:
  Result<Mesh> load(const std::string& path) { return loadMeshes({path}, glm::vec3(0.5f), notes_); }
  RecordedNotes notes_;
};

// 2 x 1 texels: 128 128 128 and 255 0 0 (binary PPM, which stb_image reads).
std::string ppm() {
  return std::string("P6\n2 1\n255\n") + "\x80\x80\x80\xff" + std::string(2, '\0');
}

TEST_F(ObjFiles, MaterialsGiveReflectanceAndEmission) {
  write("m.mtl", "newmtl a\nKd 0.2 0.4 0.6\nnewmtl b\nKd 0 0 0\nKe 1 2 3\n");
  const Result<Mesh> mesh = load(write("m.obj",
                                       "mtllib m.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nusemtl b\n"
                                       "f 1 2 3\nusemtl a\nf -3 -2 -1\nusemtl c\nf 1 2 3\n"));
  ASSERT_TRUE(mesh.ok()) << mesh.status().message();
  ASSERT_EQ(mesh->triangle.size(), 3u);
  const glm::vec3 emission = surfacePoint(*mesh, 0, 0.3f, 0.3f).emission;
  EXPECT_NEAR(glm::distance(emission, 3.14159265f * glm::vec3(1, 2, 3)), 0, 1e-5f);
  EXPECT_EQ(surfacePoint(*mesh, 1, 0.3f, 0.3f).albedo, glm::vec3(0.2f, 0.4f, 0.6f));
  EXPECT_EQ(mesh->position.size(), 3u);  // equal corners become one vertex
}

TEST_F(ObjFiles, TexturesAreSrgbAndMultiplyKd) {
  write("t.ppm", ppm());
  write("m.mtl", "newmtl a\nKd 0.5 0.5 0.5\nmap_Kd t.ppm\n");
  const Result<Mesh> mesh =
      load(write("m.obj",
                 "mtllib m.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0.25 0.5\nvt 0.75 0.5\nusemtl a\n"
                 "f 1/1 2/1 3/1\nf 1/2 2/2 3/2\n"));
  ASSERT_TRUE(mesh.ok()) << mesh.status().message();
  ASSERT_EQ(mesh->textures.size(), 1u);
  EXPECT_NEAR(surfacePoint(*mesh, 0, 0.3f, 0.3f).albedo.x, 0.5f * 0.2158605f, 1e-5f);
  EXPECT_NEAR(surfacePoint(*mesh, 1, 0.3f, 0.3f).albedo.x, 0.5f, 1e-5f);
  EXPECT_NEAR(surfacePoint(*mesh, 1, 0.3f, 0.3f).albedo.y, 0, 1e-5f);
  EXPECT_TRUE(notes_.notes.empty());
}

TEST_F(ObjFiles, MissingTextureIsToldAndKdRemains) {
  write("m.mtl",
        "newmtl a\nKd 0.3 0.3 0.3\nmap_Kd gone.png\nnewmtl b\nKd 1 1 1\nmap_Kd gone.png\n");
  const Result<Mesh> mesh = load(
      write("m.obj", "mtllib m.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nusemtl a\nf 1/1 2/1 3/1\n"));
  ASSERT_TRUE(mesh.ok()) << mesh.status().message();
  EXPECT_EQ(surfacePoint(*mesh, 0, 0.3f, 0.3f).albedo, glm::vec3(0.3f));
  ASSERT_EQ(notes_.notes.size(), 1u);
  EXPECT_THAT(notes_.notes[0], HasSubstr("gone.png"));
}

TEST_F(ObjFiles, MissingMaterialFileIsTold) {
  const Result<Mesh> mesh =
      load(write("m.obj", "mtllib gone.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nusemtl a\nf 1 2 3\n"));
  ASSERT_TRUE(mesh.ok()) << mesh.status().message();
  EXPECT_EQ(surfacePoint(*mesh, 0, 0.3f, 0.3f).albedo, glm::vec3(0.5f));
  EXPECT_FALSE(notes_.notes.empty());
}

TEST_F(ObjFiles, BadIndicesAreRefusedNamingTheFace) {
  const std::string vertices = "v 0 0 0\nv 1 0 0\nv 0 1 0\nvn 0 0 1\n";
  const Result<Mesh> vertex = load(write("v.obj", vertices + "f 1 2 3\nf 1 2 4\n"));
  EXPECT_EQ(vertex.status().code(), StatusCode::kCorruption);
  EXPECT_THAT(vertex.status().message(), HasSubstr("v.obj: face 1: vertex 4, expected 1 to 3"));
  EXPECT_EQ(load(write("n.obj", vertices + "f 1//1 2//1 3//2\n")).status().code(),
            StatusCode::kCorruption);
  EXPECT_EQ(load(write("z.obj", vertices + "f 0 1 2\n")).status().code(), StatusCode::kCorruption);
  EXPECT_EQ(load(write("garbage.obj", std::string(1000, '\xff'))).status().code(),
            StatusCode::kCorruption);
}

TEST_F(ObjFiles, FacesOfMoreThan255CornersAreRefused) {
  std::string text, face = "f";
  for (int i = 1; i <= 300; ++i) {
    text += fmt::format("v {} {} 0\n", i, i * i);
    face += fmt::format(" {}", i);
  }
  EXPECT_THAT(load(write("m.obj", text + face + "\n")).status().message(),
              HasSubstr("more than 255 corners"));
}

TEST_F(ObjFiles, SharedSponzaLoadsWithItsTextures) {
  const std::string sponza = SURFEIT_SHARED_DATA_DIR "/scenes/sponza/sponza.obj";
  if (!std::filesystem::exists(sponza)) GTEST_SKIP() << "no shared data";
  const Result<Mesh> mesh = load(sponza);
  ASSERT_TRUE(mesh.ok()) << mesh.status().message();
  EXPECT_EQ(mesh->triangle.size() + mesh->degenerate_faces, 66445u);
  EXPECT_EQ(mesh->textures.size(), 10u);
  EXPECT_TRUE(notes_.notes.empty()) << notes_.notes[0];
}

}  // namespace
}  // namespace surfeit
