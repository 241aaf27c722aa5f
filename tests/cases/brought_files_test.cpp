// Files as public reports about CloudCompare, PDAL, Open3D, PCL, MeshLab, Potree, SuperSplat,
// tinyobjloader and trimesh describe them: read right with what must be told, or refused with the
// way out. `cases_test --gtest_filter=BroughtFiles.*` prints the table.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <cmath>
#include <cstdint>
#include <functional>
#include <glm/geometric.hpp>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "cases/case_files.h"
#include "io/las_test_file.h"
#include "io/test_directory.h"
#include "surfeit/sample.h"
#include "surfels/open_surfel_source.h"

namespace surfeit {
namespace brought {
namespace {

struct Brought {
  std::string kind, name, content;
  std::size_t count = 0;  // of surfels; 0: it is refused
  std::string told{};     // in a note, or in the refusal; empty: nothing is asked
  glm::dvec3 first{1.5, 2.5, 3.5};
  std::optional<glm::dvec3> light{}, normal{};  // of the first
  double area = 0;                              // of a mesh
};

double linearOf(double code) {
  const double s = code / 255;
  return s <= 0.04045 ? s / 12.92 : std::pow((s + 0.055) / 1.055, 2.4);
}
const glm::dvec3 kBrown(linearOf(117), linearOf(73), linearOf(49));
const glm::dvec3 kUp(0, 0, 1);

template <typename... Values>
std::string packed(Values... values) {
  std::string bytes;
  (bytes.append(reinterpret_cast<const char*>(&values), sizeof values), ...);
  return bytes;
}
const std::string kBinaryPlaces = packed(1.5f, 2.5f, 3.5f, 1.f, 2.f, 3.f);

const std::string kXyz = "property float x\nproperty float y\nproperty float z\n";

// A PLY whose properties are "TYPE NAME" separated by commas, behind x y z; `more` elements follow.
std::string ply(const std::string& properties, const std::string& rows,
                const std::string& more = "", const std::string& format = "ascii") {
  std::string text = "ply\nformat " + format + " 1.0\nelement vertex 2\n" + kXyz;
  for (std::size_t at = 0; at < properties.size();) {
    const std::size_t end = std::min(properties.find(',', at), properties.size());
    text += "property " + properties.substr(at, end - at) + "\n";
    at = end + 1;
  }
  return text + more + "end_header\n" + rows;
}
const std::string kBinary = "binary_little_endian";

class BroughtFiles : public DirectoryTest {
 protected:
  std::string wrongOf(const Brought& file) {
    write(file.name, file.content);
    return file.area > 0 || file.kind == "meshes" ? wrongOfMesh(file) : wrongOfCloud(file);
  }

  std::string wrongOfCloud(const Brought& file) {
    const auto source = openSurfelSource(path(file.name), false);
    if (!source.ok()) return told(file, 0, {source.status().message()});
    std::vector<std::string> notes = (*source)->notes();
    std::vector<Surfel> surfels((*source)->recordCount() + 1);
    const Result<std::size_t> count = (*source)->read(surfels);
    if (!count.ok()) return told(file, 0, {count.status().message()});
    notes.push_back((*source)->defects().describe());
    const Surfel& first = surfels.front();
    const auto differs = [](const glm::vec3& a, const glm::dvec3& b) {
      return glm::length(glm::dvec3(a) - b) > 2e-3 * (1 + glm::length(b));
    };
    if (file.count > 0 && differs(first.position, file.first)) return "another place";
    if (file.light && differs(first.radiosity, *file.light)) {
      return fmt::format("light {} {} {}", first.radiosity.r, first.radiosity.g, first.radiosity.b);
    }
    if (file.normal && differs(first.normal, *file.normal)) return "another normal";
    return told(file, *count, notes);
  }

  std::string wrongOfMesh(const Brought& file) {
    SampleOptions options;
    options.count = 50;
    Notes notes;
    const auto stats = sampleMeshes({path(file.name)}, path("out.ply"), options, notes);
    if (!stats.ok()) return told(file, 0, {stats.status().message()});
    if (std::abs(stats->area - file.area) > 1e-5) return fmt::format("area {}", stats->area);
    if (file.light) {
      const glm::dvec3 albedo(columnOf(path("out.ply"), "albedo_r").at(0),
                              columnOf(path("out.ply"), "albedo_g").at(0),
                              columnOf(path("out.ply"), "albedo_b").at(0));
      if (glm::length(albedo - *file.light) > 1e-2) return fmt::format("albedo {}", albedo.r);
    }
    return told(file, file.count, notes.notes);
  }

  static std::string told(const Brought& file, std::size_t count,
                          const std::vector<std::string>& notes) {
    std::string all;
    for (const std::string& note : notes) all += note + " / ";
    if (count != file.count) return fmt::format("{} surfels, {}", count, all);
    return all.find(file.told) != all.npos ? "" : "not told: " + all;
  }
};
using Files = std::vector<Brought>;

void addPly(Files& files) {
  const auto add = [&](const char* kind, const std::string& content, const char* told = "",
                       std::optional<glm::dvec3> light = {}, std::optional<glm::dvec3> normal = {},
                       std::size_t count = 2) {
    files.push_back({kind, "a.ply", content, count, told, {1.5, 2.5, 3.5}, light, normal});
  };
  const char* kind = "names of colors";
  const std::string brown = "1.5 2.5 3.5 117 73 49\n1 2 3 4 5 200\n";
  add(kind, ply("uchar blue,uchar green,uchar red", "1.5 2.5 3.5 49 73 117\n1 2 3 4 5 6\n"), "",
      kBrown);
  add(kind, ply("float green,float blue,float red", "1.5 2.5 3.5 .25 .125 .5\n1 2 3 .1 .2 .3\n"),
      "", glm::dvec3(.5, .25, .125));
  add(kind,
      ply("uchar alpha,uchar red,uchar green,uchar blue",
          "1.5 2.5 3.5 255 117 73 49\n1 2 3 255 5 6 200\n"),
      "", kBrown);
  add(kind, ply("uchar Colour_R,uchar Colour_G,uchar Colour_B", brown), "", kBrown);
  add(kind, ply("uchar gray", "1.5 2.5 3.5 117\n1 2 3 49\n"), "gray looks like a color");
  add(kind, ply("uchar red,uchar greeb,uchar blue", brown),
      "--channels greeb=green takes greeb for it", {}, {}, 0);
  add(kind, ply("uchar red,uchar green,uchar bleu", brown), "--channels bleu=blue", {}, {}, 0);
  add(kind, ply("uchar red,uchar green", "1.5 2.5 3.5 1 2\n1 2 3 4 5\n"),
      "--channels red=-,green=- leaves out", {}, {}, 0);

  kind = "elements of PLY";
  const std::string bare = "1.5 2.5 3.5\n1 2 3\n";
  add(kind,
      ply("list uint float64 descriptor",
          packed(1.5f, 2.5f, 3.5f, std::uint32_t{2}, 7., 8.) +
              packed(1.f, 2.f, 3.f, std::uint32_t{0}),
          "", kBinary),
      "list property descriptor is not kept");
  add(kind, ply("", bare + "0 9\n", "element camera 1\nproperty float view_px\nproperty int k\n"),
      "element camera is not kept");
  add(kind,
      "ply\nformat binary_little_endian 1.0\nelement camera 1\nproperty double f\nproperty "
      "list uchar float m\nelement vertex 2\n" +
          kXyz + "end_header\n" + packed(5.) + std::string("\1") + packed(7.f) + kBinaryPlaces,
      "element camera is not kept");
  for (const char* name : {"point", "points", "surfel"}) {
    add(kind,
        fmt::format("ply\nformat ascii 1.0\nelement vertex 0\n{0}element {1} 2\n{0}"
                    "end_header\n{2}",
                    kXyz, name, bare),
        "");
  }
  add(kind, "ply\nformat ascii 1.0\ncomment not the end_header yet\nelement vertex 2\n" + kXyz +
                "end_header\n1.5 2.5 3.5\n1 2 3");
  add(kind,
      "ply\nformat  ascii   1.0\nelement  vertex\t2\nproperty   float x\nproperty float\ty "
      "\nproperty float z\nend_header \n" +
          bare);
  add(kind, ply("uchar red,uchar green,uchar blue", "1.5 2.5 3.5\n117 73 49\n1 2 3\n4 5 200\n"),
      "row 0: line ends early", {}, {}, 0);

  kind = "normals of PLY";
  add(kind, ply("float nx,float ny,float nz", "1.5 2.5 3.5 0 0 6.2\n1 2 3 3.9 4.8 .2\n"), "", {},
      kUp);
  add(kind, ply("char nx,char ny,char nz", "1.5 2.5 3.5 0 0 127\n1 2 3 127 0 0\n"), "", {}, kUp);
  add(kind, ply("short nx,short ny,short nz", "1.5 2.5 3.5 0 0 32767\n1 2 3 -32767 0 0\n"), "", {},
      kUp);

  kind = "splats";
  const std::string row = " 0 0 0 4 -3 -3 -9 1 0 0 0\n";
  for (const char* prefix : {"", "scalar_", "scalar_scal_"}) {
    std::string names;
    for (const char* name : {"f_dc_0", "f_dc_1", "f_dc_2", "opacity", "scale_0", "scale_1",
                             "scale_2", "rot_0", "rot_1", "rot_2", "rot_3"}) {
      names += fmt::format("{}float {}{}", names.empty() ? "" : ",", prefix, name);
    }
    const std::string two = "1.5 2.5 3.5" + row + "1 2 3" + row;
    add(kind, ply(names, two), "their opacity becomes", glm::dvec3(linearOf(127.5)), kUp);
    add(kind,
        ply("float nx,float ny,float nz," + names, "1.5 2.5 3.5 0 0 0" + row + "1 2 3 0 0 0" + row),
        "their opacity becomes", {}, kUp);
    add(kind, ply(names, "1.5 2.5 3.5" + row + "1 2 3 0 0 0 4 -inf -inf -inf 1 0 0 0\n"),
        "1 record", {}, kUp, 1);
  }
  for (const auto& [name, content, told] :
       {std::tuple{"a.splat", std::string(32, '\1'), "Gaussian splats of a viewer"},
        {"a.ksplat", std::string(99, '\0'), "Gaussian splats of a viewer"},
        {"a.sog", "PK\x03\x04" + std::string(99, '\0'), "the PLY of Gaussian splats"}}) {
    files.push_back({kind, name, content, 0, told});
  }
}

void addPcd(Files& files) {
  const auto add = [&](const std::string& fields, const std::string& rest, std::size_t count,
                       const char* told = "", std::optional<glm::dvec3> light = {}) {
    files.push_back({"PCD",
                     "a.pcd",
                     "# .PCD v0.7\nVERSION 0.7\n" + fields + rest,
                     count,
                     told,
                     {1.5, 2.5, 3.5},
                     light});
  };
  const std::string head = "WIDTH 2\nHEIGHT 1\nVIEWPOINT 0 0 0 1 0 0 0\nPOINTS 2\n";
  const std::string text = head + "DATA ascii\n1.5 2.5 3.5\n1 2 3\n";
  const std::string plain = "FIELDS x y z\nSIZE 4 4 4\nTYPE F F F\n";
  add("FIELDS x y z i class\nSIZE 4 4 4 4\nTYPE F F F F\nCOUNT 1 1 1 1\n", text, 0,
      "expected as many sizes, types and counts as fields");
  add("FIELDS x y z _\nSIZE 4 4 4 4\nTYPE F F F U\nCOUNT 1 1 1 0\n",
      head + "DATA binary\n" + kBinaryPlaces, 2);
  add(plain, text, 2);
  add(plain + "COUNT 1 1 1\n", "WIDTH 2\nHEIGHT 1\nDATA ascii\n1.5 2.5 3.5\n1 2 3\n", 2);
  add(plain, head + "DATA BINARY\n" + kBinaryPlaces, 0, "expected DATA ascii, binary");
  const std::string one = packed(9.f, std::uint16_t{3}) + std::string(10, '\xee');
  add("FIELDS x y z _ intensity ring _\nSIZE 4 4 4 1 4 2 1\nTYPE F F F U F U U\nCOUNT 1 1 1 4 1 1 "
      "10\n",
      head + "DATA binary\n" + packed(1.5f, 2.5f, 3.5f, 0) + one + packed(1.f, 2.f, 3.f, 0) + one,
      2);
  // As floats of six digits: 7686449 is 0x754931, and 4210752 gray
  const std::string rgb = "FIELDS x y z rgb\nSIZE 4 4 4 4\nTYPE F F F F\nCOUNT 1 1 1 1\n" + head;
  add(rgb, "DATA ascii\n1.5 2.5 3.5 7.68645e+06\n1 2 3 4.21075e+06\n", 2,
      "the text lost the last ones");
  add(rgb, "DATA ascii\n1.5 2.5 3.5 7686449\n1 2 3 4210752\n", 2, "", kBrown);
}

void addText(Files& files) {
  const auto add = [&](const char* kind, const char* name, const std::string& content,
                       std::size_t count, const char* told = "",
                       std::optional<glm::dvec3> light = {},
                       std::optional<glm::dvec3> normal = {}) {
    files.push_back({kind, name, content, count, told, {1.5, 2.5, 3.5}, light, normal});
  };
  const char* kind = "heads of text";
  std::string rows;
  for (int i = 0; i < 3; ++i) rows += "1.5;2.5;3.5;1;0.5;0.25;0.5;0.9;0;0;1\n";
  add(kind, "a.pts", "//X;Y;Z;Rf;Gf;Bf;Intensity;Illuminance (PCV);Nx;Ny;Nz\n3\n" + rows, 3, "",
      glm::dvec3(1, .5, .25), kUp);
  add(kind, "a.csv", ",x,y,z\n0,1.5,2.5,3.5\n1,1,2,3\n2,4,5,6\n", 3);
  add(kind, "a.txt", "# x y z\n1.5,2.5,3.5\n1,2,3\n", 2);
  add(kind, "a.csv", "\xef\xbb\xbfx,y,z\r\n1.5,2.5,3.5\r\n1,2,3\r\n", 2);
  add(kind, "a.csv", "x,z,y\n1.5,3.5,2.5\n1,3,2\n", 2);
  add(kind, "a.csv", "name,x,y,z\nA1,1.5,2.5,3.5\nB2,1,2,3\n", 0, "--channels 1=- leaves");
  add(kind, "a.csv", "RelativeTime,Latitude,Longitude,Elevation\n0,69.3,-49.8,630\n", 0, "angles");
  add(kind, "a.csv", "geom,id\n\"POINT Z (1.5 2.5 3.5)\",1\n", 0, "names of columns with x, y");
  add(kind, "a.asc", "ncols 3\nnrows 1\nxllcorner 5\nyllcorner 5\ncellsize 1\n1 2 3\n", 0,
      "gdal_translate -of XYZ");

  kind = "values of text";
  const std::string scan = "3\n1.5 2.5 3.5 {} 117 73 49\n1 2 3 {} 4 5 200\n2 3 4 {} 9 9 9\n";
  add(kind, "a.pts", fmt::format(fmt::runtime(scan), -1500, -900, 2047), 3, "x y z intensity red",
      kBrown);
  add(kind, "a.pts", fmt::format(fmt::runtime(scan), .25, .5, .75), 3, "x y z intensity red",
      kBrown);
  for (const char* color : {"#754931", "#FF8800FF"}) {
    add(kind, "a.txt", fmt::format("1.5 2.5 3.5 {0}\n1 2 3 {0}\n", color), 2,
        "2 of these comments look like colors");
  }
  add(kind, "a.txt", "1.5 2.5 3.5 # first\n1 2 3\n", 2, "behind the values of 1 of 2 rows");
  add(kind, "a.txt", "1.5 2.5 3.5 117,73,49\n1 2 3 4,5,200\n", 0, "--text decimal-point");
  add(kind, "a.xyz", "+1.5 +2.5 +3.5\n  1\t 2\t\t3  \n", 2);
  add(kind, "a.csv", "x,y,z\n\"1,234.5\",\"2,345.6\",\"3.5\"\n", 0, "commas stand within quotes");
  add(kind, "a.xyz", "1.5 2.5 3.5\n1 2 3\nEOF\n", 0, "a # in front makes a comment");
  add(kind, "a.csv", "x,y,z,valid\n1.5,2.5,3.5,True\n1,2,3,False\n", 0, "--channels 4=- leaves");
}

void addLas(Files& files) {
  const auto add = [&](const std::string& content, std::size_t count, const char* told = "") {
    files.push_back({"LAS", "a.las", content, count, told});
  };
  const auto with = [](unsigned minor, unsigned format, std::size_t at, auto value) {
    std::string las = makeLas(minor, format, 3);
    putLas(las, at, value);
    return las;
  };
  add(with(2, 0, 147, 0.), 0, "found scale 0");
  add(with(2, 0, 171, std::nan("")), 0, "found offset nan");
  add(with(4, 6, 94, std::uint16_t{227}), 0, "a header of 227 bytes, expected 375");
  add(with(2, 0, 105, std::uint16_t{19}), 0, "points of 19 bytes, expected 20");
}

void addMeshes(Files& files) {
  const std::string square = "v 0 0 0\nv 2 0 0\nv 2 2 0\nv 0 2 0\n";
  const std::string raised = "v 0 0 5\nv 2 0 5\nv 2 2 5\nv 0 2 5\n";
  const auto add = [&](const char* name, const std::string& content, double area,
                       const char* told = "", std::optional<glm::dvec3> albedo = {}) {
    files.push_back({"meshes", name, content, area > 0 ? 1u : 0u, told, {}, albedo, {}, area});
  };
  const glm::dvec3 red(1, 0, 0), half(.5);
  const std::string face = "f -4 -3 -2 -1\n";
  add("a.obj", square + face + raised + face, 8);
  for (const char* zero : {"f 0 1 2\n", "f 1 2 0\n", "f 1/0 2/0 3/0\n"}) {
    add("a.obj", square + "vt 0 0\n" + zero, 0, "found index 0, expected 1 or more");
  }
  add("a.obj", "usemtl red\nmtllib red.mtl\n" + square + face, 4, "", red);
  add("a.obj", "usemtl blank\n" + square + face + "mtllib red.mtl\nusemtl red\n" + raised + face, 8,
      "'blank' ] not found");
  add("a.obj", "mtllib red.mtl\n" + square + face, 4, "no face uses any of the 1 materials", half);
  add("a.obj", "mtllib red.mtl\nusemtl Red\n" + square + face, 4, "'Red' ] not found", half);
  add("a.obj", "mtllib red.mtl\r\nusemtl red \r\n" + square + face, 4, "", red);
  add("a.obj", "mtllib C:\\temp\\red.mtl\nusemtl red\n" + square + face, 4, "", red);
  add("a.obj", "mtllib other.mtl red.mtl\nusemtl red\n" + square + face, 4, "not found", red);
  add("a.obj", "mtllib both.mtl\nusemtl w\n" + square + face, 4, "Both `d` and `Tr`");
  add("a.obj", "o a b c\n" + square + "g one two\ns off\n" + face, 4);
  for (const auto& [name, content, format] :
       {std::tuple{"a.glb", "glTF\2" + std::string(99, '\0'), "glTF"},
        {"a.stl", std::string("solid a\nendsolid a\n"), "STL"},
        {"b.stl", "Exported" + std::string(99, '\0'), "STL"},
        {"a.fbx", "Kaydara FBX Binary  " + std::string(99, '\0'), "FBX"},
        {"a.abc", "Ogawa\xff" + std::string(99, '\0'), "Alembic"},
        {"a.usdc", "PXR-USDC" + std::string(99, '\0'), "USD"},
        {"a.off", std::string("OFF\n3 1 0\n"), "OFF"},
        {"a.dae", std::string("<?xml version=\"1.0\"?>"), "XML"}}) {
    add(name, content, 0, format);
  }
  add("a.xyzzy", "nothing", 0, "found no mesh that we read, expected PLY, OBJ");
}

TEST_F(BroughtFiles, ComeOutRightOrAreRefusedWithTheWayOut) {
  write("red.mtl", "newmtl red\nKd 1 0 0\n");
  write("both.mtl", "newmtl w\nKd .5 .5 .5\nTr 1\nd 1\n");
  Files files;
  addPly(files);
  addPcd(files);
  addText(files);
  addLas(files);
  addMeshes(files);
  struct Counts {
    int right = 0, refused = 0, wrong = 0;
  };
  std::map<std::string, Counts> table;
  for (const Brought& file : files) {
    const std::string wrong = wrongOf(file);
    EXPECT_EQ(wrong, "") << file.kind << ", " << file.name << ": " << file.content.substr(0, 300);
    Counts& counts = table[file.kind];
    ++(!wrong.empty() ? counts.wrong : file.count == 0 ? counts.refused : counts.right);
  }
  fmt::print("\n{:20} {:>6} {:>8} {:>6}\n", "kind", "right", "refused", "wrong");
  for (const auto& [kind, counts] : table) {
    fmt::print("{:20} {:6} {:8} {:6}\n", kind, counts.right, counts.refused, counts.wrong);
  }
}

// A direction of 16 bits is no sign of a missing value; a height is.
TEST_F(BroughtFiles, LargestCodesOfNormalsAreDirections) {
  const std::string names = "short nx,short ny,short nz,float height";
  EXPECT_EQ(wrongOf({"normals",
                     "a.ply",
                     ply(names, "1.5 2.5 3.5 0 0 32767 5\n1 2 3 -32767 0 0 6\n"),
                     2,
                     "",
                     {1.5, 2.5, 3.5},
                     {},
                     kUp}),
            "");
  const auto notes = [&](const std::string& rows) {
    write("a.ply", ply(names, rows));
    const auto source = openSurfelSource(path("a.ply"), false);
    EXPECT_TRUE(source.ok());
    std::string all;
    for (const std::string& note : (*source)->notes()) all += note;
    return all;
  };
  EXPECT_EQ(notes("1 2 3 0 0 32767 5\n1 2 3 -32767 0 0 6\n").find("no value"), std::string::npos);
  EXPECT_NE(notes("1 2 3 0 0 32767 5\n1 2 3 -32767 0 0 -9999\n").find("height is -9999"),
            std::string::npos);
}

}  // namespace
}  // namespace brought
}  // namespace surfeit
