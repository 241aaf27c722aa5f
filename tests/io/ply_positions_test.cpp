// Digits of ascii positions are kept, whatever type the header gives them.
#include <gtest/gtest.h>

#include <cstring>
#include <string>
#include <vector>

#include "cloud/ply/ply_number.h"
#include "cloud/ply/ply_reader.h"
#include "io/test_directory.h"

namespace surfeit {
namespace {

struct PositionCase {
  const char* name;
  int far_row;  // of 5,000, the one with `number`; -1: none
  const char* number;
  const char* faces;  // after the vertices
  ValueType type;
};

class PlyPositions : public DirectoryTest, public ::testing::WithParamInterface<PositionCase> {};

TEST_P(PlyPositions, AreDoublesWhereFloatsLoseDigits) {
  constexpr int kRows = 5000;
  std::string text =
      "ply\nformat ascii 1.0\nelement vertex 5000\nproperty float quality\n"
      "property float x\nproperty float y\nproperty float z\n";
  const PositionCase& given = GetParam();
  // -2: half of the rows, behind the first ones
  const auto isFar = [&](int i) {
    return i == given.far_row || (given.far_row == -2 && i > 1000 && i < 3500);
  };
  if (*given.faces != 0) text += "element face 1\nproperty list uchar int vertex_indices\n";
  text += "end_header\n";
  for (int i = 0; i < kRows; ++i) {
    // Qualities need doubles, but are what the header says
    text += "1234567.891 0.25 " + std::string(isFar(i) ? given.number : "12.125") + " -3.5e-2\n";
  }
  write("a.ply", text + given.faces);

  auto reader = PlyReader::open(path("a.ply"));
  ASSERT_TRUE(reader.ok()) << reader.status().message();
  const RowLayout& vertices = reader->header().elements[0];
  EXPECT_EQ(vertices.find("quality")->type, ValueType::kFloat32);
  for (const char* axis : {"x", "y", "z"}) EXPECT_EQ(vertices.find(axis)->type, given.type);
  ASSERT_TRUE(reader->seekElement(0).ok());
  std::vector<std::byte> rows(kRows * vertices.row_bytes);
  const auto count = reader->readRows(rows);
  ASSERT_TRUE(count.ok()) << count.status().message();
  ASSERT_EQ(*count, std::size_t(kRows));
  if (given.far_row >= 0) {
    const RowProperty& y = *vertices.find("y");
    const std::byte* const at = rows.data() + std::size_t(given.far_row) * vertices.row_bytes;
    EXPECT_EQ(rowValue(at + y.offset, y.type), std::stod(given.number));
  }
}

INSTANTIATE_TEST_SUITE_P(
    Files, PlyPositions,
    ::testing::Values(PositionCase{"NearZero", -1, "", "", ValueType::kFloat32},
                      PositionCase{"OnAMap", 0, "4000000.456", "", ValueType::kFloat64},
                      PositionCase{"OnAMapBeforeFaces", 0, "4000000.456", "3 0 1 2\n",
                                   ValueType::kFloat64},
                      PositionCase{"OnAMapInTheMiddle", -2, "4000000.456", "", ValueType::kFloat64},
                      PositionCase{"LargerThanFloats", 0, "1e39", "", ValueType::kFloat64}),
    [](const auto& each) { return each.param.name; });

TEST(PlyNumber, FloatsHoldWhatTheyGiveBack) {
  for (const char* text : {"0.1", "12.125", "-3.5e-2", "16777216", "500000.12", "0.123456791",
                           "3.4e38", "inf", "nan", "0"}) {
    EXPECT_TRUE(floatHolds(text)) << text;
  }
  for (const char* text : {"500000.123", "4000000.456", "16777217", "1e39", "-1e300",
                           "0.1234567890"
                           "1234"}) {
    EXPECT_FALSE(floatHolds(text)) << text;
  }
}

}  // namespace
}  // namespace surfeit
