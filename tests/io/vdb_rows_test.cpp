// Reading and writing .vdb without OpenVDB: damage, budgets, order, and a file of its own samples.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstring>
#include <filesystem>
#include <limits>
#include <map>
#include <random>
#include <string>
#include <vector>

#include "cloud/vdb/vdb_coding.h"
#include "cloud/vdb/vdb_reader.h"
#include "cloud/vdb/vdb_writer.h"
#include "io/test_directory.h"

namespace surfeit {
namespace {

using testing::HasSubstr;

class VdbRows : public DirectoryTest {
 protected:
  // Points with a normal and an id, some of them far apart, in x of 0 to `extent`.
  std::vector<float> someRows(std::size_t count, float extent = 10) const {
    std::mt19937 random(3);
    std::uniform_real_distribution<float> uniform(0, 1);
    std::vector<float> rows;
    for (std::size_t i = 0; i < count; ++i) {
      const float u = uniform(random), v = uniform(random);
      rows.insert(rows.end(), {u * extent, v * extent, u * v, u, v, 1 - u, 0.01f * float(i)});
    }
    return rows;
  }

  RowWriterOptions someOptions() const {
    RowWriterOptions options;
    for (const char* name : {"x", "y", "z", "nx", "ny", "nz", "radius"}) {
      RowProperty property;
      property.name = name;
      options.properties.push_back(property);
    }
    return options;
  }

  Status writeRows(const std::string& name, const std::vector<float>& rows,
                   const RowWriterOptions& options,
                   std::vector<std::string>* notes = nullptr) const {
    Result<std::unique_ptr<RowWriter>> writer = createVdb(path(name), options);
    if (!writer.ok()) return writer.status();
    SURFEIT_RETURN_IF_ERROR((*writer)->writeRows(std::as_bytes(std::span(rows))));
    SURFEIT_RETURN_IF_ERROR((*writer)->finish());
    if (notes != nullptr) *notes = (*writer)->notes();
    return {};
  }

  // All rows as bytes; reading goes on until the first failure.
  static Status readAll(RowReader& reader, std::size_t batch, std::string& bytes) {
    AlignedBuffer buffer;
    bytes.clear();
    while (true) {
      SURFEIT_ASSIGN_OR_RETURN(const Bytes rows, reader.readRows(batch, buffer));
      if (rows.empty()) return {};
      bytes.append(reinterpret_cast<const char*>(rows.data()), rows.size());
    }
  }
  Status readAll(const std::string& name, std::size_t batch, std::string& bytes) const {
    SURFEIT_ASSIGN_OR_RETURN(std::unique_ptr<RowReader> reader, openVdb(path(name), {}));
    return readAll(*reader, batch, bytes);
  }
};

template <typename T>
void put(std::string& file, const T& value) {
  file.append(reinterpret_cast<const char*>(&value), sizeof(T));
}
void putText(std::string& file, const std::string& text) {
  put(file, static_cast<std::uint32_t>(text.size()));
  file += text;
}

// One root child with one active tile of 128^3 voxels and one leaf with `active` in its mask.
std::string volumeFile(std::uint64_t active = 0xFF) {
  std::string file("\x20\x42\x44\x56\0\0\0\0", 8);
  put(file, std::uint32_t{224});
  put(file, std::uint64_t{10});
  put(file, char{1});
  file.append(36, 'u');
  put(file, std::uint32_t{0});  // metadata
  put(file, std::uint32_t{1});  // grids
  putText(file, "density");
  putText(file, "Tree_float_5_4_3");
  putText(file, "");
  const std::size_t places = file.size();
  file.append(24, '\0');
  const std::size_t begin = file.size();
  put(file, kVdbActiveMask);
  put(file, std::uint32_t{0});
  putText(file, "TranslationMap");
  for (const double value : {10.0, 20.0, 30.0}) put(file, value);
  put(file, std::uint32_t{1});  // buffers
  put(file, 0.0f);              // background
  put(file, std::uint32_t{0});
  put(file, std::uint32_t{1});
  put(file, std::int32_t{0});
  put(file, std::int32_t{-4096});
  put(file, std::int32_t{0});
  std::string mask(32768 / 8, '\0');
  mask[0] = 1;
  file += mask;  // child 0
  mask[0] = 2;
  file += mask;  // tile 1
  put(file, std::int8_t{0});
  put(file, 0.25f);
  std::string small(4096 / 8, '\0');
  small[0] = 1;
  file += small;
  small[0] = 0;
  file += small;
  put(file, std::int8_t{0});
  std::string leaf(64, '\0');
  std::memcpy(leaf.data(), &active, 8);
  file += leaf;
  const std::size_t buffers = file.size();
  file += leaf;
  put(file, std::int8_t{0});
  for (int i = 0; i < std::popcount(active); ++i) put(file, float(i));
  const std::uint64_t offsets[3] = {begin, buffers, file.size()};
  std::memcpy(file.data() + places, offsets, sizeof(offsets));
  return file;
}

TEST_F(VdbRows, TheSampleOfHoudiniIsRead) {
  const std::string sample = std::string(SURFEIT_SHARED_DATA_DIR) + "/particles/sphere_points.vdb";
  if (!std::filesystem::exists(sample)) GTEST_SKIP() << "no shared data";
  Result<std::unique_ptr<RowReader>> opened = openVdb(sample, {});
  ASSERT_TRUE(opened.ok()) << opened.status().message();
  EXPECT_EQ((*opened)->formatName(), "OpenVDB points");
  ASSERT_EQ((*opened)->element().count, 9802u);
  ASSERT_EQ((*opened)->element().row_bytes, 12u);
  std::string bytes;
  ASSERT_TRUE(readAll(**opened, 100, bytes).ok());
  std::vector<float> rows(bytes.size() / 4);
  std::memcpy(rows.data(), bytes.data(), bytes.size());
  ASSERT_EQ(rows.size(), 3 * 9802u);
  for (std::size_t i = 0; i < rows.size(); i += 3) {
    ASSERT_NEAR(std::hypot(rows[i], rows[i + 1], rows[i + 2]), 1, 0.002) << i;
  }
}

TEST_F(VdbRows, PointsComeBackWithinTheirVoxelsPrecision) {
  std::vector<float> rows = someRows(5000);
  ASSERT_TRUE(writeRows("a.vdb", rows, someOptions()).ok());
  std::string bytes;
  ASSERT_TRUE(readAll("a.vdb", 333, bytes).ok());
  ASSERT_EQ(bytes.size(), rows.size() * 4);
  std::vector<float> found(rows.size());
  std::memcpy(found.data(), bytes.data(), bytes.size());
  // By their radius, which counts them; the columns are position, normal, radius in both
  std::map<float, std::size_t> place;
  for (std::size_t i = 0; i < rows.size(); i += 7) place[rows[i + 6]] = i;
  for (std::size_t i = 0; i < found.size(); i += 7) {
    ASSERT_EQ(place.count(found[i + 6]), 1u);
    const std::size_t row = place[found[i + 6]];
    for (std::size_t c = 0; c < 3; ++c) ASSERT_NEAR(found[i + c], rows[row + c], 1e-6);
    for (std::size_t c = 3; c < 6; ++c) ASSERT_EQ(found[i + c], rows[row + c]);
  }
}

TEST_F(VdbRows, BatchesAndRewindGiveTheSameRows) {
  ASSERT_TRUE(writeRows("a.vdb", someRows(4000), someOptions()).ok());
  write("b.vdb", volumeFile());
  for (const char* name : {"a.vdb", "b.vdb"}) {
    std::string all, part;
    ASSERT_TRUE(readAll(name, std::numeric_limits<std::size_t>::max(), all).ok());
    for (const std::size_t batch : {std::size_t{997}, std::size_t{512}, std::size_t{100000}}) {
      ASSERT_TRUE(readAll(name, batch, part).ok());
      EXPECT_EQ(part, all);
    }
    Result<std::unique_ptr<RowReader>> reader = openVdb(path(name), {});
    ASSERT_TRUE(reader.ok());
    AlignedBuffer buffer;
    ASSERT_TRUE((*reader)->readRows(17, buffer).ok());
    ASSERT_TRUE((*reader)->rewind().ok());
    ASSERT_TRUE(readAll(**reader, 1000, part).ok());
    EXPECT_EQ(part, all);
    EXPECT_FALSE((*reader)->isSeekable());
  }
}

TEST_F(VdbRows, TheSameRowsGiveTheSameBytes) {
  const std::vector<float> rows = someRows(3000);
  ASSERT_TRUE(writeRows("a.vdb", rows, someOptions()).ok());
  ASSERT_TRUE(writeRows("b.vdb", rows, someOptions()).ok());
  EXPECT_EQ(contents("a.vdb"), contents("b.vdb"));
}

TEST_F(VdbRows, TilesAndLeavesOfAVolumeAreRows) {
  write("v.vdb", volumeFile());
  Result<std::unique_ptr<RowReader>> reader = openVdb(path("v.vdb"), {});
  ASSERT_TRUE(reader.ok()) << reader.status().message();
  const RowLayout& element = (*reader)->element();
  EXPECT_EQ(element.count, 8u + 128 * 128 * 128);
  AlignedBuffer buffer;
  const Result<Bytes> rows = (*reader)->readRows(9, buffer);
  ASSERT_TRUE(rows.ok());
  const auto value = [&](std::size_t row, const char* name) {
    const RowProperty* property = element.find(name);
    return rowValue(rows->data() + row * element.row_bytes + property->offset, property->type);
  };
  EXPECT_EQ(value(7, "density"), 7);
  EXPECT_EQ(value(7, "voxel_k"), 7);
  EXPECT_EQ(value(7, "voxel_j"), -4096);
  EXPECT_EQ(value(7, "x"), 10);
  EXPECT_EQ(value(7, "y"), 20 - 4096);
  EXPECT_EQ(value(7, "z"), 37);
  EXPECT_EQ(value(8, "density"), 0.25);
  EXPECT_EQ(value(8, "voxel_k"), 128);
}

// Whatever is read of it: a Status that names the file, or rows.
void expectNoCrash(const std::string& path, bool is_refused) {
  Result<std::unique_ptr<RowReader>> reader = openVdb(path, {});
  Status status = reader.status();
  AlignedBuffer buffer;
  std::uint64_t rows_read = 0;
  while (status.ok() && rows_read < 100000) {
    const Result<Bytes> rows = (*reader)->readRows(1000, buffer);
    status = rows.status();
    if (!status.ok() || rows->empty()) break;
    rows_read += rows->size() / (*reader)->element().row_bytes;
  }
  if (is_refused) {
    EXPECT_FALSE(status.ok());
  }
  if (!status.ok()) {
    EXPECT_EQ(status.code(), StatusCode::kCorruption) << status.message();
    EXPECT_THAT(status.message(), HasSubstr(path));
  }
}

TEST_F(VdbRows, EveryTruncationIsRefused) {
  ASSERT_TRUE(writeRows("a.vdb", someRows(40), someOptions()).ok());
  for (const std::string& whole : {contents("a.vdb"), volumeFile()}) {
    for (std::size_t size = 0; size < whole.size(); size += size < 800 ? 1 : 29) {
      write("cut.vdb", whole.substr(0, size));
      expectNoCrash(path("cut.vdb"), true);
    }
  }
}

TEST_F(VdbRows, NoDamagedByteDoesHarm) {
  ASSERT_TRUE(writeRows("a.vdb", someRows(300), someOptions()).ok());
  std::mt19937 random(5);
  for (const std::string& whole : {contents("a.vdb"), volumeFile()}) {
    for (std::size_t at = 0; at < whole.size(); at += 1 + (at > 800 ? random() % 59 : 0)) {
      std::string damaged = whole;
      for (const char byte : {'\xFF', static_cast<char>(random())}) {
        damaged[at] = byte;
        write("damaged.vdb", damaged);
        expectNoCrash(path("damaged.vdb"), false);
      }
    }
  }
}

TEST_F(VdbRows, WrongSizesAndOldFilesAreNamed) {
  const auto refuse = [&](const std::string& file, const char* message) {
    write("bad.vdb", file);
    const Result<std::unique_ptr<RowReader>> reader = openVdb(path("bad.vdb"), {});
    ASSERT_FALSE(reader.ok());
    EXPECT_THAT(reader.status().message(), HasSubstr(message));
  };
  std::string file = volumeFile();
  file[8] = '\xD5';
  refuse(file, "version 213");
  file = volumeFile();
  file[20] = 0;
  refuse(file, "stream");
  file = volumeFile();
  file.replace(file.find("Tree_float_5_4_3"), 16, "Tree_float_4_4_3");
  refuse(file, "no grid that is read");
  file = volumeFile();
  file.replace(file.find("TranslationMap"), 14, "TranslationFox");
  refuse(file, "transform");
  // 4 billion tiles of the root
  file = volumeFile();
  const std::size_t tiles = file.find("TranslationMap") + 14 + 24 + 8;
  file.replace(tiles, 4, 4, '\xFF');
  refuse(file, "4294967295 tiles");
}

TEST_F(VdbRows, PartsAreChosenByName) {
  write("v.vdb", volumeFile());
  RowReaderOptions options;
  options.part = "density";
  EXPECT_TRUE(openVdb(path("v.vdb"), options).ok());
  options.part = "smoke";
  const Result<std::unique_ptr<RowReader>> reader = openVdb(path("v.vdb"), options);
  ASSERT_FALSE(reader.ok());
  EXPECT_EQ(reader.status().code(), StatusCode::kInvalidArgument);
  EXPECT_THAT(reader.status().message(), HasSubstr("density"));
}

TEST_F(VdbRows, ChannelsAreRenamedAndDropped) {
  ASSERT_TRUE(writeRows("a.vdb", someRows(100), someOptions()).ok());
  RowReaderOptions options;
  options.channels = {{"pscale", "occlusion"}, {"N", "-"}};
  const Result<std::unique_ptr<RowReader>> reader = openVdb(path("a.vdb"), options);
  ASSERT_TRUE(reader.ok()) << reader.status().message();
  EXPECT_NE((*reader)->element().find("occlusion"), nullptr);
  EXPECT_EQ((*reader)->element().find("nx"), nullptr);
  EXPECT_EQ((*reader)->element().row_bytes, 16u);
}

TEST_F(VdbRows, TooManyRowsForTheMemoryAreRefusedWithWhatTheyNeed) {
  RowWriterOptions options = someOptions();
  options.memory_bytes = 1 << 20;
  options.count = 1000000;
  const Result<std::unique_ptr<RowWriter>> writer = createVdb(path("a.vdb"), options);
  ASSERT_FALSE(writer.ok());
  EXPECT_EQ(writer.status().code(), StatusCode::kBudgetTooSmall);
  EXPECT_THAT(writer.status().message(), HasSubstr("need 42 MiB, 1 MiB"));

  options.count.reset();
  const Status status = writeRows("a.vdb", someRows(30000), options);
  EXPECT_EQ(status.code(), StatusCode::kBudgetTooSmall);
  EXPECT_EQ(fileCount(), 0);
}

TEST_F(VdbRows, RowsWithoutAPlaceAreLeftOutAndTold) {
  std::vector<float> rows = someRows(100);
  rows[7 * 3] = std::numeric_limits<float>::quiet_NaN();
  rows[7 * 5 + 2] = std::numeric_limits<float>::infinity();
  std::vector<std::string> notes;
  ASSERT_TRUE(writeRows("a.vdb", rows, someOptions(), &notes).ok());
  EXPECT_THAT(notes, testing::ElementsAre(HasSubstr("2 rows")));
  std::string bytes;
  ASSERT_TRUE(readAll("a.vdb", 1000, bytes).ok());
  EXPECT_EQ(bytes.size(), 98u * 28);
}

TEST_F(VdbRows, CloudsWithoutExtentAndOutliersAreWritten) {
  std::vector<float> rows = someRows(2000, 0);
  for (std::size_t i = 2; i < rows.size(); i += 7) rows[i] = 0;
  std::string bytes;
  ASSERT_TRUE(writeRows("same.vdb", rows, someOptions()).ok());
  ASSERT_TRUE(readAll("same.vdb", 100, bytes).ok());
  EXPECT_EQ(bytes.size(), rows.size() * 4);
  rows[0] = 1e30f;
  rows[7] = -1e-30f;
  ASSERT_TRUE(writeRows("far.vdb", rows, someOptions()).ok());
  ASSERT_TRUE(readAll("far.vdb", 100, bytes).ok());
}

// Rows of the file for one copy and for 12 of them, exact or nearly so.
TEST_F(VdbRows, CopiesOfACloudTakeAsManyBytesPerRowAsTheCloud) {
  const std::vector<float> rows = someRows(20000);
  ASSERT_TRUE(writeRows("one.vdb", rows, someOptions()).ok());
  const double one = double(contents("one.vdb").size());
  std::mt19937 random(11);
  for (const float noise : {0.0f, 1e-5f, 1e-3f}) {
    std::normal_distribution<float> normal(0, 1);
    std::vector<float> copies;
    for (int copy = 0; copy < 12; ++copy) {
      for (std::size_t i = 0; i < rows.size(); ++i) {
        copies.push_back(rows[i] + (i % 7 < 3 ? noise * normal(random) : 0));
      }
    }
    ASSERT_TRUE(writeRows("copies.vdb", copies, someOptions()).ok());
    EXPECT_LE(double(contents("copies.vdb").size()) / 12, 1.2 * one) << noise;
    std::string bytes;
    ASSERT_TRUE(readAll("copies.vdb", 5000, bytes).ok());
    EXPECT_EQ(bytes.size(), copies.size() * 4);
  }
}

TEST_F(VdbRows, LeavesTakeAnyNumberOfPoints) {
  // 67 MB of an attribute for one voxel, pages 64 times as large as usual
  RowWriterOptions options = someOptions();
  for (int i = 0; i < 200; ++i) {
    RowProperty property;
    property.name = "weights_" + std::to_string(i);
    options.properties.push_back(property);
  }
  const std::vector<float> rows(207 * 84000, 0.5f);
  ASSERT_TRUE(writeRows("dense.vdb", rows, options).ok());
  std::string bytes;
  ASSERT_TRUE(readAll("dense.vdb", 100000, bytes).ok());
  ASSERT_EQ(bytes.size(), rows.size() * 4);
  EXPECT_EQ(std::memcmp(bytes.data(), rows.data(), bytes.size()), 0);
}

TEST_F(VdbRows, WhatCannotBeWrittenIsRefused) {
  RowWriterOptions options = someOptions();
  options.properties.erase(options.properties.begin());
  EXPECT_EQ(createVdb(path("a.vdb"), options).status().code(), StatusCode::kInvalidArgument);
  EXPECT_EQ(createVdb(path("a.vdb.gz"), someOptions()).status().code(),
            StatusCode::kInvalidArgument);
  options = someOptions();
  options.properties[6].name = "nx";
  EXPECT_EQ(createVdb(path("a.vdb"), options).status().code(), StatusCode::kInvalidArgument);
}

TEST_F(VdbRows, BloscFramesOfAnotherSizeDoNotUnpack) {
  std::vector<std::byte> bytes(1000, std::byte{7}), frame, out(1000);
  packBlosc(bytes, 4, frame);
  EXPECT_TRUE(unpackBlosc(frame, out));
  EXPECT_EQ(out, bytes);
  EXPECT_FALSE(unpackBlosc(frame, std::span(out).first(999)));
  EXPECT_FALSE(unpackBlosc(std::span(frame).first(frame.size() - 1), out));
  EXPECT_FALSE(unpackBlosc({}, out));
}

}  // namespace
}  // namespace surfeit
