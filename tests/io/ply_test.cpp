#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <bit>
#include <chrono>
#include <cmath>
#include <cstring>
#include <filesystem>
#include <limits>
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

constexpr PlyEncoding kEncodings[] = {PlyEncoding::kAscii, PlyEncoding::kBinaryLittleEndian,
                                      PlyEncoding::kBinaryBigEndian};

// Appends a value as a binary file has it.
template <typename T>
void put(std::string& out, T value, bool big_endian = false) {
  std::byte bytes[sizeof value];
  std::memcpy(bytes, &value, sizeof value);
  if (big_endian == (std::endian::native == std::endian::little)) {
    std::reverse(bytes, bytes + sizeof value);
  }
  out.append(reinterpret_cast<const char*>(bytes), sizeof value);
}

// Two triangles between a comment and an element of scalars, in any encoding.
std::string smallMesh(PlyEncoding encoding) {
  const bool is_big = encoding == PlyEncoding::kBinaryBigEndian;
  const char* name = is_big ? "binary_big_endian" : "binary_little_endian";
  std::string text = "ply\nformat ";
  text += encoding == PlyEncoding::kAscii ? "ascii" : name;
  text +=
      " 1.0\ncomment two triangles\nelement vertex 3\nproperty float x\nproperty short y\n"
      "property double z\nelement face 2\nproperty uchar kind\n"
      "property list uchar int vertex_indices\nproperty list char float weights\n"
      "element end 1\nproperty uint stamp\nend_header\n";
  if (encoding == PlyEncoding::kAscii) {
    return text +
           "0.5 -1 1e10\n1.5 -2 2e10\n2.5 -3 3e10\n7 3 0 1 2 0\n8 3 2 1 0 1 .25\n4000000000\n";
  }
  for (int i = 0; i < 3; ++i) {
    put(text, 0.5f + float(i), is_big);
    put(text, std::int16_t(-1 - i), is_big);
    put(text, 1e10 * (i + 1), is_big);
  }
  for (int face = 0; face < 2; ++face) {
    put(text, std::uint8_t(7 + face));
    put(text, std::uint8_t{3});
    for (int i = 0; i < 3; ++i) put(text, std::int32_t(face == 0 ? i : 2 - i), is_big);
    put(text, std::int8_t(face));
    if (face == 1) put(text, 0.25f, is_big);
  }
  put(text, 4000000000u, is_big);
  return text;
}

class PlyReaderTest : public DirectoryTest {
 protected:
  Result<PlyReader> open(const std::string& text) {
    write("a.ply", text);
    return PlyReader::open(path("a.ply"));
  }

  // All rows of all elements, each value as a double; the failure if there is one.
  Result<std::vector<std::vector<double>>> readAll(const std::string& text) {
    SURFEIT_ASSIGN_OR_RETURN(PlyReader reader, open(text));
    std::vector<std::vector<double>> rows;
    for (std::size_t i = 0; i < reader.header().elements.size(); ++i) {
      const RowLayout& element = reader.header().elements[i];
      SURFEIT_RETURN_IF_ERROR(reader.seekElement(i));
      if (element.row_bytes == 0) continue;
      std::vector<std::byte> row(element.row_bytes);
      for (;;) {
        SURFEIT_ASSIGN_OR_RETURN(const std::size_t count, reader.readRows(row));
        if (count == 0) break;
        std::vector<double>& values = rows.emplace_back();
        for (const RowProperty& property : element.properties) {
          if (!property.is_list) values.push_back(rowValue(&row[property.offset], property.type));
        }
      }
    }
    return rows;
  }

  // The message with which a file is refused as corrupt.
  std::string corruption(const std::string& text) {
    const Result<std::vector<std::vector<double>>> rows = readAll(text);
    if (rows.ok()) return "accepted";
    EXPECT_EQ(rows.status().code(), StatusCode::kCorruption) << rows.status().message();
    EXPECT_THAT(rows.status().message(), HasSubstr("a.ply: "));
    return rows.status().message();
  }

  // Two float properties, two rows.
  std::string asciiPoints(const std::string& rows) {
    return "ply\nformat ascii 1.0\nelement vertex 2\nproperty float x\nproperty int "
           "n\nend_header\n" +
           rows;
  }
};

TEST_F(PlyReaderTest, HeaderWithoutEndIsRefused) {
  EXPECT_THAT(corruption("ply\nformat ascii 1.0\n" + std::string(3 << 20, '\n')),
              HasSubstr("found no line end in the first 1048576 bytes"));
}

TEST_F(PlyReaderTest, LongHeaderIsRead) {
  std::string text = "ply\nformat ascii 1.0\n";
  for (int i = 0; i < 10000; ++i) text += "comment a comment\n";
  const auto rows = readAll(text + "element vertex 1\nproperty float x\nend_header\n5\n");
  ASSERT_TRUE(rows.ok()) << rows.status().message();
  EXPECT_THAT(*rows, ElementsAre(ElementsAre(5)));
}

TEST_F(PlyReaderTest, AllEncodingsHoldTheSameMesh) {
  for (const PlyEncoding encoding : kEncodings) {
    const auto rows = readAll(smallMesh(encoding));
    ASSERT_TRUE(rows.ok()) << rows.status().message();
    EXPECT_THAT(*rows, ElementsAre(ElementsAre(0.5, -1, 1e10), ElementsAre(1.5, -2, 2e10),
                                   ElementsAre(2.5, -3, 3e10), ElementsAre(7), ElementsAre(8),
                                   ElementsAre(4e9)));
  }
}

TEST_F(PlyReaderTest, ListsAreReadWithTheirScalars) {
  for (const PlyEncoding encoding : kEncodings) {
    Result<PlyReader> reader = open(smallMesh(encoding));
    ASSERT_TRUE(reader.ok());
    ASSERT_TRUE(reader->seekElement(1).ok());
    std::byte kind{};
    std::vector<double> list;
    ASSERT_TRUE(*reader->readRowWithList({&kind, 1}, 1, list));
    EXPECT_THAT(list, ElementsAre(0, 1, 2));
    EXPECT_EQ(std::to_integer<int>(kind), 7);
    ASSERT_TRUE(*reader->readRowWithList({&kind, 1}, 2, list));
    EXPECT_THAT(list, ElementsAre(0.25));
    EXPECT_EQ(std::to_integer<int>(kind), 8);
    EXPECT_FALSE(*reader->readRowWithList({&kind, 1}, 1, list));
  }
}

TEST_F(PlyReaderTest, SeekGoesForwardsAndBack) {
  for (const PlyEncoding encoding : kEncodings) {
    Result<PlyReader> reader = open(smallMesh(encoding));
    ASSERT_TRUE(reader.ok());
    std::vector<std::byte> row(14);
    for (const std::size_t element : {0u, 2u, 1u, 0u, 0u, 1u, 2u}) {
      ASSERT_TRUE(reader->seekElement(element).ok());
      ASSERT_EQ(
          *reader->readRows(std::span(row).first(reader->header().elements[element].row_bytes)),
          1u);
      const RowProperty& first = reader->header().elements[element].properties[0];
      EXPECT_EQ(rowValue(row.data(), first.type), element == 0 ? 0.5 : element == 1 ? 7 : 4e9);
    }
    EXPECT_EQ(reader->seekElement(3).code(), StatusCode::kInvalidArgument);
  }
}

TEST_F(PlyReaderTest, BatchesOfAnySizeGiveTheSameRows) {
  constexpr std::uint32_t kCount = 200000;  // several buffers
  for (const bool is_big : {false, true}) {
    std::string text =
        is_big ? "ply\nformat binary_big_endian 1.0\n" : "ply\nformat binary_little_endian 1.0\n";
    text += "element vertex 200000\nproperty uint n\nproperty uchar b\nend_header\n";
    for (std::uint32_t i = 0; i < kCount; ++i) {
      put(text, i, is_big);
      put(text, static_cast<std::uint8_t>(i));
    }
    Result<PlyReader> reader = open(text);
    ASSERT_TRUE(reader.ok()) << reader.status().message();
    for (const std::size_t batch : {7u, 1000u, 52429u, 1000000u}) {
      ASSERT_TRUE(reader->seekElement(0).ok());
      std::vector<std::byte> rows(batch * 5 + 3);
      std::uint32_t next = 0;
      for (;;) {
        const Result<std::size_t> count = reader->readRows(rows);
        ASSERT_TRUE(count.ok());
        if (*count == 0) break;
        for (std::size_t i = 0; i < *count; ++i, ++next) {
          ASSERT_EQ(rowValue(&rows[5 * i], ValueType::kUint32), next);
          ASSERT_EQ(std::to_integer<std::uint8_t>(rows[5 * i + 4]), next & 255);
        }
      }
      EXPECT_EQ(next, kCount);
    }
  }
}

TEST_F(PlyReaderTest, AsciiNumbersComeInManySpellings) {
  const auto rows = readAll(
      "ply\nformat ascii 1.0\nelement v 7\nproperty float v\nproperty double y\nproperty char n\n"
      "end_header\n+1.5 1E2 +7\n\n  .5\t-0\t-128 \r\nnan -inf 127\nNaN INF 0\n1e999 -1e999 0\n"
      "1e-60 1e-400 0\n3.5e38 16777217 0");
  ASSERT_TRUE(rows.ok()) << rows.status().message();
  const double inf = std::numeric_limits<double>::infinity();
  EXPECT_THAT((*rows)[0], ElementsAre(1.5, 100, 7));
  EXPECT_THAT((*rows)[1], ElementsAre(0.5, 0, -128));
  EXPECT_TRUE(std::isnan((*rows)[2][0]));
  EXPECT_EQ((*rows)[2][1], -inf);
  EXPECT_TRUE(std::isnan((*rows)[3][0]));
  EXPECT_THAT((*rows)[4], ElementsAre(inf, -inf, 0));
  EXPECT_THAT((*rows)[5], ElementsAre(0, 0, 0));
  EXPECT_THAT((*rows)[6], ElementsAre(inf, 16777217, 0));
}

TEST_F(PlyReaderTest, AsciiNumberAcrossBufferBordersIsRead) {
  // Blanks push the numbers over every alignment to the buffer of 256 KiB
  for (std::size_t blanks = (256 << 10) - 400; blanks < (256 << 10) + 20; blanks += 7) {
    const auto rows = readAll(asciiPoints(std::string(blanks, ' ') + "12345.5 123456\n1 2\n"));
    ASSERT_TRUE(rows.ok()) << rows.status().message();
    ASSERT_THAT(*rows, ElementsAre(ElementsAre(12345.5, 123456), ElementsAre(1, 2)));
  }
}

TEST_F(PlyReaderTest, DamagedAsciiIsRefusedWithTheRow) {
  EXPECT_THAT(corruption(asciiPoints("10 20\n30\n")),
              HasSubstr("element vertex row 1: line ends early, expected n of type int"));
  EXPECT_THAT(corruption(asciiPoints("1 2\n3     ")),
              HasSubstr("element vertex row 1: file ends early"));
  EXPECT_THAT(corruption(asciiPoints("1 2\n\n\n\n\n")),
              HasSubstr("element vertex row 1: file ends early"));
  EXPECT_THAT(corruption(asciiPoints("1 2 3\n4 5\n")),
              HasSubstr("element vertex row 0: found '3', expected the end of the line"));
  EXPECT_THAT(corruption(asciiPoints("1 2\n3 4\n5 6\n")), HasSubstr("after the last element"));
  EXPECT_THAT(corruption(asciiPoints("1 2\n3 x4\n")),
              HasSubstr("row 1: found 'x4', expected n of type int"));
  for (const char* bad : {"1.5", "2147483648", "0x10", "1,", "+-1", "--1", "+", "-", "1e2"}) {
    EXPECT_THAT(corruption(asciiPoints("1 " + std::string(bad) + "\n3 4\n")), HasSubstr("row 0"));
  }
  for (const char* bad : {"1.5x", "1,5", "+-1", "e5", "0x1p3", "1..2"}) {
    EXPECT_THAT(corruption(asciiPoints(std::string(bad) + " 1\n3 4\n")), HasSubstr("row 0"));
  }
  EXPECT_THAT(corruption(asciiPoints(std::string(300, '1') + " 1\n3 4\n")), HasSubstr("row 0"));
  EXPECT_THAT(corruption(asciiPoints(std::string(1 << 20, '1') + " 1\n3 4\n")), HasSubstr("row 0"));
}

TEST_F(PlyReaderTest, IntegersBeyondTheirTypeAreRefused) {
  const std::pair<const char*, const char*> cases[] = {
      {"uchar", "256"}, {"uchar", "-1"},     {"char", "128"},       {"short", "40000"},
      {"ushort", "-1"}, {"ushort", "65536"}, {"uint", "4294967296"}};
  for (const auto& [type, value] : cases) {
    EXPECT_THAT(corruption("ply\nformat ascii 1.0\nelement v 1\nproperty " + std::string(type) +
                           " a\nend_header\n" + value + "\n"),
                HasSubstr("found '" + std::string(value) + "', expected a of type " + type));
  }
}

TEST_F(PlyReaderTest, BinaryOfWrongSizeIsRefusedByOpen) {
  std::string text =
      "ply\nformat binary_little_endian 1.0\nelement vertex 3\nproperty double x\nend_header\n";
  for (int i = 0; i < 3; ++i) put(text, double(i));
  EXPECT_TRUE(open(text).ok());
  EXPECT_TRUE(open(text + "\n").ok());
  EXPECT_TRUE(open(text + "\r\n").ok());
  EXPECT_THAT(open(text + "  \n").status().message(),
              HasSubstr("3 bytes at 106 after the last element"));
  EXPECT_THAT(open(text + "x").status().message(), HasSubstr("after the last element"));
  text.pop_back();
  EXPECT_THAT(open(text).status().message(),
              HasSubstr("element vertex row 2: file ends early: 23 bytes hold at most 2 rows of 8 "
                        "bytes, expected 3"));
}

TEST_F(PlyReaderTest, BadListLengthsAreRefused) {
  const std::string ascii =
      "ply\nformat ascii 1.0\nelement f 1\nproperty uchar a\nproperty list int int l\nend_header\n";
  EXPECT_THAT(corruption(ascii + "1 -1\n"), HasSubstr("list l has length -1, expected 0 to"));
  EXPECT_THAT(corruption(ascii + "1 2 5\n"), HasSubstr("row 0: line ends early"));
  EXPECT_THAT(corruption(ascii + "1 2000000000 5\n"), HasSubstr("row 0: line ends early"));

  std::string binary =
      "ply\nformat binary_little_endian 1.0\nelement f 1\nproperty uchar a\n"
      "property list int double l\nend_header\n1";
  std::string negative = binary, huge = binary;
  put(negative, std::int32_t{-5});
  put(huge, std::int32_t{0x7fffffff});
  EXPECT_THAT(corruption(negative), HasSubstr("list l has length -5"));
  EXPECT_THAT(corruption(huge), HasSubstr("row 0: file ends early"));
}

TEST_F(PlyReaderTest, WantedListLongerThanAMillionIsRefused) {
  std::string text =
      "ply\nformat binary_little_endian 1.0\nelement f 1\nproperty uchar a\n"
      "property list int uchar l\nend_header\n1";
  constexpr std::int32_t kLength = (1 << 20) + 1;
  put(text, kLength);
  text.append(kLength, 'x');
  EXPECT_TRUE(readAll(text).ok());  // dropped lists may have any length
  Result<PlyReader> reader = open(text);
  std::byte scalar;
  std::vector<double> list;
  EXPECT_EQ(reader->readRowWithList({&scalar, 1}, 1, list).status().code(),
            StatusCode::kCorruption);
}

TEST_F(PlyReaderTest, HugeCountsAreRefusedAtOnce) {
  const auto begin = std::chrono::steady_clock::now();
  for (const char* format : {"ascii", "binary_little_endian", "binary_big_endian"}) {
    for (const char* count :
         {"4294967296", "9223372036854775807", "9223372036854775808", "18446744073709551615"}) {
      for (const char* property : {"float x", "list uchar int l"}) {
        EXPECT_THAT(corruption("ply\nformat " + std::string(format) + " 1.0\nelement vertex " +
                               count + "\nproperty " + property + "\nend_header\n1 2 3 4 5 6\n"),
                    HasSubstr("file ends early"));
      }
      EXPECT_THAT(corruption("ply\nformat " + std::string(format) + " 1.0\nelement vertex " +
                             count + "\nend_header\n1\n"),
                  HasSubstr("'property' line"));
    }
  }
  EXPECT_LT(std::chrono::steady_clock::now() - begin, std::chrono::seconds(5));
}

TEST_F(PlyReaderTest, CallsThatCannotWorkAreInvalidArguments) {
  Result<PlyReader> reader = open(smallMesh(PlyEncoding::kAscii));
  ASSERT_TRUE(reader.ok());
  std::vector<std::byte> row(14);
  std::vector<double> list;
  const auto code = [](const auto& result) { return result.status().code(); };
  EXPECT_EQ(code(reader->readRows(std::span(row).first(13))), StatusCode::kInvalidArgument);
  EXPECT_EQ(code(reader->readRowWithList(row, 0, list)), StatusCode::kInvalidArgument);
  EXPECT_EQ(code(reader->readRowWithList(row, 9, list)), StatusCode::kInvalidArgument);
  EXPECT_EQ(*reader->readRows(row), 1u);  // and nothing was lost

  AlignedBuffer buffer;
  EXPECT_EQ(reader->readRowView(0, buffer).status().code(), StatusCode::kInvalidArgument);

  Result<PlyReader> empty = open("ply\nformat ascii 1.0\nend_header\n");
  EXPECT_EQ(empty->readRowView(1, buffer).status().code(), StatusCode::kInvalidArgument);
  EXPECT_EQ(empty->seekRow(0).code(), StatusCode::kInvalidArgument);
  EXPECT_FALSE(empty->hasFixedRows());
  ASSERT_TRUE(empty.ok());
  EXPECT_EQ(code(empty->readRows(row)), StatusCode::kInvalidArgument);
  EXPECT_EQ(empty->seekElement(0).code(), StatusCode::kInvalidArgument);
}

TEST_F(PlyReaderTest, ViewsHoldTheRowsThatAreReadOtherwise) {
  for (const PlyEncoding encoding : kEncodings) {
    Result<PlyReader> reader = open(smallMesh(encoding));
    ASSERT_TRUE(reader.ok()) << reader.status().message();
    AlignedBuffer buffer;
    for (std::size_t element = 0; element < 3; ++element) {
      ASSERT_TRUE(reader->seekElement(element).ok());
      std::vector<std::byte> rows(100);
      const std::size_t count = *reader->readRows(rows);
      const std::size_t row_bytes = reader->header().elements[element].row_bytes;
      for (const std::size_t max_rows : {1u, 2u, 100u}) {
        ASSERT_TRUE(reader->seekElement(element).ok());
        std::vector<std::byte> views;
        for (;;) {
          const Result<Bytes> view = reader->readRowView(max_rows, buffer);
          ASSERT_TRUE(view.ok()) << view.status().message();
          if (view->empty()) break;
          views.insert(views.end(), view->begin(), view->end());
        }
        ASSERT_EQ(views.size(), count * row_bytes);
        EXPECT_TRUE(std::equal(views.begin(), views.end(), rows.begin()));
      }
      EXPECT_EQ(reader->hasFixedRows(), encoding != PlyEncoding::kAscii && element != 1);
    }
  }
}

TEST_F(PlyReaderTest, SeekRowGoesToFixedRowsOnly) {
  Result<PlyReader> reader = open(smallMesh(PlyEncoding::kBinaryBigEndian));
  ASSERT_TRUE(reader.ok());
  AlignedBuffer buffer;
  ASSERT_TRUE(reader->seekRow(2).ok());
  Result<Bytes> view = reader->readRowView(5, buffer);
  ASSERT_TRUE(view.ok());
  ASSERT_EQ(view->size(), reader->header().elements[0].row_bytes);
  EXPECT_EQ(rowValue(view->data(), ValueType::kFloat32), 2.5);
  EXPECT_EQ(reader->seekRow(4).code(), StatusCode::kInvalidArgument);
  ASSERT_TRUE(reader->seekElement(1).ok());
  EXPECT_EQ(reader->seekRow(0).code(), StatusCode::kInvalidArgument);

  // The elements behind are found all the same
  ASSERT_TRUE(reader->seekElement(0).ok());
  ASSERT_TRUE(reader->seekRow(1).ok());
  ASSERT_TRUE(reader->seekElement(2).ok());
  view = reader->readRowView(5, buffer);
  ASSERT_TRUE(view.ok());
  EXPECT_EQ(rowValue(view->data(), ValueType::kUint32), 4000000000.0);
}

TEST_F(PlyReaderTest, FailureLastsUntilTheNextSeek) {
  Result<PlyReader> reader = open(asciiPoints("1 2\n3 x\n"));
  std::vector<std::byte> row(8);
  EXPECT_EQ(*reader->readRows(row), 1u);
  EXPECT_FALSE(reader->readRows(row).ok());
  EXPECT_FALSE(reader->readRows(row).ok());
  ASSERT_TRUE(reader->seekElement(0).ok());
  EXPECT_EQ(*reader->readRows(row), 1u);
}

TEST_F(PlyReaderTest, BytesAfterTheLastElementAreNoticedInEveryPass) {
  Result<PlyReader> reader = open(asciiPoints("1 2\n3 4\n5"));
  std::vector<std::byte> rows(16);
  for (int pass = 0; pass < 2; ++pass) {
    ASSERT_TRUE(reader->seekElement(0).ok());
    EXPECT_THAT(reader->readRows(rows).status().message(), HasSubstr("1 bytes at"));
  }
}

TEST_F(PlyReaderTest, MissingFileIsAnIoError) {
  EXPECT_EQ(PlyReader::open(path("missing.ply")).status().code(), StatusCode::kIoError);
}

TEST_F(PlyReaderTest, EveryTruncationIsRefused) {
  for (const PlyEncoding encoding : kEncodings) {
    const std::string text = smallMesh(encoding);
    // An ascii file without its last bytes may still be whole: a line end, digits of a number
    const std::size_t kept = encoding == PlyEncoding::kAscii ? 11 : 0;
    for (std::size_t size = 0; size + kept < text.size(); ++size) {
      ASSERT_NE(corruption(text.substr(0, size)), "accepted") << size;
    }
  }
}

TEST_F(PlyReaderTest, EveryFlippedByteIsReadOrRefused) {
  for (const PlyEncoding encoding : kEncodings) {
    const std::string text = smallMesh(encoding);
    for (std::size_t i = 0; i < text.size(); ++i) {
      for (const unsigned flip : {0xffu, 0x01u}) {
        std::string damaged = text;
        damaged[i] = static_cast<char>(static_cast<unsigned char>(damaged[i]) ^ flip);
        corruption(damaged);
      }
    }
  }
}

TEST_F(PlyReaderTest, RandomBytesAfterAHeaderAreReadOrRefused) {
  std::mt19937 random(1);
  for (const PlyEncoding encoding : kEncodings) {
    const std::string text = smallMesh(encoding);
    const std::size_t data = text.find("end_header\n") + 11;
    for (int run = 0; run < 100; ++run) {
      std::string damaged = text;
      for (std::size_t i = data; i < damaged.size(); ++i) damaged[i] = static_cast<char>(random());
      corruption(damaged);
    }
  }
}

TEST_F(PlyReaderTest, RealMeshesHaveFacesThatIndexTheirVertices) {
  const std::filesystem::path directory = std::filesystem::path(SURFEIT_SHARED_DATA_DIR) / "meshes";
  if (!std::filesystem::exists(directory)) GTEST_SKIP() << "no " << directory;
  for (const char* name : {"bunny.ply", "dragon_res2.ply"}) {
    Result<PlyReader> reader = PlyReader::open((directory / name).string());
    ASSERT_TRUE(reader.ok()) << reader.status().message();
    const PlyHeader& header = reader->header();
    const std::size_t faces = *header.findElement("face");
    const double vertex_count = double(header.elements[*header.findElement("vertex")].count);
    ASSERT_TRUE(reader->seekElement(faces).ok());
    std::vector<double> list;
    std::uint64_t face_count = 0;
    for (;; ++face_count) {
      const Result<bool> has_row = reader->readRowWithList({}, 0, list);
      ASSERT_TRUE(has_row.ok()) << has_row.status().message();
      if (!*has_row) break;
      ASSERT_EQ(list.size(), 3u);
      for (const double index : list) ASSERT_TRUE(index >= 0 && index < vertex_count);
    }
    EXPECT_EQ(face_count, header.elements[faces].count);
  }
}

}  // namespace
}  // namespace surfeit
