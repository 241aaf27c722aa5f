#include "cloud/ply/ply_format.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <string>
#include <vector>

namespace surfeit {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;

// What follows the name of the encoding.
constexpr const char* kMeshHeader =
    " 1.0\ncomment two triangles\nelement vertex 3\nproperty float x\nproperty short y\n"
    "property double z\nelement face 2\nproperty uchar kind\n"
    "property list uchar int vertex_indices\nproperty list char float weights\nend_header\n";

TEST(PlyHeader, FormattedHeaderParsesToTheSame) {
  for (const char* format : {"ascii", "binary_little_endian", "binary_big_endian"}) {
    const std::string text = "ply\nformat " + std::string(format) + kMeshHeader;
    const Result<PlyHeader> header = parsePlyHeader(text + "data", "a.ply");
    ASSERT_TRUE(header.ok()) << header.status().message();
    EXPECT_EQ(formatPlyHeader(*header), text);
    EXPECT_EQ(header->data_offset, text.size());
  }
}

TEST(PlyHeader, ScalarsArePackedAndListsTakeNoBytes) {
  const Result<PlyHeader> header =
      parsePlyHeader(std::string("ply\nformat ascii") + kMeshHeader, "a.ply");
  ASSERT_TRUE(header.ok());
  const RowLayout& vertex = header->elements[*header->findElement("vertex")];
  EXPECT_EQ(vertex.row_bytes, 14u);
  EXPECT_EQ(vertex.find("y")->offset, 4u);
  EXPECT_EQ(vertex.find("z")->offset, 6u);
  EXPECT_EQ(vertex.find("w"), nullptr);
  EXPECT_FALSE(vertex.hasLists());
  const RowLayout& face = header->elements[*header->findElement("face")];
  EXPECT_EQ(face.row_bytes, 1u);
  EXPECT_TRUE(face.hasLists());
  EXPECT_FALSE(header->findElement("edge"));
}

TEST(PlyHeader, BothSpellingsOfTypesAndCrLfAreRead) {
  const Result<PlyHeader> header = parsePlyHeader(
      "ply\r\nformat ascii 1.0\r\nobj_info x\r\ncomment  two  words \r\nelement v 1\r\n"
      "property int8 a\r\nproperty char b\r\nproperty uint16 c\r\nproperty float64 d\r\n"
      "end_header\r\n1 2 3 4\r\n",
      "a.ply");
  ASSERT_TRUE(header.ok()) << header.status().message();
  EXPECT_THAT(header->comments, ElementsAre("obj_info x", "two  words"));
  const std::vector<RowProperty>& properties = header->elements[0].properties;
  ASSERT_EQ(properties.size(), 4u);
  EXPECT_EQ(properties[0].type, ValueType::kInt8);
  EXPECT_EQ(properties[1].type, ValueType::kInt8);
  EXPECT_EQ(properties[2].type, ValueType::kUint16);
  EXPECT_EQ(properties[3].type, ValueType::kFloat64);
}

TEST(PlyHeader, RefusalNamesTheLineFoundAndExpected) {
  const auto message = [](const std::string& text) {
    const Result<PlyHeader> header = parsePlyHeader(text, "a.ply");
    if (header.ok()) return std::string("accepted");
    EXPECT_EQ(header.status().code(), StatusCode::kCorruption);
    return header.status().message();
  };
  const std::string start = "ply\nformat ascii 1.0\nelement v 1\n";
  EXPECT_EQ(message("plx\n"), "a.ply: header line 1: found 'plx', expected 'ply'");
  EXPECT_THAT(message(""), HasSubstr("header line 1: found no line end in the first 0 bytes"));
  EXPECT_THAT(message("ply\nend_header\n"), HasSubstr("header line 2: found 'end_header'"));
  EXPECT_THAT(message("ply\nformat ascii 2.0\nend_header\n"), HasSubstr("'format ascii 2.0'"));
  EXPECT_THAT(message("ply\nformat binary 1.0\nend_header\n"), HasSubstr("'format binary 1.0'"));
  EXPECT_THAT(message("ply\nformat ascii 1.0\nformat ascii 1.0\n"), HasSubstr("header line 3"));
  EXPECT_THAT(message("ply\nproperty float x\n"), HasSubstr("expected an 'element' line first"));
  EXPECT_THAT(message(start + "property real x\n"),
              HasSubstr("found 'property real x', expected a"));
  EXPECT_THAT(message(start + "property float\n"), HasSubstr("expected one property name"));
  EXPECT_THAT(message(start + "property float x y\n"), HasSubstr("expected one property name"));
  EXPECT_THAT(message(start + "property list float int x\n"), HasSubstr("length of the list"));
  EXPECT_THAT(message(start + "property float x\nproperty int x\n"), HasSubstr("header line 5"));
  EXPECT_THAT(message(start + "element v 2\n"), HasSubstr("header line 4"));
  EXPECT_THAT(message(start + "end_header\n"), HasSubstr("'property' line for element 'v'"));
  EXPECT_THAT(message(start + "property float x\n"), HasSubstr("found no line end"));
  EXPECT_THAT(message("ply\nwhat\n"), HasSubstr("found 'what'"));
  for (const char* count : {"-1", "1.5", "x", "", "18446744073709551616", "1 2"}) {
    EXPECT_THAT(message("ply\nelement v " + std::string(count) + "\n"),
                HasSubstr("a count below 2^64"));
  }
}

TEST(PlyHeader, SixtyThousandPropertiesTakeNoTime) {
  std::string text = "ply\nformat ascii 1.0\nelement v 0\n";
  for (int i = 0; i < 45000; ++i) text += "property int p" + std::to_string(i) + "\n";
  EXPECT_TRUE(parsePlyHeader(text + "end_header\n", "a.ply").ok());
}

}  // namespace
}  // namespace surfeit
