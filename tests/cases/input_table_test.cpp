// Clouds and meshes as people send them, in variants of every kind that was once read wrongly: each
// is read right or refused with the way out. `cases_test --gtest_filter=InputTable.*` prints the
// table.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <bit>
#include <cmath>
#include <glm/geometric.hpp>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <tuple>
#include <vector>

#include "cases/case_files.h"
#include "io/test_directory.h"
#include "sample/meshes/mesh.h"
#include "surfels/open_surfel_source.h"

namespace surfeit {
namespace {

// What a cloud must come to, or what its refusal says.
struct Expected {
  std::size_t count = 0;
  glm::dvec3 first{0};                  // place of the first surfel
  std::optional<glm::dvec3> radiosity;  // linear
  std::optional<glm::dvec3> normal;
  std::string told;     // in a note
  std::string refusal;  // in the error, instead of all that
  double coverage = 0;  // of splats
};

struct Case {
  std::string kind, variant, name, content;
  Expected expected;
};

double linear(double code) {
  const double s = code / 255;
  return s <= 0.04045 ? s / 12.92 : std::pow((s + 0.055) / 1.055, 2.4);
}
const glm::dvec3 kBrown(linear(117), linear(73), linear(49));

Expected places(std::size_t count, const glm::dvec3& first) {
  return {count, first, {}, {}, {}, {}, 0};
}
Expected brown(std::size_t count, const glm::dvec3& first, const std::string& told = "") {
  return {count, first, kBrown, {}, told, {}, 0};
}
Expected facing(std::size_t count, const glm::dvec3& first, const glm::dvec3& normal) {
  return {count, first, {}, normal, {}, {}, 0};
}
Expected told(Expected expected, const std::string& text) {
  expected.told = text;
  return expected;
}
Expected refused(const std::string& text) { return {0, {}, {}, {}, {}, text, 0}; }

// An ASCII PLY; properties are "TYPE NAME,...".
std::string ply(const std::string& properties, const std::vector<std::string>& rows,
                const std::string& end = "\n", const std::string& magic = "ply") {
  std::string text =
      magic + end + "format ascii 1.0" + end + fmt::format("element vertex {}", rows.size()) + end;
  for (std::size_t at = 0; at < properties.size();) {
    const std::size_t next = std::min(properties.find(',', at), properties.size());
    text += "property " + properties.substr(at, next - at) + end;
    at = next + 1;
  }
  text += "end_header" + end;
  for (const std::string& row : rows) text += row + end;
  return text;
}

std::string pcd(const std::string& fields, const std::string& types, const std::string& sizes,
                const std::vector<std::string>& rows) {
  std::string counts;
  for (std::size_t i = 0; i < types.size(); i += 2) counts += i == 0 ? "1" : " 1";
  std::string text = fmt::format(
      "# .PCD v.7 - Point Cloud Data file format\nVERSION .7\nFIELDS {}\nSIZE {}\nTYPE {}\nCOUNT "
      "{}\nWIDTH {}\nHEIGHT 1\nVIEWPOINT 0 0 0 1 0 0 0\nPOINTS {}\nDATA ascii\n",
      fields, sizes, types, counts, rows.size(), rows.size());
  for (const std::string& row : rows) text += row + "\n";
  return text;
}

constexpr const char* kXyz = "float x,float y,float z";

void addText(std::vector<Case>& cases) {
  const glm::dvec3 first(418.446, 50.29, 4.725);
  const auto add = [&](const char* kind, const char* variant, const char* name,
                       const std::string& content, const Expected& expected) {
    cases.push_back({kind, variant, name, content, expected});
  };
  const char* kind = "decimal commas";
  add(kind, "semicolons", "a.csv", "418,446;50,290;4,725\n419,5;51,25;4,75\n", places(2, first));
  add(kind, "semicolons, header", "a.csv", "x;y;z\n418,446;50,290;4,725\n1,5;2,5;3,5\n",
      places(2, first));
  add(kind, "tabs", "a.txt", "418,446\t50,290\t4,725\n419,5\t51,25\t4,75\n", places(2, first));
  add(kind, "blanks", "a.xyz", "418,446 50,290 4,725\n419,5 51,25 4,75\n", places(2, first));
  add(kind, "commas between, too", "a.csv", "418,446,50,290,4,725\n419,500,51,250,4,750\n",
      refused("decimal"));

  kind = "names of columns";
  add(kind, "easting", "a.csv", "Easting,Northing,Elevation\n418.446,50.29,4.725\n1,2,3\n",
      places(2, first));
  add(kind, "east and height", "a.csv", "EASTING;NORTHING;HEIGHT\n418.446;50.29;4.725\n1;2;3\n",
      places(2, first));
  add(kind, "quoted", "a.csv", "\"X\",\"Y\",\"Z\"\n418.446,50.29,4.725\n1,2,3\n", places(2, first));
  add(kind, "quoted with blanks", "a.csv", "\" X \";\" Y \";\" Z \"\n418.446;50.29;4.725\n1;2;3\n",
      places(2, first));
  add(kind, "units", "a.csv", "x [m],y [m],z [m]\n418.446,50.29,4.725\n1,2,3\n", places(2, first));
  add(kind, "ParaView", "a.csv",
      "\"Points:0\",\"Points:1\",\"Points:2\"\n418.446,50.29,4.725\n1,2,3\n", places(2, first));
  add(kind, "CloudCompare", "a.txt", "//X Y Z\n418.446 50.29 4.725\n1 2 3\n", places(2, first));
  add(kind, "hash", "a.xyz", "# x y z\n418.446 50.29 4.725\n1 2 3\n", places(2, first));
  add(kind, "other order", "a.csv", "z,y,x\n4.725,50.29,418.446\n1,2,3\n", places(2, first));
  add(kind, "separator named", "a.csv", "sep=;\nx;y;z\n418,446;50,290;4,725\n1,5;2,5;3,5\n",
      places(2, first));
  add(kind, "separator named in quotes", "a.csv",
      "\"sep=,\"\r\nx,y,z\r\n418.446,50.29,4.725\r\n1,2,3\r\n", places(2, first));
  add(kind, "no places", "a.csv", "height,width\n1,2\n3,4\n", refused("x"));

  kind = "line ends";
  const std::string lines = "418.446 50.29 4.725;1 2 3;4 5 6;";
  const auto ended = [&](const std::string& end, bool is_last = true) {
    std::string text;
    for (const char c : lines) text += c == ';' ? end : std::string(1, c);
    return is_last ? text : text.substr(0, text.size() - end.size());
  };
  add(kind, "CR", "a.txt", ended("\r"), places(3, first));
  add(kind, "CRLF", "a.xyz", ended("\r\n"), places(3, first));
  add(kind, "none at the end", "a.xyz", ended("\n", false), places(3, first));
  add(kind, "blank lines", "a.txt", ended("\n\n"), places(3, first));
  add(kind, "byte order mark", "a.xyz", "\xef\xbb\xbf" + ended("\n"), places(3, first));

  kind = "scans as text";
  add(kind, "PTS", "a.pts", "2\n418.446 50.29 4.725 -100 117 73 49\n1 2 3 5 1 2 3\n",
      brown(2, first));
  add(kind, "PTS, two scans", "a.pts",
      "2\n418.446 50.29 4.725 -100 117 73 49\n1 2 3 5 1 2 3\n1\n7 8 9 5 1 2 3\n", brown(3, first));
  add(kind, "PTS, too few", "a.pts", "3\n418.446 50.29 4.725 -100 117 73 49\n1 2 3 5 1 2 3\n",
      told(places(2, first), "scan 1 counts 3 points, 2 follow"));
  add(kind, "PTX", "a.ptx",
      "2\n1\n0 0 0\n1 0 0\n0 1 0\n0 0 1\n1 0 0 0\n0 1 0 0\n0 0 1 0\n400 50 0 1\n"
      "18.446 .29 4.725 .5\n1 2 3 .5\n",
      places(2, first));
  add(kind, "PTX, points that miss", "a.ptx",
      "2\n1\n0 0 0\n1 0 0\n0 1 0\n0 0 1\n1 0 0 0\n0 1 0 0\n0 0 1 0\n400 50 0 1\n"
      "18.446 .29 4.725 .5\n0 0 0 .5\n",
      places(1, first));

  kind = "colors in text";
  add(kind, "codes", "a.xyz", "418.446 50.29 4.725 117 73 49\n1 2 3 9 10 200\n", brown(2, first));
  add(kind, "codes as reals", "a.xyz",
      "418.446 50.29 4.725 117.0 73.0 49.0\n1 2 3 9.0 10.0 200.0\n", brown(2, first));
  add(kind, "alpha", "a.xyz", "418.446 50.29 4.725 117 73 49 255\n1 2 3 9 10 200 255\n",
      brown(2, first));
  add(kind, "intensity before", "a.txt",
      "//X Y Z Intensity R G B\n418.446 50.29 4.725 800 117 73 49\n1 2 3 90 9 10 200\n",
      brown(2, first));
  add(kind, "Rf Gf Bf", "a.txt",
      "//X Y Z Rf Gf Bf\n418.446 50.29 4.725 0.178 0.067 0.031\n1 2 3 .5 .5 .5\n",
      {2, first, glm::dvec3(.178, .067, .031), {}, {}, {}, 0});
  add(kind, "red green blue", "a.csv",
      "x,y,z,red,green,blue\n418.446,50.29,4.725,117,73,49\n1,2,3,4,5,6\n", brown(2, first));
  add(kind, "16 bits", "a.csv",
      "x,y,z,r,g,b\n418.446,50.29,4.725,30069,18761,12593\n1,2,3,65535,5,6\n", brown(2, first));

  kind = "normals in text";
  add(kind, "nx ny nz", "a.csv", "x,y,z,nx,ny,nz\n418.446,50.29,4.725,0,0,1\n1,2,3,1,0,0\n",
      facing(2, first, {0, 0, 1}));
  add(kind, "Nx Ny Nz", "a.txt", "//X Y Z Nx Ny Nz\n418.446 50.29 4.725 0 0 1\n1 2 3 1 0 0\n",
      facing(2, first, {0, 0, 1}));
  add(kind, "nan where there is none", "a.xyz",
      "418.446 50.29 4.725 0 0 1\nnan 2 3 0 0 0\n1 2 3 nan nan nan\n4 5 6 0.6 0 0.8\n",
      facing(2, first, {0, 0, 1}));
  add(kind, "normals:0", "a.csv",
      "\"Points:0\",\"Points:1\",\"Points:2\",\"Normals:0\",\"Normals:1\",\"Normals:2\"\n"
      "418.446,50.29,4.725,0,0,1\n1,2,3,1,0,0\n",
      facing(2, first, {0, 0, 1}));

  kind = "places far from 0";
  const glm::dvec3 utm(500123.4567, 5000123.4567, 123.4567);
  add(kind, "UTM, text", "a.xyz", "500123.4567 5000123.4567 123.4567\n500124 5000124 123\n",
      places(2, utm));
  add(kind, "UTM, PLY of doubles", "a.ply",
      ply("double x,double y,double z",
          {"500123.4567 5000123.4567 123.4567", "500124 5000124 123"}),
      places(2, utm));
  add(kind, "ECEF, text", "a.csv",
      "x,y,z\n4196511.1234,172345.5678,4780123.9012\n4196512,172346,4780124\n",
      places(2, {4196511.1234, 172345.5678, 4780123.9012}));
  add(kind, "UTM, PCD of doubles", "a.pcd",
      pcd("x y z", "F F F", "8 8 8", {"500123.4567 5000123.4567 123.4567", "500124 5000124 123"}),
      places(2, utm));

  kind = "what is no cloud";
  add(kind, "empty", "a.xyz", "", refused("a.xyz"));
  add(kind, "words", "a.txt", "this is a letter\nto a friend\n", refused("a.txt"));
  add(kind, "a table of two columns", "a.csv", "1,2\n3,4\n", refused("a.csv"));
  add(kind, "LAZ", "a.laz",
      std::string("LASF") + std::string(100, '\0') + char(0x80 | 3) + std::string(300, '\0'),
      refused("a.laz"));
  add(kind, "no finite place", "a.xyz", "nan nan nan\nnan nan nan\n", places(0, {}));
}

void addPly(std::vector<Case>& cases) {
  const glm::dvec3 first(1.5, 2.5, 3.5);
  const auto add = [&](const char* kind, const std::string& variant, const std::string& content,
                       const Expected& expected) {
    cases.push_back({kind, variant, "a.ply", content, expected});
  };
  const char* kind = "names in PLY";
  const std::vector<std::string> bare = {"1.5 2.5 3.5", "1 2 3"};
  add(kind, "X Y Z", ply("float X,float Y,float Z", bare), places(2, first));
  add(kind, "doubles", ply("double x,double y,double z", bare), places(2, first));
  add(kind, "float32", ply("float32 x,float32 y,float32 z", bare), places(2, first));
  add(kind, "another order", ply("float z,float y,float x", {"3.5 2.5 1.5", "3 2 1"}),
      places(2, first));
  add(kind, "CRLF", ply(kXyz, bare, "\r\n"), places(2, first));
  add(kind, "blank behind the magic", ply(kXyz, bare, "\n", "ply "), places(2, first));
  add(kind, "integers", ply("int x,int y,int z", {"1 2 3", "4 5 6"}), places(2, {1, 2, 3}));
  add(kind, "no z", ply("float x,float y", {"1 2", "3 4"}), refused("z"));
  add(kind, "too few rows",
      "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float "
      "y\nproperty float z\nend_header\n1 2 3\n4 5 6\n",
      refused("a.ply"));

  kind = "normals in PLY";
  const std::vector<std::string> turned = {"1.5 2.5 3.5 0 0 2", "1 2 3 1 0 0"};
  for (const char* names :
       {"nx,ny,nz", "normal_x,normal_y,normal_z", "NX,NY,NZ", "n_x,n_y,n_z",
        "normalx,normaly,normalz", "NormalX,NormalY,NormalZ", "scalar_Nx,scalar_Ny,scalar_Nz"}) {
    std::string properties = std::string(kXyz) + ",float ";
    for (const char* c = names; *c != 0; ++c)
      properties += *c == ',' ? ",float " : std::string(1, *c);
    add(kind, names, ply(properties, turned), facing(2, first, {0, 0, 1}));
  }

  kind = "colors in PLY";
  struct Colors {
    const char *type, *names, *codes, *others;
  };
  for (const Colors& c :
       {Colors{"uchar", "red,green,blue", "117 73 49", "1 2 200"},
        Colors{"uint8", "r,g,b", "117 73 49", "1 2 200"},
        Colors{"uchar", "Red,Green,Blue", "117 73 49", "1 2 200"},
        Colors{"uchar", "diffuse_red,diffuse_green,diffuse_blue", "117 73 49", "1 2 200"},
        Colors{"ushort", "red,green,blue", "117 73 49", "1 2 200"},
        Colors{"ushort", "red,green,blue", "30069 18761 12593", "65535 5 6"},
        Colors{"int", "red,green,blue", "117 73 49", "1 2 200"},
        Colors{"float", "red,green,blue", "117 73 49", "1 2 200"},
        Colors{"float", "scalar_R,scalar_G,scalar_B", "117 73 49", "1 2 200"},
        Colors{"double", "r,g,b", "117 73 49", "1 2 200"}}) {
    std::string properties = std::string(kXyz) + "," + c.type + " ";
    for (const char* p = c.names; *p != 0; ++p) {
      properties += *p == ',' ? std::string(",") + c.type + " " : std::string(1, *p);
    }
    add(kind, fmt::format("{} {}", c.type, c.names),
        ply(properties, {std::string("1.5 2.5 3.5 ") + c.codes, std::string("1 2 3 ") + c.others}),
        brown(2, first));
  }
  add(kind, "with alpha",
      ply(std::string(kXyz) + ",uchar red,uchar green,uchar blue,uchar alpha",
          {"1.5 2.5 3.5 117 73 49 255", "1 2 3 4 5 6 255"}),
      brown(2, first));
  add(kind, "reals of 0 to 1",
      ply(std::string(kXyz) + ",float red,float green,float blue",
          {"1.5 2.5 3.5 .178 .067 .031", "1 2 3 .5 .5 .5"}),
      {2, first, glm::dvec3(.178, .067, .031), {}, {}, {}, 0});
  add(kind, "unknown names",
      ply(std::string(kXyz) + ",uchar tint_red,uchar tint_green,uchar tint_blue",
          {"1.5 2.5 3.5 117 73 49", "1 2 3 4 5 6"}),
      {2, first, {}, {}, "look like a color", {}, 0});
}

void addPcd(std::vector<Case>& cases) {
  const glm::dvec3 first(1.5, 2.5, 3.5);
  const auto add = [&](const char* kind, const char* variant, const std::string& content,
                       const Expected& expected) {
    cases.push_back({kind, variant, "a.pcd", content, expected});
  };
  const char* kind = "PCD";
  const int packed = 117 << 16 | 73 << 8 | 49;
  add(kind, "rgb as integers in F",
      pcd("x y z rgb", "F F F F", "4 4 4 4", {fmt::format("1.5 2.5 3.5 {}", packed), "1 2 3 255"}),
      brown(2, first));
  add(kind, "rgb as integers in U",
      pcd("x y z rgb", "F F F U", "4 4 4 4", {fmt::format("1.5 2.5 3.5 {}", packed), "1 2 3 255"}),
      brown(2, first));
  add(kind, "rgb as packed floats",
      pcd("x y z rgb", "F F F F", "4 4 4 4",
          {fmt::format("1.5 2.5 3.5 {:.9e}", std::bit_cast<float>(packed)), "1 2 3 3.57e-43"}),
      brown(2, first));
  add(kind, "rgba",
      pcd("x y z rgba", "F F F U", "4 4 4 4",
          {fmt::format("1.5 2.5 3.5 {}", 0xff000000u | unsigned(packed)), "1 2 3 4278190335"}),
      brown(2, first));
  add(kind, "r g b",
      pcd("x y z r g b", "F F F U U U", "4 4 4 1 1 1", {"1.5 2.5 3.5 117 73 49", "1 2 3 4 5 6"}),
      brown(2, first));
  add(kind, "normal_x",
      pcd("x y z normal_x normal_y normal_z", "F F F F F F", "4 4 4 4 4 4",
          {"1.5 2.5 3.5 0 0 1", "1 2 3 1 0 0"}),
      facing(2, first, {0, 0, 1}));
  add(kind, "X Y Z", pcd("X Y Z", "F F F", "4 4 4", {"1.5 2.5 3.5", "1 2 3"}), places(2, first));
  add(kind, "places of nan",
      pcd("x y z", "F F F", "4 4 4", {"1.5 2.5 3.5", "nan nan nan", "1 2 3"}), places(2, first));
}

// Of Gaussians as trainers write them: opacity is a logit, scales are logarithms.
void addSplats(std::vector<Case>& cases) {
  const std::string names =
      "float x,float y,float z,float f_dc_0,float f_dc_1,float f_dc_2,float opacity,float "
      "scale_0,float scale_1,float scale_2,float rot_0,float rot_1,float rot_2,float rot_3";
  const auto row = [](const char* place, double logit) {
    return fmt::format("{} 0 0 0 {} -3 -3 -9 1 0 0 0", place, logit);
  };
  for (const auto& [variant, logit, coverage] :
       {std::tuple{"opaque", 4., .982}, std::tuple{"half", 0., .5},
        std::tuple{"faint", -4., .018}}) {
    Expected expected = facing(2, {1.5, 2.5, 3.5}, {0, 0, 1});
    expected.coverage = coverage;
    cases.push_back({"splats", variant, "a.ply",
                     ply(names, {row("1.5 2.5 3.5", logit), row("1 2 3", 1)}), expected});
  }
}

struct MeshCase {
  std::string variant, name, content;
  double area = 0;
  std::string refusal;
};

std::vector<MeshCase> meshes() {
  const std::string corners = "v 0 0 0\nv 4 0 0\nv 4 4 0\nv 2 1 0\nv 0 4 0\n";  // an arrow: 10
  const std::string square = "v 0 0 0\nv 2 0 0\nv 2 2 0\nv 0 2 0\n";
  std::string with_cr = square + "f 1 2 3 4\n";
  for (char& c : with_cr) c = c == '\n' ? '\r' : c;
  return {
      {"concave", "a.obj", corners + "f 1 2 3 4 5\n", 10, ""},
      {"concave, turned", "a.obj", corners + "f 5 4 3 2 1\n", 10, ""},
      {"concave, from its notch", "a.obj", corners + "f 4 5 1 2 3\n", 10, ""},
      {"concave PLY", "a.ply",
       "ply\nformat ascii 1.0\nelement vertex 5\nproperty float x\nproperty float y\nproperty "
       "float "
       "z\nelement face 1\nproperty list uchar int vertex_indices\nend_header\n0 0 0\n4 0 0\n4 4 "
       "0\n2 1 0\n0 4 0\n5 0 1 2 3 4\n",
       10, ""},
      {"counted from the end", "a.obj", square + "f -4 -3 -2 -1\n", 4, ""},
      {"continued lines", "a.obj", square + "f 1 2 \\\n3 4\n", 4, ""},
      {"CR", "a.obj", with_cr, 4, ""},
      {"texture and normal indices", "a.obj",
       square + "vt 0 0\nvn 0 0 1\nf 1/1/1 2/1/1 3/1/1 4/1/1\n", 4, ""},
      {"normal indices", "a.obj", square + "vn 0 0 1\nf 1//1 2//1 3//1 4//1\n", 4, ""},
      {"colors behind places", "a.obj",
       "v 0 0 0 1 0 0\nv 2 0 0 1 0 0\nv 2 2 0 1 0 0\nv 0 2 0 1 0 0\nf 1 2 3 4\n", 4, ""},
      {"no material file", "a.obj", "mtllib not here.mtl\nusemtl red\n" + square + "f 1 2 3 4\n", 4,
       ""},
      {"far from 0", "a.obj",
       "v 500000.25 5000000.25 0\nv 500002.25 5000000.25 0\nv 500002.25 5000002.25 0\nv 500000.25 "
       "5000002.25 0\nf 1 2 3 4\n",
       4, ""},
      {"faces without area", "a.obj", square + "f 1 2 3 4\nf 1 1 2\n", 4, ""},
      {"decimal commas", "a.obj", "v 0,0 0,0 0,0\nv 2,5 0,0 0,0\nv 2,5 2,5 0,0\nf 1 2 3\n", 0, ","},
      {"a corner that is not there", "a.obj", square + "f 1 2 9\n", 0, "vertex"},
      {"points alone", "a.obj", square, 0, "no triangles"},
      {"STL by another name", "a.stl", "solid a\nendsolid a\n", 0, "expected PLY"},
  };
}

struct Row {
  int variants = 0, right = 0, refused = 0, wrong = 0;
  void add(const std::string& found) {
    ++variants;
    ++(found == "right" ? right : found == "refused" ? refused : wrong);
  }
};

class InputTable : public DirectoryTest {
 protected:
  // "right", "refused" or what is wrong.
  std::string outcome(const Case& input) {
    const std::string file = path(input.name);
    write(input.name, input.content);
    const Expected& expected = input.expected;
    Result<std::unique_ptr<SurfelSource>> source = openSurfelSource(file, false);
    std::vector<Surfel> surfels(16);
    Status status = source.status();
    if (source.ok()) {
      (*source)->setOrigin(expected.first);
      const Result<std::size_t> count = (*source)->read(surfels);
      status = count.status();
      surfels.resize(count.ok() ? *count : 0);
    }
    if (!expected.refusal.empty()) {
      if (status.ok()) return fmt::format("not refused, {} surfels", surfels.size());
      return status.message().find(expected.refusal) != std::string::npos ? "refused"
                                                                          : status.message();
    }
    if (!status.ok()) return status.message();
    return difference(expected, surfels, (*source)->notes());
  }

  std::string outcome(const MeshCase& input) {
    write(input.name, input.content);
    Progress quiet;
    const Result<Mesh> mesh = loadMeshes({path(input.name)}, glm::vec3(.5f), quiet);
    if (!mesh.ok()) {
      const bool is_right = !input.refusal.empty() &&
                            mesh.status().message().find(input.refusal) != std::string::npos;
      return is_right ? "refused" : mesh.status().message();
    }
    double area = 0;
    for (std::uint32_t t = 0; t < mesh->triangle.size(); ++t) area += triangleArea(*mesh, t);
    if (!input.refusal.empty()) return fmt::format("not refused, area {}", area);
    return std::abs(area - input.area) < 1e-4 ? "right" : fmt::format("area {}", area);
  }

  static std::string difference(const Expected& expected, const std::vector<Surfel>& surfels,
                                const std::vector<std::string>& notes) {
    if (surfels.size() != expected.count) return fmt::format("{} surfels", surfels.size());
    if (surfels.empty()) return "right";
    const Surfel& first = surfels.front();
    if (glm::length(first.position) > 1e-4f) {
      return fmt::format("place off by {}", glm::length(first.position));
    }
    const auto isNear = [](const glm::dvec3& a, const glm::dvec3& b) {
      return glm::length(a - b) < 2e-3;
    };
    if (expected.radiosity && !isNear(*expected.radiosity, glm::dvec3(first.radiosity))) {
      return fmt::format("radiosity {} {} {}", first.radiosity.r, first.radiosity.g,
                         first.radiosity.b);
    }
    if (expected.normal && !isNear(*expected.normal, glm::dvec3(first.normal))) {
      return fmt::format("normal {} {} {}", first.normal.x, first.normal.y, first.normal.z);
    }
    if (expected.coverage > 0 && std::abs(double(first.area) + expected.coverage) > .01) {
      return fmt::format("coverage {}", -first.area);
    }
    for (const std::string& note : notes) {
      if (note.find(expected.told) != std::string::npos) return "right";
    }
    return expected.told.empty() ? "right" : "not told: " + expected.told;
  }
};

TEST_F(InputTable, EveryInputIsReadRightOrRefusedWithTheWayOut) {
  std::vector<Case> cases;
  addText(cases);
  addPly(cases);
  addPcd(cases);
  addSplats(cases);
  std::map<std::string, Row> table;
  for (const Case& input : cases) {
    const std::string found = outcome(input);
    table[input.kind].add(found);
    EXPECT_TRUE(found == "right" || found == "refused")
        << input.kind << ", " << input.variant << ": " << found;
  }
  for (const MeshCase& input : meshes()) {
    const std::string found = outcome(input);
    table["meshes"].add(found);
    EXPECT_TRUE(found == "right" || found == "refused") << input.variant << ": " << found;
  }
  fmt::print("{:20} {:>8} {:>8} {:>8} {:>8}\n", "kind", "variants", "right", "refused", "wrong");
  for (const auto& [kind, row] : table) {
    fmt::print("{:20} {:8} {:8} {:8} {:8}\n", kind, row.variants, row.right, row.refused,
               row.wrong);
  }
}

}  // namespace
}  // namespace surfeit
