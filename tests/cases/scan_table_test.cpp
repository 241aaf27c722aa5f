// The table of further files (input_table_test.cpp has the first): laser scans, passes, compressed
// points and splats, uneven samplings and outputs, in variants of every kind that was once read
// wrongly or lost without a word. `cases_test --gtest_filter=ScanTable.*` prints it.
#include <fmt/format.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <cmath>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <map>
#include <string>
#include <vector>

#include "cases/case_files.h"
#include "cloud/cloud_formats.h"
#include "io/exr_test_picture.h"
#include "io/las_test_file.h"
#include "io/test_directory.h"
#include "surfeit/bake.h"
#include "surfeit/bounce.h"
#include "surfeit/convert.h"
#include "surfeit/index.h"
#include "surfels/open_surfel_source.h"

namespace surfeit {
namespace {

double linearOf(double code, double white) {
  const double s = code / white;
  return s <= 0.04045 ? s / 12.92 : std::pow((s + 0.055) / 1.055, 2.4);
}

template <typename... Values>
std::string packed(Values... values) {
  std::string bytes;
  (bytes.append(reinterpret_cast<const char*>(&values), sizeof values), ...);
  return bytes;
}

// A LAS file whose points have these colors, by turns.
std::string coloredLas(unsigned minor, unsigned format, const std::vector<std::uint16_t>& reds,
                       std::uint32_t count) {
  std::string las = makeLas(minor, format, count);
  for (std::uint32_t i = 0; i < count; ++i) {
    const std::size_t at =
        getLas<std::uint32_t>(las, 96) + i * getLas<std::uint16_t>(las, 105) + kLasColorAt[format];
    for (std::size_t c = 0; c < 3; ++c) {
      putLas(las, at + 2 * c, reds[i * reds.size() / count]);
    }
  }
  return las;
}

// Sets a byte of point `index`.
std::string withByte(std::string las, std::size_t index, std::size_t offset, int value) {
  las[getLas<std::uint32_t>(las, 96) + index * getLas<std::uint16_t>(las, 105) + offset] =
      char(value);
  return las;
}

// Points without sizes on a square of edge 1, so many along each axis; every point `times` times,
// or only every second one.
std::string grid(int columns, int lines, int times, bool is_half = false) {
  std::string text = "x,y,z,nx,ny,nz\n";
  for (int i = 0; i < columns * lines; ++i) {
    const double x = (i % columns + .5) / columns, y = (i / columns + .5) / lines;
    for (int k = 0; k < (is_half && i % 2 == 0 ? 1 : times); ++k) {
      text += fmt::format("{:.6f},{:.6f},0,0,0,1\n", x, y);
    }
  }
  return text;
}

// SuperSplat's: one chunk from 0 0 0 to 2 4 8.
std::string packedSplats(bool has_colors, std::uint32_t opacity) {
  std::string text = "ply\nformat binary_little_endian 1.0\nelement chunk 1\n";
  std::vector<std::string> names;
  for (const char* what : {"", "scale_"}) {
    for (const char* end : {"min_", "max_"}) {
      for (const char* axis : {"x", "y", "z"}) names.push_back(std::string(end) + what + axis);
    }
  }
  for (const char* name : {"min_r", "min_g", "min_b", "max_r", "max_g", "max_b"}) {
    if (has_colors) names.emplace_back(name);
  }
  for (const std::string& name : names) text += "property float " + name + "\n";
  text += "element vertex 2\n";
  for (const char* name : {"packed_position", "packed_rotation", "packed_scale", "packed_color"}) {
    text += "property uint " + std::string(name) + "\n";
  }
  text += "end_header\n" + packed(0.f, 0.f, 0.f, 2.f, 4.f, 8.f) +
          packed(-1.f, -2.f, -9.f, -1.f, -2.f, -7.f);
  if (has_colors) text += packed(0.f, 0.f, 0.f, 1.f, 1.f, 1.f);
  for (int i = 0; i < 2; ++i) {
    text += packed(std::uint32_t{2047u << 21 | 2047u},
                   std::uint32_t{1u << 30 | 512u << 20 | 512u << 10 | 512u}, std::uint32_t{0},
                   std::uint32_t{255u << 24 | opacity});
  }
  return text;
}

// PCL's: field by field, literals of LZF.
std::string lzfPcd(const std::string& fields, const std::string& types, const std::string& values) {
  std::string lzf;
  for (std::size_t at = 0; at < values.size(); at += 32) {
    const std::string piece = values.substr(at, 32);
    lzf += char(piece.size() - 1);
    lzf += piece;
  }
  std::string sizes, counts;
  for (std::size_t i = 0; i < types.size(); i += 2) {
    sizes += i == 0 ? "4" : " 4";
    counts += i == 0 ? "1" : " 1";
  }
  return fmt::format(
             "VERSION .7\nFIELDS {}\nSIZE {}\nTYPE {}\nCOUNT {}\nWIDTH 2\nHEIGHT 1\nVIEWPOINT 0 0 "
             "0 1 0 0 0\nPOINTS 2\nDATA binary_compressed\n",
             fields, sizes, types, counts) +
         packed(std::uint32_t(lzf.size()), std::uint32_t(values.size())) + lzf;
}

// Positions times alpha at the first column, which is covered to a quarter.
ExrTestPart edgePasses(bool has_normals) {
  ExrTestPart part;
  part.window = Imath::Box2i({0, 0}, {3, 1});
  const auto scale = [](int x) { return x == 0 ? .25f : 1.f; };
  part.add("A", [=](int x, int) { return scale(x); });
  part.add("P.X", [=](int x, int) { return float(10 + x) * scale(x); });
  part.add("P.Y", [=](int x, int y) { return float(20 + y) * scale(x); });
  part.add("P.Z", [=](int x, int) { return float(30 + x) * scale(x); });
  for (const char* name : {"N.X", "N.Y", "N.Z"}) {
    if (has_normals) part.add(name, [=](int x, int) { return name[2] == 'Z' ? scale(x) : 0.f; });
  }
  return part;
}

// Positions of 16 bits, so far from 0.
ExrTestPart halfPasses(float distance) {
  ExrTestPart part;
  part.window = Imath::Box2i({0, 0}, {7, 7});
  part.add(
      "P.X", [=](int x, int) { return distance + float(x) / 8; }, Imf::HALF);
  part.add(
      "P.Y", [=](int, int y) { return float(y) / 8; }, Imf::HALF);
  part.add(
      "P.Z", [](int, int) { return 1.f; }, Imf::HALF);
  return part;
}

struct TableRow {
  int variants = 0, right = 0, refused = 0, wrong = 0;
};

class ScanTable : public DirectoryTest {
 protected:
  // What a file comes to.
  struct Found {
    std::string error;
    std::vector<Surfel> surfels;
    std::string notes;
  };
  Found read(const std::string& name) const {
    Result<std::unique_ptr<SurfelSource>> source = openSurfelSource(path(name), false);
    if (!source.ok()) return {source.status().message(), {}, {}};
    Found found;
    for (const std::string& note : (*source)->notes()) found.notes += note + "\n";
    found.surfels.resize(1000);
    const Result<std::size_t> count = (*source)->read(found.surfels);
    if (!count.ok()) return {count.status().message(), {}, {}};
    found.surfels.resize(*count);
    return found;
  }
  Found readText(const std::string& name, const std::string& content) const {
    write(name, content);
    return read(name);
  }
  Found readPasses(const ExrTestPart& part) const {
    writeExrTest(path("a.exr"), {part});
    return read("a.exr");
  }

  // Whether it has so many surfels, with a first red and a text in its notes.
  static std::string isRight(const Found& found, std::size_t count, double red,
                             const std::string& told) {
    if (!found.error.empty()) return found.error;
    if (found.surfels.size() != count) return fmt::format("{} surfels", found.surfels.size());
    const double first = double(found.surfels.front().radiosity.x);
    if (red >= 0 && std::abs(first - red) > 1e-4) return fmt::format("red {}", first);
    return found.notes.find(told) != std::string::npos ? "right" : "not told: " + told;
  }
  static std::string isRefused(const Status& status, const std::string& text) {
    if (status.ok()) return "not refused";
    return status.message().find(text) != std::string::npos ? "refused" : status.message();
  }
  static std::string isRefused(const Found& found, const std::string& text) {
    if (found.error.empty()) return fmt::format("not refused, {} surfels", found.surfels.size());
    return found.error.find(text) != std::string::npos ? "refused" : found.error;
  }

  // The area of all surfels of a scene.
  std::string hasArea(const std::string& cloud, double expected, double tolerance) const {
    write("a.csv", cloud);
    Progress quiet;
    const auto stats = indexClouds({path("a.csv")}, path("a.sft"), {}, quiet);
    if (!stats.ok()) return stats.status().message();
    const auto as_cloud = convertClouds({path("a.sft")}, path("areas.ply"), {}, quiet);
    if (!as_cloud.ok()) return as_cloud.status().message();
    double sum = 0;
    for (const double area : columnOf(path("areas.ply"), "area")) sum += area;
    return std::abs(sum - expected) <= tolerance ? "right" : fmt::format("area {}", sum);
  }

  void check(const std::string& kind, const std::string& variant, const std::string& found) {
    TableRow& row = table_[kind];
    ++row.variants;
    ++(found == "right" ? row.right : found == "refused" ? row.refused : row.wrong);
    EXPECT_TRUE(found == "right" || found == "refused") << kind << ", " << variant << ": " << found;
  }

  void addLas() {
    const double brown = linearOf(117, 255), deep = linearOf(3, 65535);
    for (const unsigned format : {2u, 7u}) {
      const unsigned minor = format <= 5 ? 2 : 4;
      const std::string name = fmt::format("format {}", format);
      check("LAS 8 bits in 16", name,
            isRight(readText("a.las", coloredLas(minor, format, {117}, 7)), 7, brown, "8 bits"));
      check(
          "LAS dark first", name,
          isRight(readText("a.las", coloredLas(minor, format, {3, 3, 3, 40000}, 7)), 7, deep, ""));
      check("LAS 12 bits in 16", name,
            isRight(readText("a.las", coloredLas(minor, format, {4095}, 7)), 7, 1, "12 bits"));
      // Points 0 to 5 have their numbers as classes
      const std::string six = makeLas(minor, format, 6);
      const std::size_t at = format <= 5 ? 15 : 16;
      check("LAS withheld", name,
            isRight(readText("a.las", format <= 5 ? withByte(six, 2, 15, 0x80 | 2)
                                                  : withByte(six, 2, 15, 4)),
                    5, -1, "withheld"));
      for (const int noise : {7, 18}) {
        check("LAS noise", fmt::format("{}, class {}", name, noise),
              isRight(readText("a.las", withByte(six, 2, at, noise)), 5, -1, "noise"));
      }
    }
    std::string fewer = makeLas(2, 0, 6), more = fewer;
    putLas(fewer, 107, std::uint32_t(4));
    putLas(more, 107, std::uint32_t(9));
    check("LAS wrong counts", "fewer in 1.2",
          isRight(readText("a.las", fewer), 6, -1, "the header counts 4 points, the file has 6"));
    check("LAS wrong counts", "more in 1.2", isRefused(readText("a.las", more), "9"));
    fewer = more = makeLas(4, 6, 6);
    putLas(fewer, 247, std::uint64_t(4));
    putLas(more, 247, std::uint64_t(9));
    check("LAS wrong counts", "fewer in 1.4",
          isRight(readText("a.las", fewer), 6, -1, "the header counts 4 points, the file has 6"));
    check("LAS wrong counts", "more in 1.4", isRefused(readText("a.las", more), "9"));
  }

  void addPictures() {
    for (const bool has_normals : {false, true}) {
      const Found found = readPasses(edgePasses(has_normals));
      std::string outcome = isRight(found, 8, -1, "divided by it");
      if (outcome == "right" && std::abs(found.surfels.front().position.x - 10) > 1e-4f) {
        outcome = fmt::format("x {}", found.surfels.front().position.x);
      }
      check("EXR alpha", has_normals ? "times alpha, normals" : "times alpha", outcome);
    }
    ExrTestPart holes = floorPasses();
    holes.add("A", [](int x, int) { return x < 2 ? 0.f : 1.f; });
    check("EXR alpha", "nothing there", isRight(readPasses(holes), 16, -1, ""));
    check("EXR half", "coarse beside its pixels",
          isRight(readPasses(halfPasses(1000)), 64, -1, "positions are stored in 16 bits"));
    const Found fine = readPasses(halfPasses(0));
    check("EXR half", "fine", isRight(fine, 64, -1, ""));
  }

  void addCompressed() {
    const std::string places = packed(1.f, 4.f, 2.f, 5.f, 3.f, 6.f);
    const std::string colors = packed(std::uint32_t{117 << 16 | 73 << 8 | 49}, std::uint32_t{255});
    const double brown = linearOf(117, 255);
    check("PCD LZF", "places",
          isRight(readText("a.pcd", lzfPcd("x y z", "F F F", places)), 2, -1, ""));
    check(
        "PCD LZF", "rgb as integers",
        isRight(readText("a.pcd", lzfPcd("x y z rgb", "F F F U", places + colors)), 2, brown, ""));
    check(
        "PCD LZF", "rgb as floats",
        isRight(readText("a.pcd", lzfPcd("x y z rgb", "F F F F", places + colors)), 2, brown, ""));
    const std::string whole = lzfPcd("x y z", "F F F", places);
    check("PCD LZF", "cut",
          isRefused(readText("a.pcd", whole.substr(0, whole.size() - 5)), "a.pcd"));
    for (const bool has_colors : {false, true}) {
      for (const std::uint32_t opacity : {51u, 255u}) {
        const Found found = readText("a.ply", packedSplats(has_colors, opacity));
        std::string outcome = isRight(found, 2, 1, "their opacity becomes");
        if (outcome == "right" &&
            std::abs(-double(found.surfels[0].area) - opacity / 255.) > 1e-3) {
          outcome = fmt::format("coverage {}", -found.surfels[0].area);
        }
        check("packed splats", fmt::format("colors {}, opacity {}", has_colors, opacity), outcome);
      }
    }
  }

  void addSamplings() {
    const double tolerance = .08;  // at the rim
    check("sampling", "once", hasArea(grid(40, 40, 1), 1, tolerance));
    for (const int columns : {40, 60}) {
      check("every point twice", fmt::format("{} columns", columns),
            hasArea(grid(columns, 40, 2), 1, tolerance));
      check("half twice", fmt::format("{} columns", columns),
            hasArea(grid(columns, 40, 2, true), 1, tolerance));
    }
    check("scan lines", "3 to 1", hasArea(grid(90, 30, 1), 1, tolerance));
    check("scan lines", "8 to 1", hasArea(grid(160, 20, 1), 1, tolerance));
  }

  void addOutputs() {
    Progress quiet;
    write("a.csv", grid(20, 20, 1));
    const std::string before = contents("a.csv");
    ASSERT_TRUE(indexClouds({path("a.csv")}, path("a.sft"), {}, quiet).ok());
    const auto gather = [&](const std::string& output) {
      return gatherCloud(path("a.sft"), path("a.csv"), path(output), {}, quiet).status();
    };
    std::filesystem::create_directory(path("directory.ply"));
    std::filesystem::create_symlink(path("target.ply"), path("link.ply"));
    std::filesystem::create_symlink(path("circle.ply"), path("circle.ply"));
    check("input as output", "scene", isRefused(gather("a.sft"), "a.sft"));
    check(
        "input as output", "scene of a bounce",
        isRefused(bounceScene(path("a.sft"), path("a.sft"), {}, quiet).status(), "would replace"));
    const Status in_place = convertClouds({path("a.csv")}, path("a.csv"), {}, quiet).status();
    check(
        "input as output", "convert works in place",
        in_place.ok() && columnOf(path("a.csv"), "x").size() == 400 ? "right" : in_place.message());
    check("output is a link", "to a new file",
          gather("link.ply").ok() && std::filesystem::is_symlink(path("link.ply")) &&
                  std::filesystem::is_regular_file(path("target.ply"))
              ? "right"
              : "the link is gone");
    check("output is a link", "to itself", isRefused(gather("circle.ply"), "circle.ply"));
    check("output is a directory", "gather", isRefused(gather("directory.ply"), "directory"));
    check("output is a directory", "index",
          isRefused(indexClouds({path("a.csv")}, path("directory.ply"), {}, quiet).status(),
                    "directory"));
    check("no place for it", "no directory", isRefused(gather("none/out.ply"), "make it first"));
    // Who may write everywhere is not refused
    std::filesystem::create_directory(path("closed"));
    std::filesystem::permissions(path("closed"), std::filesystem::perms(0555));
    if (::geteuid() != 0) {
      check("no place for it", "read-only", isRefused(gather("closed/out.ply"), "cannot write"));
    }
    std::filesystem::permissions(path("closed"), std::filesystem::perms(0755));
  }

  std::map<std::string, TableRow> table_;
};

TEST_F(ScanTable, EveryFileIsReadRightOrRefusedWithTheWayOut) {
  addLas();
  addPictures();
  addCompressed();
  addSamplings();
  addOutputs();
  fmt::print("{:22} {:>8} {:>8} {:>8} {:>8}\n", "kind", "variants", "right", "refused", "wrong");
  for (const auto& [kind, row] : table_) {
    fmt::print("{:22} {:8} {:8} {:8} {:8}\n", kind, row.variants, row.right, row.refused,
               row.wrong);
  }
}

}  // namespace
}  // namespace surfeit
