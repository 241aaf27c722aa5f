#include "cloud/ply/ply_writer.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <filesystem>
#include <random>
#include <string>
#include <utility>
#include <vector>

#include "cloud/ply/ply_reader.h"
#include "io/test_directory.h"

namespace surfeit {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;

using PlyWriterTest = DirectoryTest;

RowProperty scalar(const std::string& name, ValueType type) {
  RowProperty property;
  property.name = name;
  property.type = type;
  return property;
}

std::vector<RowProperty> oneOfEachType() {
  return {scalar("a", ValueType::kInt8),    scalar("b", ValueType::kUint8),
          scalar("c", ValueType::kInt16),   scalar("d", ValueType::kUint16),
          scalar("e", ValueType::kInt32),   scalar("f", ValueType::kUint32),
          scalar("g", ValueType::kFloat32), scalar("h", ValueType::kFloat64)};
}

TEST_F(PlyWriterTest, RandomRowsOfAllTypesRoundTripBitForBit) {
  constexpr std::size_t kRows = 20000;
  for (const PlyEncoding encoding :
       {PlyEncoding::kAscii, PlyEncoding::kBinaryLittleEndian, PlyEncoding::kBinaryBigEndian}) {
    Result<PlyWriter> writer = PlyWriter::create(path("a.ply"), encoding, oneOfEachType(), {"hi"});
    ASSERT_TRUE(writer.ok()) << writer.status().message();
    const RowLayout element = writer->element();
    ASSERT_EQ(element.row_bytes, 26u);

    // Random bits, but no NaN: ascii does not keep its payload
    std::mt19937 random(7);
    std::vector<std::byte> rows(kRows * element.row_bytes);
    for (std::byte& byte : rows) byte = static_cast<std::byte>(random());
    for (std::size_t row = 0; row < rows.size(); row += element.row_bytes) {
      const float g = std::ldexp(float(random()), int(random() % 250) - 160);
      const double h = std::ldexp(double(random()) / 3, int(random() % 2000) - 1050);
      std::memcpy(&rows[row + element.find("g")->offset], &g, sizeof g);
      std::memcpy(&rows[row + element.find("h")->offset], &h, sizeof h);
    }
    ASSERT_TRUE(writer->writeRows(std::span(rows).first(26 * 5)).ok());
    ASSERT_TRUE(writer->writeRows(std::span(rows).subspan(26 * 5)).ok());
    ASSERT_TRUE(writer->finish().ok());

    Result<PlyReader> reader = PlyReader::open(path("a.ply"));
    ASSERT_TRUE(reader.ok()) << reader.status().message();
    EXPECT_EQ(reader->header().encoding, encoding);
    EXPECT_THAT(reader->header().comments, ElementsAre("hi"));
    std::vector<std::byte> read(rows.size());
    const Result<std::size_t> count = reader->readRows(read);
    ASSERT_TRUE(count.ok()) << count.status().message();
    EXPECT_EQ(*count, kRows);
    EXPECT_TRUE(read == rows);
  }
}

TEST_F(PlyWriterTest, FileAppearsOnlyWhenFinished) {
  {
    Result<PlyWriter> writer =
        PlyWriter::create(path("a.ply"), PlyEncoding::kAscii, {scalar("x", ValueType::kUint8)});
    ASSERT_TRUE(writer.ok());
    ASSERT_TRUE(writer->writeRows(std::vector<std::byte>(3)).ok());
    EXPECT_FALSE(std::filesystem::exists(path("a.ply")));
  }
  EXPECT_EQ(fileCount(), 0);
}

TEST_F(PlyWriterTest, HeaderOfAnyCountHasTheSameSize) {
  std::size_t sizes[2];
  for (const std::size_t rows : {0u, 12345u}) {
    Result<PlyWriter> writer = PlyWriter::create(path("a.ply"), PlyEncoding::kBinaryLittleEndian,
                                                 {scalar("x", ValueType::kUint8)});
    ASSERT_TRUE(writer->writeRows(std::vector<std::byte>(rows)).ok());
    ASSERT_TRUE(writer->finish().ok());
    const std::string text = contents("a.ply");
    EXPECT_THAT(text, HasSubstr("element vertex " + std::to_string(rows) + "\ncomment "));
    sizes[rows == 0 ? 0 : 1] = text.size() - rows;
    EXPECT_TRUE(PlyReader::open(path("a.ply")).ok());
  }
  EXPECT_EQ(sizes[0], sizes[1]);
}

TEST_F(PlyWriterTest, CommentsCannotEndTheHeader) {
  Result<PlyWriter> writer =
      PlyWriter::create(path("a.ply"), PlyEncoding::kAscii, {scalar("x", ValueType::kUint8)},
                        {"one\nend_header\ntwo", "element vertex 0"});
  ASSERT_TRUE(writer.ok());
  ASSERT_TRUE(writer->writeRows(std::vector<std::byte>(3)).ok());
  ASSERT_TRUE(writer->finish().ok());
  const Result<PlyReader> reader = PlyReader::open(path("a.ply"));
  ASSERT_TRUE(reader.ok()) << reader.status().message();
  EXPECT_EQ(reader->header().elements[0].count, 3u);
  EXPECT_THAT(reader->header().comments, ElementsAre("one end_header two", "element vertex 0"));
}

TEST_F(PlyWriterTest, CallsThatCannotWorkAreInvalidArguments) {
  const auto code = [this](const std::string& name, std::vector<RowProperty> properties) {
    return PlyWriter::create(path(name), PlyEncoding::kAscii, std::move(properties))
        .status()
        .code();
  };
  const RowProperty x = scalar("x", ValueType::kFloat32);
  RowProperty list = scalar("l", ValueType::kFloat32);
  list.is_list = true;
  EXPECT_EQ(code("a.ply", {}), StatusCode::kInvalidArgument);
  EXPECT_EQ(code("a.ply", {x, x}), StatusCode::kInvalidArgument);
  EXPECT_EQ(code("a.ply", {x, list}), StatusCode::kInvalidArgument);
  EXPECT_EQ(code("a.ply", {scalar("two words", ValueType::kInt8)}), StatusCode::kInvalidArgument);
  EXPECT_EQ(code("a.ply", {scalar("", ValueType::kInt8)}), StatusCode::kInvalidArgument);
  EXPECT_EQ(code("no/such/a.ply", {x}), StatusCode::kIoError);

  Result<PlyWriter> writer = PlyWriter::create(path("a.ply"), PlyEncoding::kAscii, {x});
  EXPECT_EQ(writer->writeRows(std::vector<std::byte>(3)).code(), StatusCode::kInvalidArgument);
  ASSERT_TRUE(writer->finish().ok());
  EXPECT_EQ(writer->finish().code(), StatusCode::kInvalidArgument);
  EXPECT_EQ(writer->writeRows(std::vector<std::byte>(4)).code(), StatusCode::kInvalidArgument);
}

}  // namespace
}  // namespace surfeit
