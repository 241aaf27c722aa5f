#include "surfels/rows/surfel_writer.h"

#include <gtest/gtest.h>

#include <cstring>
#include <filesystem>
#include <span>
#include <vector>

#include "core/long_side.h"
#include "io/surfel_cloud_test.h"

namespace surfeit {
namespace {

using SurfelWriterTest = SurfelCloudTest;

TEST_F(SurfelWriterTest, SurfelsRoundTripInEveryEncoding) {
  std::vector<Surfel> surfels = randomSurfels(20001);
  for (std::size_t i = 0; i < surfels.size(); ++i) {
    surfels[i].group = static_cast<std::uint8_t>(i % kMaxGroups);
    const float step = float(i % 100);
    if (i % 3 == 0) setLongSide(glm::vec3(.1f, -.002f, .01f) * step, surfels[i]);
  }
  for (const PlyEncoding encoding :
       {PlyEncoding::kAscii, PlyEncoding::kBinaryLittleEndian, PlyEncoding::kBinaryBigEndian}) {
    Result<SurfelWriter> writer =
        SurfelWriter::create(path("a.ply"), {true, true, true, true, true, true, true, true},
                             {.comments = {"a comment"}, .ply_encoding = encoding});
    ASSERT_TRUE(writer.ok());
    ASSERT_TRUE(writer->write(std::span(surfels).first(1)).ok());
    ASSERT_TRUE(writer->write({}).ok());
    ASSERT_TRUE(writer->write(std::span(surfels).subspan(1)).ok());
    ASSERT_TRUE(writer->finish().ok());
    for (const std::size_t batch : {777u, 100000u}) {
      const auto source = open(path("a.ply"), true);
      const std::vector<Surfel> read = readAll(*source, batch);
      ASSERT_EQ(read.size(), surfels.size());
      EXPECT_EQ(std::memcmp(read.data(), surfels.data(), surfels.size() * sizeof(Surfel)), 0);
    }
  }
}

TEST_F(SurfelWriterTest, FileHasOnlyTheChannelsAskedFor) {
  const std::vector<Surfel> surfels = randomSurfels(3);
  CloudChannels channels;
  channels.area = true;
  Result<SurfelWriter> writer = SurfelWriter::create(path("a.ply"), channels);
  ASSERT_TRUE(writer.ok());
  ASSERT_TRUE(writer->write(surfels).ok());
  ASSERT_TRUE(writer->finish().ok());
  const auto source = open(path("a.ply"));
  EXPECT_TRUE(source->channels().area);
  EXPECT_FALSE(source->channels().normal || source->channels().radius ||
               source->channels().radiosity || source->channels().albedo ||
               source->channels().two_sided || source->channels().group ||
               source->channels().long_side);
  EXPECT_EQ(readAll(*source)[2].area, surfels[2].area);
}

TEST_F(SurfelWriterTest, FileAppearsOnlyWhenFinished) {
  {
    Result<SurfelWriter> writer = SurfelWriter::create(path("a.ply"), {});
    ASSERT_TRUE(writer.ok());
    ASSERT_TRUE(writer->write(randomSurfels(5)).ok());
    EXPECT_FALSE(std::filesystem::exists(path("a.ply")));
  }
  EXPECT_EQ(fileCount(), 0);
}

}  // namespace
}  // namespace surfeit
