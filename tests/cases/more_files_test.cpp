// Further kinds of files that people bring, each in variants: read right with what must be told, or
// refused with the way out. `cases_test --gtest_filter=MoreFiles.*` prints the table.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <bit>
#include <cmath>
#include <cstring>
#include <glm/geometric.hpp>
#include <map>
#include <string>
#include <vector>

#include "cases/case_files.h"
#include "io/test_directory.h"
#include "surfeit/sample.h"
#include "surfels/open_surfel_source.h"

namespace surfeit {
namespace {

struct BroughtFile {
  std::string kind, variant, name, content;
  std::size_t count = 0;  // of surfels; 0: it is refused
  glm::dvec3 first{0};    // place of the first surfel
  std::string told;       // in a note, or in the refusal; empty: nothing is asked
  double area = 0;        // of a mesh, instead
};

class MoreFiles : public DirectoryTest {
 protected:
  using Files = std::vector<BroughtFile>;

  // Empty when it comes out as it must.
  std::string wrongOf(const BroughtFile& file) {
    write(file.name, file.content);
    return file.name.ends_with(".obj") || file.name.ends_with("mesh.ply") ? wrongOfMesh(file)
                                                                          : wrongOfCloud(file);
  }

  std::string wrongOfCloud(const BroughtFile& file) {
    const auto source = openSurfelSource(path(file.name), false);
    if (!source.ok()) return compare(file, 0, {}, {source.status().message()});
    std::vector<std::string> notes = (*source)->notes();
    std::vector<Surfel> surfels((*source)->recordCount() + 1);
    const Result<std::size_t> count = (*source)->read(surfels);
    if (!count.ok()) return compare(file, 0, {}, {count.status().message()});
    notes.push_back((*source)->defects().describe());
    return compare(file, *count, glm::dvec3(surfels[0].position), notes);
  }

  std::string wrongOfMesh(const BroughtFile& file) {
    SampleOptions options;
    options.count = 50;
    Notes notes;
    const auto stats = sampleMeshes({path(file.name)}, path("out.ply"), options, notes);
    if (!stats.ok()) return compare(file, 0, {}, {stats.status().message()});
    if (std::abs(stats->area - file.area) > 1e-5) return fmt::format("area {}", stats->area);
    return compare(file, file.count, file.first, notes.notes);
  }

  static std::string compare(const BroughtFile& file, std::size_t count, const glm::dvec3& first,
                             const std::vector<std::string>& notes) {
    if (count != file.count) {
      return fmt::format("{} surfels, {}", count, notes.empty() ? "" : notes.back());
    }
    if (glm::length(first - file.first) > 1e-4 * (1 + glm::length(file.first))) {
      return fmt::format("first at {} {} {}", first.x, first.y, first.z);
    }
    for (const std::string& note : notes) {
      if (note.find(file.told) != note.npos) return {};
    }
    return notes.empty() && file.told.empty()
               ? ""
               : "not told: " + fmt::format("{}", fmt::join(notes, " / "));
  }
};

std::string ply(const std::vector<std::string>& properties, const std::string& rows,
                const std::string& count, const std::string& format = "ascii 1.0") {
  std::string text = fmt::format("ply\nformat {}\nelement vertex {}\n", format, count);
  for (const std::string& property : properties) text += "property " + property + "\n";
  return text + "end_header\n" + rows;
}
const std::vector<std::string> kXyz = {"float x", "float y", "float z"};

std::string bytesOf(const std::vector<float>& values) {
  std::string bytes(4 * values.size(), '\0');
  std::memcpy(bytes.data(), values.data(), bytes.size());
  return bytes;
}

// As a program writes it that opened its file as text.
std::string inTextMode(std::string bytes) {
  for (std::size_t at = bytes.find('\n'); at != bytes.npos; at = bytes.find('\n', at + 2)) {
    bytes.insert(at, "\r");
  }
  return bytes;
}

void addTables(std::vector<BroughtFile>& files) {
  const auto add = [&](const char* kind, const char* variant, const char* name,
                       const std::string& content, std::size_t count, const glm::dvec3& first,
                       const char* told = "") {
    files.push_back({kind, variant, name, content, count, first, told, 0});
  };
  const char* kind = "time in front";
  const auto timed = [](double scale, const char* head) {
    std::string text = head;
    for (int i = 0; i < 12; ++i) {
      text += fmt::format("{:.6f} {} {} {}\n", (1614556800 + .1 * i) * scale, .5 * i, .25 * i, 1.);
    }
    return text;
  };
  add(kind, "seconds", "a.txt", timed(1, ""), 0, {}, "--channels 1=gps_time,2=x,3=y,4=z");
  add(kind, "milliseconds", "a.txt", timed(1e3, ""), 0, {}, "--channels 1=gps_time");
  add(kind, "nanoseconds", "a.txt", timed(1e9, ""), 0, {}, "--channels 1=gps_time");
  add(kind, "named", "a.txt", timed(1, "timestamp x y z\n"), 12, {0, 0, 1});

  kind = "thousands";
  add(kind, "apostrophes", "a.csv", "x;y;z\n2'600'000.5;1'200'000.5;400\n", 0, {}, "apostrophes");
  add(kind, "apostrophes, no names", "a.txt", "2'600'000.5 1'200'000.5 400\n", 0, {},
      "apostrophes");
  add(kind, "blanks", "a.csv", "x;y;z\n2 600 000;1 200 000;400\n", 0, {}, "7 values, expected 3");
  add(kind, "low lines", "a.csv", "x,y,z\n1_000,2,3\n", 0, {}, "found '1_000,2,3'");

  kind = "molecules";
  const std::string atoms = "O 0 0 .117\nH 0 .757 -.469\nH 0 -.757 -.469\n";
  add(kind, "with a comment", "a.xyz", "3\nwater\n" + atoms, 0, {}, "a # in front");
  add(kind, "without", "a.xyz", "3\n\n" + atoms, 0, {}, "--channels 2=x,3=y,4=z");

  kind = "separators at ends";
  add(kind, "commas", "a.csv", "1.5,2.5,3.5,\n2.5,3.5,4.5,\n", 2, {1.5, 2.5, 3.5});
  add(kind, "commas, names", "a.csv", "x,y,z,\n1.5,2.5,3.5,\n", 1, {1.5, 2.5, 3.5});
  add(kind, "rows alone", "a.csv", "x,y,z\n1.5,2.5,3.5,\n", 1, {1.5, 2.5, 3.5});

  kind = "numbers of other programs";
  add(kind, "Fortran", "a.xyz", "1.5D+03 2.5D+00 3.5D-01\n2.5D+03 2.5D+00 4.5D-01\n", 2,
      {1500, 2.5, .35});
  add(kind, "hexadecimal", "a.xyz", "0x1.8p3 1 2\n", 0, {}, "found '0x1.8p3 1 2'");
  add(kind, "run together", "a.xyz", "-1.50-2.50-3.50\n", 0, {}, "found '-1.50-2.50-3.50'");
  add(kind, "percent", "a.csv", "x,y,z,cover\n1,2,3,50%\n", 0, {}, "--channels 4=-");
  add(kind, "SQL's null", "a.csv", "x,y,z\n1,2,\\N\n", 0, {}, "found");

  kind = "lists of lists";
  add(kind, "brackets", "a.txt", "[1.5, 2.5, 3.5]\n", 0, {}, "blanks, tabs, commas");
  add(kind, "parentheses", "a.txt", "(1.5, 2.5, 3.5)\n", 0, {}, "blanks, tabs, commas");
  add(kind, "names and values", "a.txt", "x=1.5 y=2.5 z=3.5\nx=2.5 y=3.5 z=4.5\n", 0, {}, "found");
  add(kind, "a table", "a.txt", "| x | y | z |\n|---|---|---|\n| 1 | 2 | 3 |\n", 0, {},
      "a # in front");

  kind = "rows of other lengths";
  add(kind, "shorter", "a.xyz", "1.5 2.5 3.5\n2.5 3.5\n", 0, {},
      "row 1 at line 2: line ends early");
  add(kind, "longer", "a.xyz", "1.5 2.5 3.5\n2.5 3.5 4.5 7\n", 0, {}, "row 1 at line 2: found '7'");
  add(kind, "label behind colors", "a.txt", "1.5 2 3 10 20 30 1\n2.5 2 3 40 200 30 2\n", 0, {},
      "say which");

  kind = "counts of PTS";
  add(kind, "too large", "a.pts", "9\n1.5 2.5 3.5 100 10 20 30\n2.5 3 4 90 10 20 99\n", 2,
      {1.5, 2.5, 3.5}, "counts 9 points, 2 follow");
  add(kind, "too small", "a.pts", "1\n1.5 2.5 3.5 100 10 20 30\n2.5 3 4 90 10 20 99\n", 2,
      {1.5, 2.5, 3.5}, "counts 1 points, 2 follow");
}

void addBinaries(std::vector<BroughtFile>& files) {
  const auto add = [&](const char* kind, const char* variant, const char* name,
                       const std::string& content, std::size_t count, const glm::dvec3& first,
                       const char* told = "") {
    files.push_back({kind, variant, name, content, count, first, told, 0});
  };
  const char* kind = "not what its name says";
  add(kind, "a web page", "a.las", "<!DOCTYPE html><html><head>", 0, {}, "download the file");
  add(kind, "a pointer of Git LFS", "a.ply", "version https://git-lfs.github.com/spec/v1\noid x\n",
      0, {}, "git lfs pull");
  add(kind, "an archive", "a.ply", std::string("PK\3\4") + std::string(99, '\0'), 0, {},
      "unpack it first");
  add(kind, "nothing", "a.pcd", "", 0, {}, "the file is empty");

  kind = "text mode";
  std::vector<float> places;
  for (int i = 0; i < 900; ++i) places.push_back(std::bit_cast<float>(0x3f0a0a00 + 10 * i));
  add(kind, "PLY", "a.ply",
      ply(kXyz, inTextMode(bytesOf(places)), "300", "binary_little_endian 1.0"), 0, {},
      "text mode, which puts a byte 13");
  add(kind, "whole", "a.ply", ply(kXyz, bytesOf(places), "300", "binary_little_endian 1.0"), 300,
      {places[0], places[1], places[2]});

  kind = "headers of PLY";
  add(kind, "count as a real", "a.ply", ply(kXyz, "1 2 3\n", "1.0"), 0, {}, "a count below 2^64");
  add(kind, "count below 0", "a.ply", ply(kXyz, "1 2 3\n", "-1"), 0, {}, "a count below 2^64");
  add(kind, "half", "a.ply", ply({"half x", "half y", "half z"}, "1 2 3\n", "1"), 0, {},
      "expected a type");
  add(kind, "a name of two words", "a.ply",
      ply({"float x", "float y", "float z", "float scan angle"}, "1 2 3 4\n", "1"), 0, {},
      "expected one property name");
  add(kind, "a name twice", "a.ply",
      ply({"float x", "float y", "float z", "float x"}, "1 2 3 4\n", "1"), 0, {},
      "expected a new property name");
  add(kind, "commas between", "a.ply", ply(kXyz, "1,2,3\n", "1"), 0, {}, "no commas");
  add(kind, "long integers", "a.ply", ply({"long x", "long y", "long z"}, "1 2 3\n", "1"), 1,
      {1, 2, 3}, "become float64");
  add(kind, "lists of colors", "a.ply",
      ply({"float x", "float y", "float z", "list uchar uchar rgb"}, "1 2 3 3 255 0 0\n", "1"), 1,
      {1, 2, 3}, "list property rgb is not kept");

  kind = "PCD of robots";
  const auto pcd = [](const std::string& fields, const std::string& head, const std::string& data) {
    return "# .PCD v0.7\nVERSION 0.7\n" + fields + head + data;
  };
  const std::string plain = "FIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nCOUNT 1 1 1\n";
  add(kind, "another view point", "a.pcd",
      pcd(plain, "WIDTH 1\nHEIGHT 1\nVIEWPOINT 9 8 7 .7071 0 0 .7071\nPOINTS 1\nDATA ascii\n",
          "1 2 3\n"),
      1, {1, 2, 3}, "the view point is not kept");
  add(kind, "holes", "a.pcd",
      pcd(plain, "WIDTH 2\nHEIGHT 1\nPOINTS 2\nDATA ascii\n", "nan nan nan\n1 2 3\n"), 1, {1, 2, 3},
      "1 record with a non-finite value");
  add(kind, "padding", "a.pcd",
      pcd("FIELDS x y z _\nSIZE 4 4 4 1\nTYPE F F F U\nCOUNT 1 1 1 4\n",
          "WIDTH 1\nHEIGHT 1\nPOINTS 1\nDATA binary\n", bytesOf({1, 2, 3, 0})),
      1, {1, 2, 3});
}

void addMeshes(std::vector<BroughtFile>& files) {
  const auto add = [&](const char* kind, const char* variant, const std::string& content,
                       double area, const char* told = "") {
    files.push_back({kind, variant, "a.obj", content, area > 0 ? 50u : 0u, {}, told, area});
  };
  const std::string square = "v 0 0 0\nv 2 0 0\nv 2 2 0\nv 0 2 0\n";
  const char* kind = "a fourth number";
  add(kind, "weights", "v 0 0 0 1\nv 2 0 0 2\nv 2 2 0 .5\nf 1 2 3\n", 2,
      "2 vertices have a fourth number other than 1");
  add(kind, "ones", "v 0 0 0 1\nv 2 0 0 1\nv 2 2 0 1\nf 1 2 3\n", 2);

  kind = "faces";
  add(kind, "beyond the vertices", square + "f 1 2 9\n", 0, "vertex 9, expected 1 to 4");
  add(kind, "from behind", square + "f -4 -3 -2 -1\n", 4);
  add(kind, "two corners", square + "f 1 2\nf 1 2 3 4\n", 4, "Degenerated face");
  add(kind, "corners again", square + "f 1 2 2 3 4 4\n", 4);
  add(kind, "reals", square + "f 1.0 2.0 3.0\n", 2);

  const auto addPly = [&](const char* variant, const std::string& elements, double area,
                          const char* told) {
    files.push_back({"faces of PLY",
                     variant,
                     "a_mesh.ply",
                     "ply\nformat ascii 1.0\nelement vertex 4\nproperty float x\nproperty float "
                     "y\nproperty float z\n" +
                         elements,
                     area > 0 ? 50u : 0u,
                     {},
                     told,
                     area});
  };
  const std::string corners = "end_header\n0 0 0\n2 0 0\n2 2 0\n0 2 0\n";
  const std::string lists = "property list uchar int vertex_index\n";
  addPly("beyond the vertices", "element face 1\n" + lists + corners + "3 0 1 7\n", 0,
         "vertex 7, expected 0 to 3");
  addPly("below 0", "element face 1\n" + lists + corners + "3 0 1 -1\n", 0, "vertex -1");
  addPly("two corners", "element face 2\n" + lists + corners + "2 0 1\n4 0 1 2 3\n", 4,
         "1 faces without area");
  addPly("strips",
         "element tristrips 1\nproperty list int int vertex_indices\n" + corners + "4 0 1 2 3\n", 0,
         "triangle strips are not read");
  addPly("none", corners, 0, "clouds need no sampling");
  addPly("colors",
         "element face 1\n" + lists +
             "property uchar red\nproperty uchar green\nproperty uchar blue\n" + corners +
             "4 0 1 2 3 255 0 0\n",
         4, "colors of faces are not read");

  kind = "bytes of OBJ";
  add(kind, "a mark in front", "\xEF\xBB\xBF" + square + "f 1 2 3 4\n", 4);
  add(kind, "tabs", "v\t0\t0\t0\nv\t2\t0\t0\nv\t2\t2\t0\nf\t1\t2\t3\n", 2);
  add(kind, "not a number", square + "v nan 0 0\nf 1 2 5\n", 0, "found \"nan\"");
  add(kind, "too large", square + "v 1e400 0 0\nf 1 2 5\n", 0, "is not finite");
  add(kind, "commas behind numbers", "v 0, 0, 0\nv 2, 0, 0\nv 2, 2, 0\nf 1 2 3\n", 0,
      "replace commas by points");
}

TEST_F(MoreFiles, ComeOutRightOrAreRefusedWithTheWayOut) {
  Files files;
  addTables(files);
  addBinaries(files);
  addMeshes(files);
  struct Counts {
    int right = 0, refused = 0, wrong = 0;
  };
  std::map<std::string, Counts> table;
  for (const BroughtFile& file : files) {
    const std::string wrong = wrongOf(file);
    EXPECT_EQ(wrong, "") << file.kind << ", " << file.variant;
    Counts& counts = table[file.kind];
    ++(!wrong.empty() ? counts.wrong : file.count == 0 ? counts.refused : counts.right);
  }
  fmt::print("\n{:24} {:>6} {:>8} {:>6}\n", "kind", "right", "refused", "wrong");
  for (const auto& [kind, counts] : table) {
    fmt::print("{:24} {:6} {:8} {:6}\n", kind, counts.right, counts.refused, counts.wrong);
  }
}

}  // namespace
}  // namespace surfeit
