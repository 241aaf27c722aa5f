// Bytes behind what a file says it holds are told, or refused, whatever the format.
#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <string>
#include <vector>

#include "cases/case_files.h"
#include "io/compressed_files.h"
#include "io/test_directory.h"
#include "surfeit/convert.h"
#include "surfels/open_surfel_source.h"

namespace surfeit {
namespace {

using testing::AllOf;
using testing::Contains;
using testing::HasSubstr;
using testing::Not;

class FileEnds : public DirectoryTest {
 protected:
  void SetUp() override {
    DirectoryTest::SetUp();
    std::string rows;
    for (int i = 0; i < 50; ++i) {
      rows += fmt::format("{} {} 0 0 0 1 .1 {} {}\n", i % 10, i / 10, i % 10, i / 10);
    }
    write("a.ply",
          "ply\nformat ascii 1.0\nelement vertex 50\nproperty float x\nproperty float "
          "y\nproperty float z\nproperty float nx\nproperty float ny\nproperty float "
          "nz\nproperty float radius\nproperty int pixel_x\nproperty int pixel_y\n"
          "end_header\n" +
              rows);
  }
  // The cloud in another format.
  std::string cloud(const std::string& name) {
    Progress quiet;
    const auto stats = convertClouds({path("a.ply")}, path(name), {}, quiet);
    EXPECT_TRUE(stats.ok()) << stats.status().message();
    return contents(name);
  }
  // All that is told, or why it is refused.
  std::vector<std::string> told(const std::string& name, const std::string& content) {
    write(name, content);
    const auto source = openSurfelSource(path(name), false);
    if (!source.ok()) return {source.status().message()};
    std::vector<std::string> notes = (*source)->notes();
    for (std::vector<Surfel> surfels(100);;) {
      const Result<std::size_t> count = (*source)->read(surfels);
      if (!count.ok()) return {count.status().message()};
      if (*count == 0) return notes;
    }
  }
};

TEST_F(FileEnds, PlainFilesTellHowMuchIsLeft) {
  for (const char* name : {"b.ptc", "b.vdb", "b.las", "b.bgeo", "b.pdb"}) {
    const std::string bytes = cloud(name);
    EXPECT_THAT(told(name, bytes), Not(Contains(HasSubstr(" behind the last")))) << name;
    for (const std::size_t more : {std::size_t{1}, std::size_t{100}, bytes.size()}) {
      EXPECT_THAT(told(name, bytes + std::string(more, '\7')),
                  Contains(AllOf(HasSubstr(fmt::format("{} bytes behind the last ", more)),
                                 HasSubstr("not read"))))
          << name;
    }
  }
}

TEST_F(FileEnds, StreamsThatEndEarlierThanTheirFileAreRefusedWithTheWayOut) {
  for (const char* name : {"b.prt", "b.ply"}) {
    const std::string bytes = cloud(name);
    EXPECT_THAT(told(name, bytes), Not(Contains(HasSubstr("expected the end of the file"))))
        << name;
    for (const std::size_t more : {std::size_t{1}, std::size_t{100}, bytes.size()}) {
      EXPECT_THAT(told(name, bytes + std::string(more, '\7')),
                  Contains(HasSubstr("expected the end of the file")))
          << name;
    }
  }
  const std::string prt = cloud("b.prt");
  EXPECT_THAT(told("b.prt", prt + "x"),
              Contains(HasSubstr(fmt::format("head -c {} FILE", prt.size()))));
}

TEST_F(FileEnds, CompressedFilesShowItAtTheirEnd) {
  for (const char* name : {"b.ptc", "b.las", "b.bgeo", "b.pdb", "b.prt", "b.ply"}) {
    const std::string bytes = cloud(name);
    EXPECT_THAT(told("c", gzipped(bytes)), Not(Contains(HasSubstr(" behind the ")))) << name;
    for (const std::string& packed :
         {gzipped(bytes + "more"), gzipped(bytes) + gzipped("more"), zstdPacked(bytes + "more")}) {
      EXPECT_THAT(told("c", packed),
                  Contains(testing::AnyOf(HasSubstr(" behind the "),
                                          HasSubstr("expected the end of the file"))))
          << name;
    }
  }
}

TEST_F(FileEnds, WhatFollowsGzipAndZstdIsCountedAndCutOff) {
  const std::string text = "1 2 3\n2 3 4\n";
  for (const std::string& packed :
       {gzipped(text), gzipped(text) + gzipped(text), zstdPacked(text)}) {
    for (const std::string& more :
         {std::string("x"), std::string("garbage"), std::string(512, '\0'), std::string("\x1f")}) {
      EXPECT_THAT(told("a.xyz", packed + more),
                  Contains(AllOf(HasSubstr(fmt::format("{} bytes behind the ", more.size())),
                                 HasSubstr(fmt::format("head -c {} FILE", packed.size())))));
    }
    EXPECT_THAT(told("a.xyz", packed), Not(Contains(HasSubstr(" behind "))));
  }
}

TEST_F(FileEnds, PicturesTellBytesBehindTheirPixels) {
  ConvertOptions options;
  Progress quiet;
  for (const char* shared : {"exr/alpha_edges.exr", "exr/half_far.exr"}) {
    std::ifstream file(sharedCase(shared), std::ios::binary);
    if (!file) GTEST_SKIP() << "shared cases are not here";
    const std::string bytes((std::istreambuf_iterator<char>(file)), {});
    EXPECT_THAT(told("a.exr", bytes), Not(Contains(HasSubstr(" behind "))));
    for (const std::size_t more : {std::size_t{1}, std::size_t{40}, std::size_t{5000}}) {
      EXPECT_THAT(told("a.exr", bytes + std::string(more, '\7')),
                  Contains(HasSubstr(fmt::format("{} bytes behind the last pixel", more))));
    }
  }
}

}  // namespace
}  // namespace surfeit
