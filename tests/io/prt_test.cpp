#include <gtest/gtest.h>
#include <zlib.h>

#include <cstring>

#include "cloud/particles/prt2_reader.h"
#include "cloud/particles/prt_reader.h"
#include "cloud/particles/prt_writer.h"
#include "io/compressed_files.h"
#include "io/row_damage_test.h"
#include "io/test_bytes.h"

namespace surfeit {
namespace {

std::string deflated(const std::string& bytes) {
  uLongf size = compressBound(bytes.size());
  std::string packed(size, '\0');
  compress(reinterpret_cast<Bytef*>(packed.data()), &size,
           reinterpret_cast<const Bytef*>(bytes.data()), bytes.size());
  packed.resize(size);
  return packed;
}

struct Channel {
  std::string name;
  std::int32_t type = 4, arity = 1, offset = 0;
};

// A PRT 1 file; `metadata` is what stands between the fixed header and the channels.
std::string prt(const std::vector<Channel>& channels, std::int64_t count,
                const std::string& records, std::int32_t version = 1,
                const std::string& metadata = "", std::int32_t channel_bytes = 44) {
  std::string file("\xC0PRT\r\n\x1A\n", 8);
  file += littleEndian(std::int32_t(56 + metadata.size()));
  std::string signature = "Extensible Particle Format";
  signature.resize(32);
  file += signature + littleEndian(version) + littleEndian(count) + metadata +
          littleEndian(std::int32_t{4}) + littleEndian(std::int32_t(channels.size())) +
          littleEndian(channel_bytes);
  for (const Channel& channel : channels) {
    std::string text = channel.name;
    text.resize(32);
    text += littleEndian(channel.type) + littleEndian(channel.arity) + littleEndian(channel.offset);
    text.resize(std::size_t(channel_bytes));
    file += text;
  }
  return file + deflated(records);
}

// Three particles of a position.
std::string positions() {
  std::string records;
  for (int i = 0; i < 9; ++i) records += littleEndian(float(i));
  return records;
}

class PrtTest : public RowFileTest {
 protected:
  std::unique_ptr<RowReader> openPrtOf(const std::string& bytes) {
    write("a.prt", bytes);
    return openOk(openPrt, path("a.prt"));
  }
  std::string refusalOf(const std::string& bytes) { return refusal(openPrt, bytes); }
};

TEST_F(PrtTest, ReadsPositions) {
  const auto reader = openPrtOf(prt({{"Position", 4, 3, 0}}, 3, positions()));
  ASSERT_NE(reader, nullptr);
  EXPECT_EQ(reader->formatName(), "PRT 1.0");
  EXPECT_EQ(reader->element().count, 3u);
  EXPECT_EQ(describeRow(reader->element()), "float x, float y, float z");
  const std::vector<std::byte> rows = readAllRows(*reader);
  EXPECT_EQ(valueOf(*reader, rows, 2, "y"), 7);
  ASSERT_TRUE(reader->rewind().ok());
  expectReaderKeepsContract(*reader);
}

TEST_F(PrtTest, ChannelsMayBeUnorderedAndLeaveGaps) {
  // [ id u8 | 3 bytes | position | half ], twice
  std::string records;
  for (int i = 0; i < 2; ++i) {
    records += littleEndian(std::uint8_t(40 + i)) + "???" + littleEndian(1.0f) +
               littleEndian(2.0f) + littleEndian(float(i)) +
               littleEndian(std::uint16_t{0x3C00}) /* 1 as a half */;
  }
  const auto reader =
      openPrtOf(prt({{"Density", 3, 1, 16}, {"Position", 4, 3, 4}, {"ID", 10, 1, 0}}, 2, records));
  ASSERT_NE(reader, nullptr);
  EXPECT_EQ(describeRow(reader->element()), "float density, float x, float y, float z, uchar id");
  const std::vector<std::byte> rows = readAllRows(*reader);
  EXPECT_EQ(valueOf(*reader, rows, 1, "z"), 1);
  EXPECT_EQ(valueOf(*reader, rows, 1, "density"), 1);
  EXPECT_EQ(valueOf(*reader, rows, 1, "id"), 41);
}

TEST_F(PrtTest, ReadsEveryType) {
  std::vector<Channel> channels{{"Position", 4, 3, 0}};
  std::string record = positions().substr(0, 12);
  const std::string values[] = {littleEndian(std::int16_t{-5}),
                                littleEndian(std::int32_t{-6}),
                                littleEndian(std::int64_t{-7}),
                                littleEndian(std::uint16_t{0xC000}),
                                littleEndian(-1.5f),
                                littleEndian(-2.5),
                                littleEndian(std::uint16_t{9}),
                                littleEndian(std::uint32_t{10}),
                                littleEndian(std::uint64_t{11}),
                                littleEndian(std::int8_t{-12}),
                                littleEndian(std::uint8_t{13})};
  for (int type = 0; type < 11; ++type) {
    channels.push_back({"t" + std::to_string(type), type, 1, std::int32_t(record.size())});
    record += values[type];
  }
  const auto reader = openPrtOf(prt(channels, 1, record));
  ASSERT_NE(reader, nullptr);
  const std::vector<std::byte> rows = readAllRows(*reader);
  const double expected[] = {-5, -6, -7, -2, -1.5, -2.5, 9, 10, 11, -12, 13};
  for (int type = 0; type < 11; ++type) {
    EXPECT_EQ(valueOf(*reader, rows, 0, "t" + std::to_string(type)), expected[type]) << type;
  }
  EXPECT_EQ(reader->notes().size(), 2u);  // the 64-bit integers
}

TEST_F(PrtTest, LongerChannelDescriptionsArePassedOver) {
  const auto reader = openPrtOf(prt({{"Position", 4, 3, 0}}, 3, positions(), 1, "", 60));
  ASSERT_NE(reader, nullptr);
  EXPECT_EQ(readAllRows(*reader).size(), 36u);
}

TEST_F(PrtTest, UnstatedCountIsCounted) {
  const auto reader = openPrtOf(prt({{"Position", 4, 3, 0}}, -1, positions()));
  ASSERT_NE(reader, nullptr);
  EXPECT_EQ(reader->element().count, 3u);
  EXPECT_EQ(readAllRows(*reader).size(), 36u);
}

TEST_F(PrtTest, TextsOfMetadataAreComments) {
  const std::string text = std::string("Position\0Interpretation\0", 24) +
                           littleEndian(std::int32_t{-1}) + std::string("Point\0", 6);
  const std::string metadata = "Meta" + littleEndian(std::int32_t(text.size())) + text + "Stop" +
                               littleEndian(std::int32_t{0});
  const auto reader = openPrtOf(prt({{"Position", 4, 3, 0}}, 3, positions(), 2, metadata));
  ASSERT_NE(reader, nullptr);
  EXPECT_EQ(reader->formatName(), "PRT 1.1");
  EXPECT_EQ(reader->comments(), std::vector<std::string>{"Position.Interpretation: Point"});
  EXPECT_EQ(readAllRows(*reader).size(), 36u);
}

TEST_F(PrtTest, RenamedAndDroppedChannels) {
  write("a.prt", prt({{"Position", 4, 3, 0}, {"Extra", 4, 3, 0}}, 3, positions()));
  RowReaderOptions options;
  options.channels = {{"Position", "-"}, {"Extra", "position"}};
  const auto reader = openOk(openPrt, path("a.prt"), options);
  ASSERT_NE(reader, nullptr);
  EXPECT_EQ(describeRow(reader->element()), "float x, float y, float z");
}

TEST_F(PrtTest, RefusesBadHeaders) {
  const std::vector<Channel> position{{"Position", 4, 3, 0}};
  EXPECT_NE(refusalOf(prt(position, -8, positions())).find("-8 particles"), std::string::npos);
  EXPECT_NE(refusalOf(prt(position, 1 << 30, positions())).find("at most"), std::string::npos);
  EXPECT_NE(refusalOf(prt({}, 3, positions())).find("0 channels"), std::string::npos);
  EXPECT_NE(refusalOf(prt({{"Position", 11, 3, 0}}, 3, positions())).find("type 11"),
            std::string::npos);
  EXPECT_NE(refusalOf(prt({{"Position", 4, -3, 0}}, 3, positions())).find("-3 values"),
            std::string::npos);
  EXPECT_NE(refusalOf(prt({{"Position", 4, 3, -4}}, 3, positions())).find("at -4"),
            std::string::npos);
  EXPECT_NE(refusalOf(prt({{"Position", 4, 2'000'000'000, 0}}, 3, positions())).find("values"),
            std::string::npos);
  EXPECT_NE(refusalOf(prt({{"", 4, 3, 0}}, 3, positions())).find("without a name"),
            std::string::npos);
  EXPECT_NE(refusalOf(prt({{"Position", 4, 3, 0}, {"Position", 4, 3, 0}}, 3, positions()))
                .find("Position"),
            std::string::npos);
  EXPECT_NE(refusalOf(prt(position, 3, positions(), 1, "", 40)).find("per channel"),
            std::string::npos);
  EXPECT_NE(refusalOf(prt(position, 3, positions(), 7)).find("version 7"), std::string::npos);
  // Metadata that would make a reader go backwards, or past the header
  for (const std::int32_t length : {-8, -1, 1, 2'000'000'000}) {
    const std::string metadata = "Meta" + littleEndian(length);
    EXPECT_NE(refusalOf(prt(position, 3, positions(), 2, metadata)).find("metadata of"),
              std::string::npos);
  }
  EXPECT_NE(refusalOf(prt(position, 3, positions(), 2, "Meta" + littleEndian(0))).find("Stop"),
            std::string::npos);
}

TEST_F(PrtTest, CountMustBeThatOfTheStream) {
  EXPECT_NE(refusalOf(prt({{"Position", 4, 3, 0}}, 2, positions())).find("more data"),
            std::string::npos);
  EXPECT_NE(refusalOf(prt({{"Position", 4, 3, 0}}, 4, positions())).find("row 3"),
            std::string::npos);
  EXPECT_NE(refusalOf(prt({{"Position", 4, 3, 0}}, -1, positions() + "x")).find("multiple of 12"),
            std::string::npos);
}

TEST_F(PrtTest, FailureStaysUntilRewind) {
  const auto reader = openPrtOf(prt({{"Position", 4, 3, 0}}, 4, positions()));
  ASSERT_NE(reader, nullptr);
  AlignedBuffer buffer;
  EXPECT_FALSE(reader->readRows(4, buffer).ok());
  EXPECT_FALSE(reader->readRows(1, buffer).ok());
  ASSERT_TRUE(reader->rewind().ok());
  EXPECT_TRUE(reader->readRows(3, buffer).ok());
  EXPECT_FALSE(reader->readRows(3, buffer).ok());
}

TEST_F(PrtTest, ManyRowsAreReadAtOnce) {
  // More bytes than are given room at first
  std::string records;
  for (int i = 0; i < 4'500'000; ++i) records += littleEndian(float(i / 1000));
  const auto reader = openPrtOf(prt({{"Position", 4, 3, 0}}, 1'500'000, records));
  ASSERT_NE(reader, nullptr);
  const std::vector<std::byte> rows = readAllRows(*reader, ~std::size_t{0});
  ASSERT_EQ(rows.size(), records.size());
  EXPECT_EQ(std::memcmp(rows.data(), records.data(), rows.size()), 0);
}

TEST_F(PrtTest, CompressedCountThatLiesFailsWithoutMemory) {
  // 2^62 rows of 12 bytes are a multiple of 2^64
  const std::string records(12 * 50'000, 'x');
  write("a.prt.gz", gzipped(prt({{"Position", 4, 3, 0}}, std::int64_t{1} << 62, records)));
  const auto reader = openOk(openPrt, path("a.prt.gz"));
  ASSERT_NE(reader, nullptr);
  AlignedBuffer buffer;
  const Result<Bytes> rows = reader->readRows(~std::size_t{0}, buffer);
  EXPECT_NE(rows.status().message().find("the particles end here"), std::string::npos);
  EXPECT_LT(buffer.capacity(), std::size_t{64} << 20);
}

TEST_F(PrtTest, EveryTruncationIsRefused) {
  const std::string file = prt({{"Position", 4, 3, 0}}, 3, positions());
  expectEveryTruncationFails(openPrt, file, file.size());
  expectDamageIsHarmless(openPrt, file);
}

TEST_F(PrtTest, WrittenFilesAreReadBackWithAllTypes) {
  RowWriterOptions options;
  for (const char* name :
       {"x", "y", "z", "nx", "ny", "nz", "radius", "red", "green", "blue", "radiosity_r",
        "radiosity_g", "radiosity_b", "foo_x", "foo_y", "foo_z", "bar_r", "bar_g", "bar_b"}) {
    options.properties.push_back(rowProperty(name));
  }
  for (int type = 0; type < 8; ++type) {
    options.properties.push_back(rowProperty("t" + std::to_string(type), ValueType(type)));
  }
  Result<std::unique_ptr<RowWriter>> writer = createPrt(path("b.prt"), options);
  ASSERT_TRUE(writer.ok()) << writer.status().message();
  EXPECT_TRUE((*writer)->notes().empty());
  const std::vector<std::byte> rows = randomRows((*writer)->element(), 20'000);
  writeAll(**writer, rows);

  const auto reader = openOk(openPrt, path("b.prt"));
  ASSERT_NE(reader, nullptr);
  EXPECT_EQ(describeRow(reader->element()), describeRow((*writer)->element()));
  EXPECT_TRUE(readAllRows(*reader) == rows);
  ASSERT_TRUE(reader->rewind().ok());
  expectReaderKeepsContract(*reader);
}

TEST_F(PrtTest, CodedColorsAreWrittenLinear) {
  RowWriterOptions options;
  for (const char* name : {"x", "y", "z"}) options.properties.push_back(rowProperty(name));
  for (const char* name : {"red", "green", "blue"}) {
    options.properties.push_back(rowProperty(name, ValueType::kUint8));
  }
  Result<std::unique_ptr<RowWriter>> writer = createPrt(path("b.prt"), options);
  ASSERT_TRUE(writer.ok()) << writer.status().message();
  EXPECT_EQ((*writer)->notes().size(), 1u);
  std::vector<std::byte> rows(15);
  rows[12] = std::byte{255};
  rows[13] = std::byte{188};
  writeAll(**writer, rows);
  const auto reader = openOk(openPrt, path("b.prt"));
  ASSERT_NE(reader, nullptr);
  const std::vector<std::byte> read = readAllRows(*reader);
  EXPECT_EQ(valueOf(*reader, read, 0, "red"), 1);
  EXPECT_NEAR(valueOf(*reader, read, 0, "green"), 0.503, 1e-3);
  EXPECT_EQ(valueOf(*reader, read, 0, "blue"), 0);
}

TEST_F(PrtTest, WriterNeedsAPositionAndLeavesNothing) {
  RowWriterOptions options;
  options.properties = {rowProperty("radius")};
  EXPECT_EQ(createPrt(path("b.prt"), options).status().code(), StatusCode::kInvalidArgument);
  options.properties = {rowProperty("x"), rowProperty("y"), rowProperty("z"),
                        rowProperty("a_name_that_is_longer_than_31_characters")};
  EXPECT_EQ(createPrt(path("b.prt"), options).status().code(), StatusCode::kInvalidArgument);
  EXPECT_EQ(fileCount(), 0);
}

TEST_F(PrtTest, NoRowsAreAFileToo) {
  RowWriterOptions options;
  for (const char* name : {"x", "y", "z"}) options.properties.push_back(rowProperty(name));
  Result<std::unique_ptr<RowWriter>> writer = createPrt(path("b.prt.gz"), options);
  ASSERT_TRUE(writer.ok()) << writer.status().message();
  ASSERT_TRUE((*writer)->finish().ok());
  const auto reader = openOk(openPrt, path("b.prt.gz"));
  ASSERT_NE(reader, nullptr);
  EXPECT_EQ(reader->element().count, 0u);
  EXPECT_TRUE(readAllRows(*reader).empty());
}

TEST_F(PrtTest, ReadsTheSamples) {
  SURFEIT_SKIP_WITHOUT_PARTICLES();
  const std::string directory = kParticleDirectory;
  const auto lion = openOk(openPrt, directory + "/lion_20k.prt");
  ASSERT_NE(lion, nullptr);
  EXPECT_EQ(lion->element().count, 20'000u);
  EXPECT_EQ(describeRow(lion->element()),
            "float x, float y, float z, float nx, float ny, float nz, float radius, float red, "
            "float green, float blue, int id");
  const std::vector<std::byte> rows = readAllRows(*lion);
  EXPECT_NEAR(valueOf(*lion, rows, 0, "x"), -2.231, 1e-3);
  EXPECT_EQ(valueOf(*lion, rows, 19'999, "id"), 19'999);
  ASSERT_TRUE(lion->rewind().ok());
  expectReaderKeepsContract(*lion);

  const auto fractal = openOk(openPrt, directory + "/thinkbox/prt_fractal_for_krscene.prt");
  ASSERT_NE(fractal, nullptr);
  EXPECT_EQ(fractal->element().count, 312u);
  EXPECT_EQ(readAllRows(*fractal).size(), 312 * fractal->element().row_bytes);
}

// --- PRT 2 ---

std::string chunk(const std::string& name, const std::string& data) {
  return name + littleEndian(std::uint64_t(data.size())) + data;
}
std::string text(const std::string& value) { return char(value.size()) + value; }

std::string prt2Head() {
  return std::string("\xC0PRT2\r\n\x1A", 8) + littleEndian(std::uint32_t{3}) +
         chunk("Chan", "\x02" + text("Position") + text("3 * float32") + "\x0C" + text("Radius") +
                           text("float16") + "\x02");
}

// A stream of `chunks` of `per_chunk` particles; their positions are i, i + 0.25, i + 0.5.
std::string part(const std::string& name, const std::string& compression, int chunks, int per_chunk,
                 std::int64_t count) {
  std::string data =
      text(name) + text(compression) + littleEndian(count) + littleEndian(std::int64_t{chunks});
  for (int c = 0; c < chunks; ++c) {
    std::string records;
    for (int i = c * per_chunk; i < (c + 1) * per_chunk; ++i) {
      records += littleEndian(float(i)) + littleEndian(float(i) + 0.25f) +
                 littleEndian(float(i) + 0.5f) + littleEndian(std::uint16_t{0x4000});
    }
    if (compression.starts_with("transpose")) {
      std::string transposed;
      for (std::size_t place = 0; place < 14; ++place) {
        for (int i = 0; i < per_chunk; ++i) transposed += records[std::size_t(i) * 14 + place];
      }
      records = transposed;
    }
    if (compression.ends_with("zlib")) records = deflated(records);
    data += littleEndian(std::uint32_t(records.size())) + littleEndian(std::uint32_t(per_chunk)) +
            records;
  }
  return chunk("Part", data);
}

TEST_F(PrtTest, ReadsPrt2OfEveryCompression) {
  for (const char* compression : {"uncompressed", "zlib", "transpose", "transpose-zlib"}) {
    write("a.prt", prt2Head() + chunk("Meta", text("Note") + text("string") + text("hello")) +
                       part("", compression, 3, 300, 900) + chunk("Else", "whatever"));
    const auto reader = openOk(openPrt2, path("a.prt"));
    ASSERT_NE(reader, nullptr) << compression;
    EXPECT_EQ(reader->element().count, 900u);
    EXPECT_EQ(describeRow(reader->element()), "float x, float y, float z, float radius");
    EXPECT_EQ(reader->comments(), std::vector<std::string>{"Note: hello"});
    const std::vector<std::byte> rows = readAllRows(*reader);
    EXPECT_EQ(valueOf(*reader, rows, 899, "y"), 899.25) << compression;
    EXPECT_EQ(valueOf(*reader, rows, 300, "radius"), 2) << compression;
    ASSERT_TRUE(reader->rewind().ok());
    expectReaderKeepsContract(*reader);
  }
}

TEST_F(PrtTest, Prt2StreamsAreChosenByName) {
  write("a.prt", prt2Head() + part("preview", "zlib", 1, 2, 2) + part("", "zlib", 1, 5, 5));
  const auto all = openOk(openPrt2, path("a.prt"));
  ASSERT_NE(all, nullptr);
  EXPECT_EQ(all->element().count, 5u);
  EXPECT_EQ(all->notes().size(), 1u);
  RowReaderOptions options;
  options.part = "preview";
  const auto preview = openOk(openPrt2, path("a.prt"), options);
  ASSERT_NE(preview, nullptr);
  EXPECT_EQ(readAllRows(*preview).size(), 2 * 16u);
  options.part = "other";
  EXPECT_EQ(openPrt2(path("a.prt"), options).status().code(), StatusCode::kCorruption);
}

TEST_F(PrtTest, RefusesWhatPrt2DoesNotSay) {
  EXPECT_NE(refusal(openPrt2, prt2Head() + part("", "lz4", 1, 5, 5)).find("lz4"),
            std::string::npos);
  EXPECT_NE(refusal(openPrt2, prt2Head() + chunk("PrtO", "x")).find("PRT 1"), std::string::npos);
  EXPECT_NE(refusal(openPrt2, prt2Head()).find("no particle stream"), std::string::npos);
  EXPECT_NE(refusal(openPrt2, prt2Head() + part("", "zlib", 1, 5, -1)).find("not completed"),
            std::string::npos);
  // More, fewer and far more particles than there are
  EXPECT_NE(refusal(openPrt2, prt2Head() + part("", "zlib", 1, 5, 4)).find("particle chunk"),
            std::string::npos);
  EXPECT_NE(refusal(openPrt2, prt2Head() + part("", "zlib", 1, 5, 6)).find("ends"),
            std::string::npos);
  EXPECT_NE(refusal(openPrt2, prt2Head() + part("", "zlib", 2, 5, 5)).find("more bytes"),
            std::string::npos);
  EXPECT_NE(refusal(openPrt2, prt2Head() + part("", "zlib", 1, 5, 1LL << 60)).find("at most"),
            std::string::npos);
}

TEST_F(PrtTest, MassiveAndNegativePrt2ChunksAreRefusedAtOnce) {
  for (const std::uint64_t length :
       {~std::uint64_t{0}, ~std::uint64_t{7}, std::uint64_t{1} << 63, std::uint64_t{1} << 40}) {
    const std::string header = prt2Head() + "Junk" + littleEndian(length);
    EXPECT_NE(refusal(openPrt2, header + "tail").find("more than the file has"), std::string::npos);
  }
  // A particle chunk that claims to code 4 GiB
  const std::string data = text("") + text("zlib") + littleEndian(std::int64_t{5}) +
                           littleEndian(std::int64_t{1}) + littleEndian(~std::uint32_t{0}) +
                           littleEndian(~std::uint32_t{0});
  EXPECT_NE(refusal(openPrt2, prt2Head() + chunk("Part", data + std::string(100, 'x')))
                .find("particle chunk of"),
            std::string::npos);
}

TEST_F(PrtTest, EveryTruncationOfPrt2IsRefused) {
  const std::string file = prt2Head() + part("", "transpose-zlib", 2, 3, 6);
  expectEveryTruncationFails(openPrt2, file, file.size());
  expectDamageIsHarmless(openPrt2, file);
}

TEST_F(PrtTest, ReadsThePrt2Samples) {
  SURFEIT_SKIP_WITHOUT_PARTICLES();
  const std::string directory = std::string(kParticleDirectory) + "/thinkbox/";
  const auto normals = openOk(openPrt2, directory + "wnormals.prt");
  ASSERT_NE(normals, nullptr);
  EXPECT_EQ(describeRow(normals->element()),
            "float x, float y, float z, float red, float green, float blue, float nx, float ny, "
            "float nz, float intensity");
  const std::vector<std::byte> rows = readAllRows(*normals);
  EXPECT_EQ(normals->element().count, 10u);
  EXPECT_FLOAT_EQ(float(valueOf(*normals, rows, 2, "y")), 3.1f);
  EXPECT_FLOAT_EQ(float(valueOf(*normals, rows, 2, "blue")), 0.8f);
  EXPECT_EQ(valueOf(*normals, rows, 2, "nz"), 1);
  EXPECT_EQ(valueOf(*normals, rows, 2, "intensity"), 3);

  const auto doubles = openOk(openPrt2, directory + "doubleFloat.prt");
  ASSERT_NE(doubles, nullptr);
  const std::vector<std::byte> wide = readAllRows(*doubles);
  EXPECT_EQ(valueOf(*doubles, wide, 0, "y"), 110000000000000.03);
  for (const char* name : {"intColor.prt", "loadSingleScan.prt"}) {
    const auto reader = openOk(openPrt2, directory + name);
    ASSERT_NE(reader, nullptr) << name;
    expectReaderKeepsContract(*reader);
  }
}

}  // namespace
}  // namespace surfeit
