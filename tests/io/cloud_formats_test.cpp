#include "cloud/cloud_formats.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cctype>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "io/compressed_files.h"
#include "io/test_directory.h"
#include "storage/byte_output.h"

namespace surfeit {
namespace {

using testing::Contains;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;

class CloudFormatsTest : public DirectoryTest {
 protected:
  std::string refusal(const std::string& contents) {
    write("a", contents);
    const auto reader = openRowReader(path("a"));
    EXPECT_FALSE(reader.ok());
    EXPECT_EQ(reader.status().code(), StatusCode::kCorruption);
    return reader.status().message();
  }
};

TEST_F(CloudFormatsTest, UnknownFilesAreToldWhatIsRead) {
  const std::string message = refusal("\x01\x02 no cloud");
  EXPECT_THAT(message, HasSubstr("found '?? n' at 0, expected a cloud (PLY"));
  for (const CloudFormat& format : cloudFormats()) {
    if (format.open == nullptr) continue;
    EXPECT_THAT(message, HasSubstr(std::string(format.name)));
  }
  EXPECT_THAT(refusal(gzipped("\x01 no cloud")), HasSubstr("expected a cloud (PLY"));
  EXPECT_THAT(refusal(""), HasSubstr("the file is empty"));
}

TEST_F(CloudFormatsTest, FormatsThatAreNotReadAreToldWhatToDo) {
  EXPECT_THAT(refusal("\x89SFT\r\n\x1a\n...."), HasSubstr("found a Surfeit scene (.sft)"));
  EXPECT_THAT(refusal("ASTM-E57...."), HasSubstr("found E57, which is not read as a cloud: conv"));
  EXPECT_THAT(refusal("PXR-USDC...."), HasSubstr("found USD"));
  EXPECT_THAT(refusal(zstdPacked("NGSP....")), HasSubstr("found SPZ"));
  EXPECT_THAT(refusal("\xFF\xD8\xFF...."), HasSubstr("found a JPEG picture"));
  EXPECT_THAT(refusal("solid a\nfacet normal 0 0 1\n"), HasSubstr("found STL"));
  EXPECT_THAT(refusal("OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n"), HasSubstr("found OFF"));
  EXPECT_THAT(refusal("ncols 2\nnrows 2\nxllcorner 0\n1 2\n"), HasSubstr("gdal_translate"));
  EXPECT_THAT(refusal("version https://git-lfs.github.com/spec/v1\noid sha256:a\nsize 1\n"),
              HasSubstr("git lfs pull"));
  EXPECT_THAT(refusal("<!DOCTYPE html>\n<html>"), HasSubstr("a web page"));
  EXPECT_THAT(refusal("{\"points\": [1, 2, 3]}"), HasSubstr("found JSON"));
  write("a.csv", "% of a program\n1!2!3\n");
  EXPECT_THAT(openRowReader(path("a.csv")).status().message(),
              HasSubstr("line 2: found '1!2!3', expected three numbers or names"));
  write("a.splat", std::string(96, '\x01'));
  EXPECT_THAT(openRowReader(path("a.splat")).status().message(),
              HasSubstr("PLY of Gaussian splats"));
  EXPECT_THAT(refusal("surfeit-recipe 1\nkind city\n"), HasSubstr("`surfeit index`"));
  EXPECT_THAT(refusal(gzipped("\x76\x2f\x31\x01....")), HasSubstr("OpenEXR compressed as a whole"));
  EXPECT_THAT(refusal("# no cloud\no cube\nv 0 0 0\n"), HasSubstr("`surfeit sample`"));
}

TEST_F(CloudFormatsTest, DamagedCompressionIsToldBeforeTheFormat) {
  EXPECT_THAT(refusal("\x1f\x8b damaged"), HasSubstr("damaged gzip data"));
}

// A row of points along x, a tenth of a unit apart, as doubles.
std::vector<std::string> notesOfPoints(const std::string& path, double x) {
  RowWriterOptions options;
  for (const char* name : {"x", "y", "z"}) {
    options.properties.emplace_back();
    options.properties.back().name = name;
    options.properties.back().type = ValueType::kFloat64;
  }
  const auto writer = createRowWriter(path, options);
  EXPECT_TRUE(writer.ok()) << writer.status().message();
  std::vector<double> rows;
  for (int i = 0; i < 100; ++i) rows.insert(rows.end(), {x + i * .1, 0, 0});
  EXPECT_TRUE((*writer)->writeRows(std::as_bytes(std::span(rows))).ok());
  EXPECT_TRUE((*writer)->finish().ok());
  return (*writer)->notes();
}

TEST_F(CloudFormatsTest, PositionsThatFloatsMoveAreToldByHowMuch) {
  for (const char* name : {"a.ptc", "a.bgeo", "a.pdb"}) {
    EXPECT_THAT(notesOfPoints(path(name), 5e5),
                Contains(HasSubstr("they move by up to 0.013, beside a spacing of about 0.99")))
        << name;
    EXPECT_THAT(notesOfPoints(path(name), 5), Not(Contains(HasSubstr("move by")))) << name;
  }
  for (const char* name : {"a.ply", "a.txt", "a.las", "a.prt", "a.vdb"}) {
    EXPECT_THAT(notesOfPoints(path(name), 5e5), Not(Contains(HasSubstr("move by")))) << name;
  }
}

TEST_F(CloudFormatsTest, ChannelsAreNotAllDropped) {
  RowWriterOptions options;
  for (const char* name : {"x", "y", "z"}) {
    options.properties.emplace_back();
    options.properties.back().name = name;
  }
  const std::vector<std::byte> row(3 * sizeof(float));
  for (const char* name : {"a.ply", "a.bgeo", "a.pdb", "a.prt", "a.vdb", "a.csv"}) {
    const auto writer = createRowWriter(path(name), options);
    ASSERT_TRUE(writer.ok()) << writer.status().message();
    ASSERT_TRUE((*writer)->writeRows(row).ok());
    ASSERT_TRUE((*writer)->finish().ok());
    RowReaderOptions reading;
    reading.channels = *parseChannelRenames("position=-,P=-,Position=-");
    const auto reader = openRowReader(path(name), reading);
    ASSERT_FALSE(reader.ok()) << name;
    EXPECT_THAT(reader.status().message(), HasSubstr("channel")) << name;
  }
}

TEST_F(CloudFormatsTest, NamesThatTellNoFormatAreRefused) {
  RowWriterOptions options;
  options.properties.resize(1);
  options.properties[0].name = "x";
  for (const char* name : {"a", "a.jpg", ".ply", "a.gz", "a.ply.bz2", "aply"}) {
    const auto writer = createRowWriter(name, options);
    ASSERT_FALSE(writer.ok()) << name;
    EXPECT_EQ(writer.status().code(), StatusCode::kInvalidArgument);
    EXPECT_THAT(writer.status().message(), HasSubstr("ends with one of .ply"));
  }
}

TEST_F(CloudFormatsTest, ExtensionsMayHaveAnyCase) {
  for (const std::string name : {"a.ply", "a.csv", "a.las", "a.ptc", "a.ply.gz", "a.xyz.zst"}) {
    std::string upper = name;
    for (char& c : upper) c = static_cast<char>(std::toupper(static_cast<unsigned char>(c)));
    RowWriterOptions options;
    for (const char* property : {"x", "y", "z"}) {
      options.properties.emplace_back();
      options.properties.back().name = property;
    }
    for (const std::string& file : {name, upper}) {
      const auto writer = createRowWriter(path(file), options);
      ASSERT_TRUE(writer.ok()) << writer.status().message();
      ASSERT_TRUE((*writer)->finish().ok());
    }
    EXPECT_EQ(contents(name), contents(upper)) << name;
  }
}

TEST_F(CloudFormatsTest, NoExtensionIsThatOfTwoFormats) {
  std::set<std::string> seen;
  for (const CloudFormat& format : cloudFormats()) {
    EXPECT_TRUE(format.open != nullptr || format.create != nullptr);
    EXPECT_EQ(format.create == nullptr, format.extensions.empty()) << format.name;
    std::string extension;
    for (const char c : std::string(format.extensions) + " ") {
      if (c != ' ') {
        extension += c;
      } else if (!extension.empty()) {
        EXPECT_EQ(extension[0], '.');
        EXPECT_TRUE(seen.insert(extension).second) << extension;
        extension.clear();
      }
    }
  }
}

// What of PLY is about rows; ply_test.cpp has the rest.
class PlyRowsTest : public DirectoryTest {
 protected:
  // An ascii file of two elements.
  static std::string text() {
    std::string text =
        "ply\nformat ascii 1.0\ncomment hello\nelement vertex 500\nproperty float x\nproperty "
        "float "
        "y\nproperty list uchar int neighbours\nproperty double z\nproperty uchar red\nproperty "
        "uchar green\nproperty uchar blue\nproperty ushort extra\nelement face 1\nproperty int "
        "a\nend_header\n";
    for (int i = 0; i < 500; ++i) {
      const std::string number = std::to_string(i);
      text += number + " 1 2 7 8 -" + number + ".5 1 2 3 " + number + "\n";
    }
    return text + "7\n";
  }

  // Rows as they are, by whatever number at once.
  static Result<std::string> readAll(RowReader& reader, std::size_t max_rows) {
    SURFEIT_RETURN_IF_ERROR(reader.rewind());
    std::string rows;
    AlignedBuffer buffer;
    for (;;) {
      SURFEIT_ASSIGN_OR_RETURN(const Bytes bytes, reader.readRows(max_rows, buffer));
      if (bytes.empty()) return rows;
      rows.append(reinterpret_cast<const char*>(bytes.data()), bytes.size());
    }
  }

  std::unique_ptr<RowReader> open(const std::string& name, const std::string& renames = "",
                                  const std::string& part = "") {
    RowReaderOptions options;
    options.channels = *parseChannelRenames(renames);
    options.part = part;
    Result<std::unique_ptr<RowReader>> reader = openRowReader(path(name), options);
    EXPECT_TRUE(reader.ok()) << reader.status().message();
    return reader.ok() ? std::move(*reader) : nullptr;
  }
  std::string refusal(const std::string& renames, const std::string& part = "") {
    RowReaderOptions options;
    options.channels = *parseChannelRenames(renames);
    options.part = part;
    return openRowReader(path("a.ply"), options).status().message();
  }

  static std::vector<std::string> propertyNamesOf(const RowLayout& element) {
    std::vector<std::string> names;
    for (const RowProperty& property : element.properties) names.push_back(property.name);
    return names;
  }

  // Copies rows through a writer.
  Status copy(const std::string& from, const std::string& to) {
    SURFEIT_ASSIGN_OR_RETURN(const std::unique_ptr<RowReader> reader, openRowReader(path(from)));
    RowWriterOptions options;
    options.properties = reader->element().properties;
    options.comments = reader->comments();
    SURFEIT_ASSIGN_OR_RETURN(const std::unique_ptr<RowWriter> writer,
                             createRowWriter(path(to), options));
    AlignedBuffer buffer;
    for (;;) {
      SURFEIT_ASSIGN_OR_RETURN(const Bytes rows, reader->readRows(77, buffer));
      if (rows.empty()) return writer->finish();
      SURFEIT_RETURN_IF_ERROR(writer->writeRows(rows));
    }
  }
};

TEST_F(PlyRowsTest, RowsAreTheScalarsOfTheSurfels) {
  write("a.ply", text());
  const auto reader = open("a.ply");
  EXPECT_EQ(reader->formatName(), "PLY");
  EXPECT_EQ(reader->element().count, 500u);
  EXPECT_THAT(propertyNamesOf(reader->element()),
              ElementsAre("x", "y", "z", "red", "green", "blue", "extra"));
  EXPECT_EQ(reader->element().row_bytes, 4u + 4 + 8 + 3 + 2);
  EXPECT_THAT(reader->comments(), ElementsAre("hello"));
  EXPECT_THAT(reader->notes(),
              ElementsAre("list property neighbours is not kept", "element face is not kept"));
  EXPECT_FALSE(reader->isSeekable());
  EXPECT_EQ(reader->seekRow(0).code(), StatusCode::kInvalidArgument);
}

TEST_F(PlyRowsTest, CompressedFilesHaveTheSameRows) {
  write("a.ply", text());
  write("ascii.ply.gz", gzipped(text()));
  write("ascii.ply.zst", zstdPacked(text()));
  ASSERT_TRUE(copy("a.ply", "b.ply").ok());
  ASSERT_TRUE(copy("a.ply", "b.ply.gz").ok());
  ASSERT_TRUE(copy("b.ply.gz", "c.ply.zst").ok());
  const Result<std::string> expected = readAll(*open("a.ply"), 500);
  ASSERT_TRUE(expected.ok());
  ASSERT_EQ(expected->size(), 500u * 21);
  for (const char* name :
       {"a.ply", "ascii.ply.gz", "ascii.ply.zst", "b.ply", "b.ply.gz", "c.ply.zst"}) {
    const auto reader = open(name);
    for (const std::size_t max_rows : {1u, 7u, 499u, 500u, 100'000u}) {
      const Result<std::string> rows = readAll(*reader, max_rows);
      ASSERT_TRUE(rows.ok()) << rows.status().message();
      EXPECT_TRUE(*rows == *expected) << name << " " << max_rows;
    }
    EXPECT_EQ(reader->isSeekable(), std::string(name) == "b.ply");
  }
  // The same file, but for its compression
  EXPECT_EQ(gunzipped(path("b.ply.gz")), contents("b.ply"));
  EXPECT_EQ(zstdUnpacked(contents("c.ply.zst"), 100'000), contents("b.ply"));
}

TEST_F(PlyRowsTest, SeekableRowsAreReadFromAnyPlace) {
  write("a.ply", text());
  ASSERT_TRUE(copy("a.ply", "b.ply").ok());
  const auto reader = open("b.ply");
  const std::string all = *readAll(*reader, 500);
  AlignedBuffer buffer;
  for (const std::uint64_t row : {499u, 3u, 500u, 0u}) {
    ASSERT_TRUE(reader->seekRow(row).ok());
    const Result<Bytes> rows = reader->readRows(2, buffer);
    ASSERT_TRUE(rows.ok());
    EXPECT_EQ(std::string(reinterpret_cast<const char*>(rows->data()), rows->size()),
              all.substr(row * 21, 2 * 21));
  }
}

TEST_F(PlyRowsTest, ChannelsAndPropertiesAreRenamed) {
  write("a.ply", text());
  const auto namesOf = [&](const std::string& renames) {
    return propertyNamesOf(open("a.ply", renames)->element());
  };
  EXPECT_THAT(namesOf("color=radiosity,extra=radius"),
              ElementsAre("x", "y", "z", "radiosity_r", "radiosity_g", "radiosity_b", "radius"));
  EXPECT_THAT(namesOf("red=id,position=-"), ElementsAre("id", "green", "blue", "extra"));
  // Bytes of what is dropped stay where they are
  const auto reader = open("a.ply", "color=-,y=-");
  EXPECT_THAT(propertyNamesOf(reader->element()), ElementsAre("x", "z", "extra"));
  EXPECT_EQ(reader->element().row_bytes, 21u);
  EXPECT_EQ(reader->element().find("extra")->offset, 19u);
  EXPECT_EQ(*readAll(*reader, 10), *readAll(*open("a.ply"), 10));

  EXPECT_THAT(refusal("extra=x"), HasSubstr("element vertex: property extra would be a second x"));
}

TEST_F(PlyRowsTest, AnyElementCanBeAskedFor) {
  write("a.ply", text());
  EXPECT_EQ(open("a.ply", "", "face")->element().count, 1u);
  EXPECT_THAT(refusal("", "faces"),
              HasSubstr("found no element 'faces', expected one of vertex face"));
}

TEST_F(PlyRowsTest, EveryTruncationOfACompressedFileIsFound) {
  write("a.ply", text());
  ASSERT_TRUE(copy("a.ply", "b.ply").ok());
  // That of the file before it was compressed, and that of the compressed one
  const std::string plain = contents("b.ply"), whole = gzipped(plain);
  for (std::size_t size = 5; size < plain.size(); size += size < 400 ? 3 : 97) {
    for (const std::string& packed : {gzipped(plain.substr(0, size)), whole.substr(0, size),
                                      zstdPacked(plain.substr(0, size))}) {
      if (packed == whole) continue;
      write("c.ply.gz", packed);
      Result<std::unique_ptr<RowReader>> reader = openRowReader(path("c.ply.gz"));
      const Status status = reader.ok() ? readAll(**reader, 100).status() : reader.status();
      ASSERT_EQ(status.code(), StatusCode::kCorruption) << size << ": " << status.message();
    }
  }
}

TEST_F(PlyRowsTest, CountsOfCompressedFilesAreDoubted) {
  const auto outcome = [&](const std::string& count, const std::string& rows) {
    write("a.ply.gz", gzipped("ply\nformat binary_little_endian 1.0\nelement vertex " + count +
                              "\nproperty float x\nproperty float y\nproperty float "
                              "z\nend_header\n" +
                              rows));
    Result<std::unique_ptr<RowReader>> reader = openRowReader(path("a.ply.gz"));
    return reader.ok() ? readAll(**reader, 1000).status() : reader.status();
  };
  const std::string rows(10 * 12, '\0');
  EXPECT_TRUE(outcome("10", rows).ok());
  EXPECT_TRUE(outcome("10", rows + "\r\n").ok());
  EXPECT_THAT(outcome("11", rows).message(), HasSubstr("file ends early: 120 bytes at"));
  EXPECT_THAT(outcome("9", rows).message(), HasSubstr("after the last element"));
  EXPECT_THAT(outcome("1000000000000", rows).message(), HasSubstr("file ends early"));
  EXPECT_THAT(outcome("18446744073709551615", rows).message(), HasSubstr("file ends early"));
}

TEST_F(PlyRowsTest, ListsOfCompressedFilesAreReadToTheirEnd) {
  const std::string header =
      "ply\nformat binary_little_endian 1.0\nelement vertex 2\nproperty float x\nproperty float "
      "y\nproperty float z\nproperty list uchar uchar l\nend_header\n";
  const std::string row = std::string(12, '\0') + '\x05' + "12345";
  const auto outcome = [&](const std::string& rows) {
    write("a.ply.gz", gzipped(header + rows));
    Result<std::unique_ptr<RowReader>> reader = openRowReader(path("a.ply.gz"));
    return reader.ok() ? readAll(**reader, 1000).status() : reader.status();
  };
  EXPECT_TRUE(outcome(row + row).ok());
  EXPECT_EQ(outcome(row + row.substr(0, row.size() - 1)).code(), StatusCode::kCorruption);
  EXPECT_EQ(outcome(row + row + "one more").code(), StatusCode::kCorruption);
}

TEST_F(PlyRowsTest, WriterThatIsNotFinishedLeavesNothing) {
  RowWriterOptions options;
  options.properties.resize(1);
  options.properties[0].name = "x";
  for (const char* name : {"a.ply", "a.ply.gz", "a.ply.zst"}) {
    Result<std::unique_ptr<RowWriter>> writer = createRowWriter(path(name), options);
    ASSERT_TRUE(writer.ok());
    EXPECT_TRUE((*writer)->writeRows(std::vector<std::byte>(40)).ok());
    EXPECT_THAT((*writer)->notes(), IsEmpty());
  }
  EXPECT_EQ(fileCount(), 0);
}

}  // namespace
}  // namespace surfeit
