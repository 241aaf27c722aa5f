#include <gmock/gmock.h>

#include <glm/geometric.hpp>

#include "sample/meshes/mesh.h"
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

// The parser makes it .6 in the first material of a file and 0 in the others.
TEST_F(ObjFiles, PicturesWithoutKdAreTheColor) {
  write("t.ppm", ppm());
  write("m.mtl",
        "newmtl a\nmap_Kd t.ppm\nnewmtl b\nKd .5 .5 .5\nnewmtl c\nmap_Kd t.ppm\n"
        "newmtl d\nmap_Kd t.ppm\nKd .25 .25 .25\n");
  const Result<Mesh> mesh =
      load(write("m.obj",
                 "mtllib m.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0.75 0.5\nusemtl a\n"
                 "f 1/1 2/1 3/1\nusemtl c\nf 1/1 2/1 3/1\nusemtl d\nf 1/1 2/1 3/1\n"));
  ASSERT_TRUE(mesh.ok()) << mesh.status().message();
  const float expected[] = {1, 1, .25f};
  for (std::uint32_t i = 0; i < 3; ++i) {
    EXPECT_NEAR(surfacePoint(*mesh, i, .3f, .3f).albedo.x, expected[i], 1e-5f) << i;
  }
  EXPECT_THAT(notes_.notes, testing::ElementsAre(
                                HasSubstr("material \"a\" has map_Kd and no Kd: read as Kd 1 1 1"),
                                HasSubstr("material \"c\" has map_Kd and no Kd")));
}

TEST_F(ObjFiles, MaterialsWithoutKdHaveTheDefaultAndAreTold) {
  write("m.mtl",
        "newmtl dull paint\nKa 0 0 0\nNs 10\nnewmtl lamp\nKe 1 1 1\nnewmtl mirror\nillum 3\nKs 1 1 "
        "1\nnewmtl black\nKd 0 0 0\n");
  const Result<Mesh> mesh =
      load(write("m.obj",
                 "mtllib m.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nusemtl dull paint\nf 1 2 3\n"
                 "usemtl lamp\nf 1 2 3\nusemtl mirror\nf 1 2 3\nusemtl black\nf 1 2 3\n"));
  ASSERT_TRUE(mesh.ok()) << mesh.status().message();
  const float expected[] = {.5f, 0, 0, 0};
  for (std::uint32_t i = 0; i < 4; ++i) {
    EXPECT_EQ(surfacePoint(*mesh, i, .3f, .3f).albedo, glm::vec3(expected[i])) << i;
  }
  EXPECT_THAT(notes_.notes, testing::ElementsAre(HasSubstr("material \"dull paint\" has no Kd")));
}

TEST_F(ObjFiles, OneValueOfAColorIsThatOfAllThree) {
  write("m.mtl", "newmtl a\nKd 0.5\nKe 2 # bright\n");
  const Result<Mesh> mesh =
      load(write("m.obj", "mtllib m.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nusemtl a\nf 1 2 3\n"));
  ASSERT_TRUE(mesh.ok()) << mesh.status().message();
  EXPECT_EQ(surfacePoint(*mesh, 0, .3f, .3f).albedo, glm::vec3(.5f));
  EXPECT_NEAR(surfacePoint(*mesh, 0, .3f, .3f).emission.z, 2 * 3.14159265f, 1e-5f);
}

TEST_F(ObjFiles, StatementsOfMaterialsMayHaveAnyCase) {
  write("t.ppm", ppm());
  write("m.mtl", "newmtl a\nkd 0.5 0.25 1 # blue\nNEWMTL b\nKD 1 1 1\nMAP_KD t.ppm\n");
  const Result<Mesh> mesh =
      load(write("m.obj",
                 "mtllib m.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nvt .25 .5\nusemtl a\n"
                 "f 1/1 2/1 3/1\nusemtl b\nf 1/1 2/1 3/1\n"));
  ASSERT_TRUE(mesh.ok()) << mesh.status().message();
  EXPECT_EQ(surfacePoint(*mesh, 0, .3f, .3f).albedo, glm::vec3(.5f, .25f, 1));
  EXPECT_NEAR(surfacePoint(*mesh, 1, .3f, .3f).albedo.x, 0.2158605f, 1e-5f);
  EXPECT_TRUE(notes_.notes.empty());
}

TEST_F(ObjFiles, NameMayEndInAnyCase) {
  for (const char* const name : {"a.obj", "a.OBJ", "a.Obj"}) {
    const Result<Mesh> mesh = load(write(name, "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n"));
    ASSERT_TRUE(mesh.ok()) << mesh.status().message();
    EXPECT_EQ(mesh->triangle.size(), 1u) << name;
  }
}

// The parser takes the name for a value that an option leaves out.
TEST_F(ObjFiles, OptionsOfPicturesMayLeaveOutValues) {
  write("my t.ppm", ppm());
  for (const std::string options :
       {"", "-o 0 0 ", "-s 1 1 1 ", "-s 1 ", "-blendu on -s 1 1 -imfchan m ", "-o 0.0 -t 0 0 "}) {
    write("m.mtl", "newmtl a\nKd 1 1 1\nmap_Kd " + options + "my t.ppm\n");
    const Result<Mesh> mesh =
        load(write("m.obj",
                   "mtllib m.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nvt .25 .5\nusemtl a\n"
                   "f 1/1 2/1 3/1\n"));
    ASSERT_TRUE(mesh.ok()) << mesh.status().message();
    EXPECT_NEAR(surfacePoint(*mesh, 0, .3f, .3f).albedo.x, 0.2158605f, 1e-5f) << options;
  }
  EXPECT_TRUE(notes_.notes.empty());
  write("m.mtl",
        "newmtl a\nKd 1 1 1\nmap_Kd -s 2 2 -mm 0 .5 my t.ppm\nnewmtl b\nKd 1 1 1\n"
        "map_Kd -mm 0 .5 my t.ppm\n");
  ASSERT_TRUE(
      load(write("m.obj", std::string("mtllib m.mtl\n") + "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n"))
          .ok());
  EXPECT_THAT(notes_.notes, testing::ElementsAre(HasSubstr("-s and -o of texture my t.ppm"),
                                                 HasSubstr("-mm and -clamp of texture my t.ppm"),
                                                 HasSubstr("no face uses any of the 2 materials")));
}

TEST_F(ObjFiles, PicturesLieBesideTheObjOrTheMaterialFile) {
  std::filesystem::create_directory(path("paints"));
  std::filesystem::create_directory(path("maps"));
  write("paints/inner.ppm", ppm());
  write("maps/outer.ppm", ppm());
  write("flat.ppm", ppm());
  for (const std::string name : {"inner.ppm", "maps/outer.ppm", "maps\\outer.ppm",
                                 "C:\\work\\tex\\flat.ppm", "/elsewhere/inner.ppm"}) {
    write("paints/m.mtl", "newmtl a\nKd 1 1 1\nmap_Kd " + name + "\n");
    const Result<Mesh> mesh =
        load(write("m.obj",
                   "mtllib paints/m.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nvt .25 .5\nusemtl a\n"
                   "f 1/1 2/1 3/1\n"));
    ASSERT_TRUE(mesh.ok()) << mesh.status().message();
    EXPECT_NEAR(surfacePoint(*mesh, 0, .3f, .3f).albedo.x, 0.2158605f, 1e-5f) << name;
  }
  EXPECT_TRUE(notes_.notes.empty());
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

constexpr const char* kSquare =
    "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\n";

double areaOf(const Mesh& mesh) {
  double area = 0;
  for (std::uint32_t i = 0; i < mesh.triangle.size(); ++i) area += triangleArea(mesh, i);
  return area;
}

TEST_F(ObjFiles, BackslashesContinueLines) {
  for (const std::string face :
       {"f 1 2 \\\n 3 4\n", "f \\\n1 \\\n2 \\ \n3 4", "f 1 2 \\\r\n3 4\r\n"}) {
    const Result<Mesh> mesh =
        load(write("m.obj", kSquare + face + "\n# end \\\nf 1 2 9 # no comment\n"));
    EXPECT_THAT(mesh.status().message(), HasSubstr("face 1: vertex 9")) << face;
    const Result<Mesh> good = load(write("m.obj", kSquare + face));
    ASSERT_TRUE(good.ok()) << good.status().message();
    EXPECT_NEAR(areaOf(*good), 1, 1e-12) << face;
  }
}

TEST_F(ObjFiles, WhatIsNoNumberIsRefusedWithItsLine) {
  struct Case {
    std::string text, said;
  };
  const std::vector<Case> cases = {
      {"v 0,25 0 0\n", "line 1: found \"0,25\", expected a number with a decimal point"},
      {"v 1 2 3\nvn 0 0 1,0\n", "line 2: found \"1,0\""},
      {"v 1 2 3\n\n\nvt x 1\n", "line 4: found \"x\", expected a number"},
      {"v 1 nan 2\n", "line 1: found \"nan\""},
      {"v 1 2 \\\n3,5\n", "line 2: found \"3,5\""},
  };
  for (const Case& bad : cases) {
    const Result<Mesh> mesh = load(write("m.obj", bad.text + kSquare + "f 1 2 3\n"));
    EXPECT_EQ(mesh.status().code(), StatusCode::kCorruption);
    EXPECT_THAT(mesh.status().message(), HasSubstr("m.obj: " + bad.said));
  }
  write("m.mtl", "newmtl a\nKd 0,2 0,4 0,6\n");
  EXPECT_THAT(load(write("m.obj", std::string("mtllib m.mtl\n") + kSquare + "f 1 2 3\n"))
                  .status()
                  .message(),
              HasSubstr("m.mtl: line 2: found \"0,2\""));
  // Signs, exponents and comments are of numbers
  EXPECT_TRUE(load(write("m.obj", "v +1 -2e-3 3.E1 # one, two\nv 1 0 0\nv 0 0 1\nf 1 2 3\n")).ok());
}

TEST_F(ObjFiles, ColorsInSpectraAndCieAreRefusedWithTheWayOut) {
  for (const std::string statement : {"Ka", "Kd", "Ks", "Ke", "Tf", "kd"}) {
    for (const std::string color : {"spectral paint.rfl 1", "xyz 0.5 .25 .125"}) {
      write("m.mtl", "newmtl a\n" + statement + " " + color + "\n");
      const Result<Mesh> mesh =
          load(write("m.obj", std::string("mtllib m.mtl\n") + kSquare + "usemtl a\nf 1 2 3\n"));
      EXPECT_THAT(mesh.status().message(),
                  testing::AllOf(HasSubstr("m.mtl: line 2: found \"" + color.substr(0, 3)),
                                 HasSubstr("replace them by red, green and blue")));
    }
  }
  EXPECT_THAT(load(write("m.obj", std::string(kSquare) + "v 1 2 xyz\n")).status().message(),
              testing::Not(HasSubstr("CIE")));
}

TEST_F(ObjFiles, TextInUtf16IsRefusedWithTheWayOut) {
  const std::string text = kSquare + std::string("f 1 2 3 4\n");
  const auto wide = [](const std::string& of, bool is_big_endian, bool has_mark) {
    std::string bytes;
    if (has_mark) bytes = is_big_endian ? "\xfe\xff" : "\xff\xfe";
    for (const char c : of) {
      if (is_big_endian) bytes += '\0';
      bytes += c;
      if (!is_big_endian) bytes += '\0';
    }
    return bytes;
  };
  for (const bool is_big_endian : {false, true}) {
    for (const bool has_mark : {false, true}) {
      const Status obj = load(write("m.obj", wide(text, is_big_endian, has_mark))).status();
      EXPECT_EQ(obj.code(), StatusCode::kCorruption);
      EXPECT_THAT(obj.message(),
                  testing::AllOf(HasSubstr("m.obj: found text in UTF-16, expected UTF-8"),
                                 HasSubstr("iconv -f UTF-16")));
      write("m.mtl", wide("newmtl a\nKd 1 0 0\n", is_big_endian, has_mark));
      EXPECT_THAT(load(write("a.obj", "mtllib m.mtl\nusemtl a\n" + text)).status().message(),
                  HasSubstr("m.mtl: found text in UTF-16"));
    }
  }
}

TEST_F(ObjFiles, NamesOfMaterialsAndTheirFilesMayHaveBlanks) {
  write("my paints.mtl", "newmtl red paint\nKd 0.7 0.1 0.1\nnewmtl red\nKd 0 0 1\n");
  write("a.mtl", "newmtl blue  paint\nKd 0.1 0.1 0.7\n");
  for (const std::string library :
       {"my paints.mtl", "C:\\models\\my paints.mtl", "../elsewhere/my paints.mtl "}) {
    const Result<Mesh> mesh = load(
        write("m.obj", "mtllib " + library + "\n" + kSquare + "usemtl red paint \nf 1 2 3 4\n"));
    ASSERT_TRUE(mesh.ok()) << mesh.status().message();
    EXPECT_EQ(surfacePoint(*mesh, 0, .3f, .3f).albedo, glm::vec3(0.7f, 0.1f, 0.1f)) << library;
  }
  EXPECT_TRUE(notes_.notes.empty());
  write("b.mtl", "newmtl red\nKd 1 0 0\n");
  const Result<Mesh> both =
      load(write("m.obj", std::string("mtllib a.mtl b.mtl\n") + kSquare +
                              "usemtl red\nf 1 2 3\nusemtl blue  paint\nf 1 3 4\n"));
  ASSERT_TRUE(both.ok());
  EXPECT_EQ(surfacePoint(*both, 0, .3f, .3f).albedo, glm::vec3(1, 0, 0));
  EXPECT_EQ(surfacePoint(*both, 1, .3f, .3f).albedo, glm::vec3(0.1f, 0.1f, 0.7f));
  EXPECT_TRUE(notes_.notes.empty());
}

TEST_F(ObjFiles, DissolveAndMasksSayHowMuchIsThere) {
  // Left texel there, right one not: as lightness, and as alpha would be
  write("mask.ppm", std::string("P6\n2 1\n255\n\xff\xff\xff") + std::string(3, '\0'));
  write("m.mtl",
        "newmtl glass\nKd 1 1 1\nd 0.3\nnewmtl old\nKd 1 1 1\nTr 0.25\nnewmtl halo\nKd 1 1 1\n"
        "d -halo 0.5\nnewmtl leaf\nKd 1 1 1\nd 0.5\nmap_d mask.ppm\n");
  const Result<Mesh> mesh = load(
      write("m.obj",
            std::string("mtllib m.mtl\n") + kSquare +
                "usemtl glass\nf 1 2 3\nusemtl old\nf 1 2 3\nusemtl halo\nf 1 2 3\n"
                "vt 0.25 0.5\nvt 0.75 0.5\nusemtl leaf\nf 1/5 2/5 3/5\nf 1/6 2/6 3/6\nf 1 2 3\n"));
  ASSERT_TRUE(mesh.ok()) << mesh.status().message();
  EXPECT_FALSE(mesh->isOpaque());
  const float expected[] = {.3f, .75f, .5f, .5f, 0, .5f};
  for (std::uint32_t i = 0; i < 6; ++i) {
    EXPECT_NEAR(surfacePoint(*mesh, i, .3f, .3f).opacity.r, expected[i], 1e-6f) << i;
  }
  EXPECT_THAT(notes_.notes, testing::ElementsAre(HasSubstr("1 of 3 faces of material \"leaf\"")));
}

TEST_F(ObjFiles, ClearMaterialsAreTold) {
  write("m.mtl", "newmtl clear\nd 0\n");
  const Result<Mesh> mesh =
      load(write("m.obj", std::string("mtllib m.mtl\n") + kSquare + "usemtl clear\nf 1 2 3\n"));
  ASSERT_TRUE(mesh.ok());
  EXPECT_THAT(notes_.notes, testing::ElementsAre(HasSubstr("material \"clear\" is clear")));
}

TEST_F(ObjFiles, ColorsOfEightBitsAndWhatIsNoFaceAreTold) {
  const Result<Mesh> mesh = load(write(
      "m.obj", "v 0 0 0 255 0 128\nv 1 0 0 255 0 128\nv 0 1 0 255 0 128\nf 1 2 3\nl 1 2 3\n"));
  ASSERT_TRUE(mesh.ok());
  EXPECT_NEAR(surfacePoint(*mesh, 0, .3f, .3f).albedo.x, 1, 1e-5f);
  EXPECT_NEAR(surfacePoint(*mesh, 0, .3f, .3f).albedo.z, 0.2158605f, 1e-5f);
  EXPECT_THAT(notes_.notes, testing::UnorderedElementsAre(HasSubstr("0-255"),
                                                          HasSubstr("lines and points of 3")));
}

TEST_F(ObjFiles, PlacesOnAMapKeepTheirDigits) {
  const std::string near = "v 0.25 0.125 0.5\nv 1.25 0.125 0.5\nv 1.25 1.125 0.5\nf 1 2 3\n";
  const std::string far =
      "v 500000.25 5000000.125 100.5\nv 500001.25 5000000.125 100.5\nv 500001.25 5000001.125 "
      "100.5\nf 1 2 3\n";
  const Result<Mesh> at_0 = load(write("near.obj", near)), moved = load(write("far.obj", far));
  ASSERT_TRUE(at_0.ok() && moved.ok());
  EXPECT_EQ(at_0->origin, glm::dvec3(0));
  for (std::size_t i = 0; i < 3; ++i) {
    const glm::dvec3 shift(500000, 5000000, 100);
    EXPECT_EQ(glm::dvec3(moved->position[i]) + moved->origin - shift,
              glm::dvec3(at_0->position[i]));
  }
  EXPECT_TRUE(notes_.notes.empty());
}

TEST_F(ObjFiles, MaterialFilesThatAreMissingAreToldByTheirNames) {
  ASSERT_TRUE(load(write("m.obj", std::string("mtllib my paints.mtl\n") + kSquare +
                                      "usemtl red paint\nf 1 2 3\n"))
                  .ok());
  EXPECT_THAT(
      notes_.notes,
      testing::ElementsAre(HasSubstr("material file \"my paints.mtl\" not found (and 1 more)")));
}

TEST_F(ObjFiles, OneOfSeveralMaterialFilesMayBeMissing) {
  write("a.mtl", "newmtl a\nKd 1 0 0\n");
  const Result<Mesh> mesh = load(
      write("m.obj", std::string("mtllib a.mtl gone.mtl\n") + kSquare + "usemtl a\nf 1 2 3\n"));
  ASSERT_TRUE(mesh.ok()) << mesh.status().message();
  EXPECT_EQ(surfacePoint(*mesh, 0, .3f, .3f).albedo, glm::vec3(1, 0, 0));
  EXPECT_THAT(notes_.notes, testing::ElementsAre(HasSubstr("\"gone.mtl\" not found")));
}

}  // namespace
}  // namespace surfeit
