// The raw records of a SurfelSource: fetched by one thread, decoded by any.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <chrono>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <memory>
#include <random>
#include <string>
#include <thread>
#include <vector>

#include "io/surfel_cloud_test.h"
#include "io/test_bytes.h"
#include "surfels/open_surfel_source.h"
#include "surfels/rows/surfel_writer.h"

namespace surfeit {
namespace {

using testing::AllOf;
using testing::HasSubstr;

class SurfelRowsTest : public SurfelCloudTest {
 protected:
  // A cloud of all channels in which every 97th record has a radius of zero.
  std::string write(std::size_t count, PlyEncoding encoding) {
    std::vector<Surfel> surfels = randomSurfels(count);
    for (std::size_t i = 96; i < count; i += 97) surfels[i].radius = 0;
    Result<SurfelWriter> writer = SurfelWriter::create(
        path("a.ply"), {true, true, true, true, true, true}, {.ply_encoding = encoding});
    EXPECT_TRUE(writer.ok() && writer->write(surfels).ok() && writer->finish().ok());
    return path("a.ply");
  }

  // All surfels by readRows and decodeRows.
  static std::vector<Surfel> decodeAll(SurfelSource& source, std::size_t max_rows,
                                       SurfelDefects& defects) {
    std::vector<Surfel> all;
    AlignedBuffer buffer;
    for (std::uint64_t record = 0;;) {
      const Result<Bytes> rows = source.readRows(max_rows, buffer);
      EXPECT_TRUE(rows.ok()) << rows.status().message();
      if (!rows.ok() || rows->empty()) return all;
      const std::size_t count = rows->size() / source.rowBytes();
      EXPECT_LE(count, max_rows);
      const std::size_t before = all.size();
      all.resize(before + count);
      const Result<std::size_t> valid =
          source.decodeRows(*rows, record, std::span(all).subspan(before), defects);
      EXPECT_TRUE(valid.ok()) << valid.status().message();
      all.resize(before + *valid);
      record += count;
    }
  }

  // Reads the file to its end, 10 records at a time.
  static Status readToTheEnd(SurfelSource& source) {
    AlignedBuffer buffer;
    for (;;) {
      SURFEIT_ASSIGN_OR_RETURN(const Bytes rows, source.readRows(10, buffer));
      if (rows.empty()) return {};
    }
  }
};

TEST_F(SurfelRowsTest, DecodeToWhatReadGives) {
  for (const PlyEncoding encoding :
       {PlyEncoding::kAscii, PlyEncoding::kBinaryLittleEndian, PlyEncoding::kBinaryBigEndian}) {
    const std::string file = write(5000, encoding);
    for (const Access access : {Access::kCached, Access::kDirect}) {
      RowReaderOptions options;
      options.access = access;
      const Result<std::unique_ptr<SurfelSource>> opened = openSurfelSource(file, false, options);
      ASSERT_TRUE(opened.ok()) << opened.status().message();
      SurfelSource& source = **opened;
      EXPECT_EQ(source.rowBytes(), 57u);
      const std::vector<Surfel> expected = readAll(source, 333);
      EXPECT_EQ(expected.size(), 5000u - 5000 / 97);
      const SurfelDefects expected_defects = source.defects();
      for (const std::size_t max_rows : {1u, 100u, 4999u, 5000u, 100000u}) {
        ASSERT_TRUE(source.rewind().ok());
        SurfelDefects defects;
        EXPECT_TRUE(areEqual(decodeAll(source, max_rows, defects), expected));
        EXPECT_EQ(defects.describe(), expected_defects.describe());
        EXPECT_EQ(source.defects().total(), 0u);
      }
    }
  }
}

TEST_F(SurfelRowsTest, RowsWithListsAreDecodedToo) {
  SurfelCloudTest::write(
      "a.ply",
      "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty list uchar int l\n"
      "property float y\nproperty float z\nend_header\n1 2 7 8 2 3\n4 0 5 6\n7 1 9 8 9\n");
  const auto source = open(path("a.ply"));
  EXPECT_EQ(source->rowBytes(), 12u);
  EXPECT_FALSE(source->isSeekable());
  SurfelDefects defects;
  const std::vector<Surfel> surfels = decodeAll(*source, 2, defects);
  ASSERT_EQ(surfels.size(), 3u);
  EXPECT_EQ(surfels[2].position, glm::vec3(7, 8, 9));
}

TEST_F(SurfelRowsTest, AreDecodedByManyThreadsAtOnce) {
  const auto source = open(write(20000, PlyEncoding::kBinaryLittleEndian));
  AlignedBuffer buffer;
  const Result<Bytes> rows = source->readRows(20000, buffer);
  ASSERT_TRUE(rows.ok());
  std::vector<Surfel> expected(20000);
  SurfelDefects expected_defects;
  expected.resize(*source->decodeRows(*rows, 0, expected, expected_defects));

  constexpr std::size_t kThreads = 4, kRows = 5000;
  std::vector<std::vector<Surfel>> parts(kThreads, std::vector<Surfel>(kRows));
  std::vector<SurfelDefects> part_defects(kThreads);
  std::vector<std::thread> threads;
  for (std::size_t i = 0; i < kThreads; ++i) {
    threads.emplace_back([&, i] {
      const Bytes part = rows->subspan(i * kRows * source->rowBytes(), kRows * source->rowBytes());
      parts[i].resize(*source->decodeRows(part, i * kRows, parts[i], part_defects[i]));
    });
  }
  for (std::thread& thread : threads) thread.join();
  std::vector<Surfel> surfels;
  SurfelDefects defects;
  for (std::size_t i = 0; i < kThreads; ++i) {
    surfels.insert(surfels.end(), parts[i].begin(), parts[i].end());
    defects.add(part_defects[i]);
  }
  EXPECT_TRUE(areEqual(surfels, expected));
  EXPECT_EQ(defects.describe(), expected_defects.describe());
}

TEST_F(SurfelRowsTest, SeekGoesToAnyRecordOfABinaryFile) {
  const auto ascii = open(write(10, PlyEncoding::kAscii));
  EXPECT_FALSE(ascii->isSeekable());
  EXPECT_EQ(ascii->seekRow(0).code(), StatusCode::kInvalidArgument);

  for (const PlyEncoding encoding :
       {PlyEncoding::kBinaryLittleEndian, PlyEncoding::kBinaryBigEndian}) {
    const auto source = open(write(3000, encoding));
    ASSERT_TRUE(source->isSeekable());
    AlignedBuffer whole_buffer, buffer;
    const Result<Bytes> whole = source->readRows(3000, whole_buffer);
    ASSERT_TRUE(whole.ok());
    std::mt19937 random(6);
    for (int i = 0; i < 200; ++i) {
      const std::uint64_t record = random() % 3001;
      const std::size_t count = random() % 50 + 1;
      ASSERT_TRUE(source->seekRow(record).ok());
      const Result<Bytes> rows = source->readRows(count, buffer);
      ASSERT_TRUE(rows.ok()) << rows.status().message();
      const std::size_t expected = std::min<std::size_t>(count, 3000 - record) * 57;
      ASSERT_EQ(rows->size(), expected);
      EXPECT_TRUE(
          std::equal(rows->begin(), rows->end(), whole->begin() + std::ptrdiff_t(record * 57)));
    }
    EXPECT_EQ(source->seekRow(3001).code(), StatusCode::kInvalidArgument);
    ASSERT_TRUE(source->rewind().ok());
    EXPECT_EQ(readAll(*source).size(), 3000u - 3000 / 97);
  }
}

TEST_F(SurfelRowsTest, StrictNamesTheFirstInvalidRecordOfTheRows) {
  const auto source = open(write(300, PlyEncoding::kBinaryLittleEndian), true);
  AlignedBuffer buffer;
  const Result<Bytes> rows = source->readRows(300, buffer);
  ASSERT_TRUE(rows.ok());
  std::vector<Surfel> surfels(300);
  SurfelDefects defects;
  EXPECT_EQ(source->decodeRows(*rows, 0, surfels, defects).status().message(),
            path("a.ply") + ": record 96: radius is 0, expected more than 0");
  EXPECT_EQ(source->decodeRows(rows->subspan(100 * 57), 100, surfels, defects).status().message(),
            path("a.ply") + ": record 193: radius is 0, expected more than 0");
  EXPECT_TRUE(source->decodeRows(rows->first(96 * 57), 0, surfels, defects).ok());
}

TEST_F(SurfelRowsTest, FileCutWhileItIsReadIsRefused) {
  const std::string file = write(1000, PlyEncoding::kBinaryLittleEndian);
  const auto source = open(file);
  const std::uintmax_t size = std::filesystem::file_size(file);
  std::filesystem::resize_file(file, size - 57 * 100 - 1);
  const Status status = readToTheEnd(*source);
  EXPECT_EQ(status.code(), StatusCode::kCorruption);
  EXPECT_THAT(status.message(),
              AllOf(HasSubstr(file + ": element vertex row 899: file ends early: 569 bytes at "),
                    HasSubstr(", expected 570")));
}

TEST_F(SurfelRowsTest, FileWrittenToWhileItIsReadIsRefused) {
  for (const PlyEncoding encoding : {PlyEncoding::kAscii, PlyEncoding::kBinaryLittleEndian}) {
    for (const bool is_longer : {false, true}) {
      const std::string file = write(100, encoding);
      const auto source = open(file);
      const auto size = std::to_string(std::filesystem::file_size(file));
      const auto written = std::filesystem::last_write_time(file);
      if (is_longer) std::ofstream(file, std::ios::app) << "more";
      std::filesystem::last_write_time(file, written + std::chrono::seconds(is_longer ? 0 : 1));
      const Status status = readToTheEnd(*source);
      EXPECT_EQ(status.code(), StatusCode::kCorruption);
      if (encoding == PlyEncoding::kAscii && is_longer) continue;  // bytes after the last element
      EXPECT_THAT(status.message(), AllOf(HasSubstr(file + ": changed while it was read: found "),
                                          HasSubstr("expected " + size + " bytes")));
    }
  }
}

TEST_F(SurfelRowsTest, FileReplacedWhileItIsReadIsReadToItsEnd) {
  const std::string file = write(1000, PlyEncoding::kBinaryLittleEndian);
  const auto source = open(file);
  write(10, PlyEncoding::kBinaryLittleEndian);  // renames a new file over the old one
  EXPECT_EQ(readAll(*source).size(), 990u);
  std::filesystem::remove(file);
  ASSERT_TRUE(source->rewind().ok());
  EXPECT_EQ(readAll(*source).size(), 990u);
}

}  // namespace
}  // namespace surfeit
