#include <gtest/gtest.h>

#include <algorithm>
#include <cstring>

#include "cloud/houdini/bgeo_reader.h"
#include "cloud/particles/pdb_reader.h"
#include "cloud/particles/pdb_writer.h"
#include "cloud/particles/prt_reader.h"
#include "io/row_damage_test.h"

namespace surfeit {
namespace {

template <typename T>
std::string inOrder(T value, bool is_swapped = false) {
  std::string bytes(reinterpret_cast<const char*>(&value), sizeof value);
  if (is_swapped) std::reverse(bytes.begin(), bytes.end());
  return bytes;
}

struct PdbFile {
  bool is_swapped = false;
  std::uint32_t particles = 3;
  std::uint32_t attributes = 0;
  std::string body;

  std::string word(std::uint32_t value) const { return inOrder(value, is_swapped); }

  void add(const std::string& name, std::uint32_t type, std::uint32_t bytes,
           const std::string& values, std::uint32_t block_rows = 3, std::uint32_t blocks = 1) {
    ++attributes;
    body += inOrder(std::uint16_t{0xF663}, is_swapped) + inOrder(std::uint16_t{1}, is_swapped) +
            std::string(6, '\0') + word(type) + std::string(8, '\0') + word(particles - 1) +
            std::string(16, '\0') + name + '\0' + word(type) + word(bytes) + word(block_rows) +
            word(blocks) + word(0) + values;
  }
  std::string floats(int count, float first) const {
    std::string text;
    for (int i = 0; i < count; ++i) text += inOrder(first + float(i), is_swapped);
    return text;
  }
  std::string file() const {
    return word(670) + inOrder(std::uint16_t{1}, is_swapped) + std::string(2, '\0') +
           inOrder(1.0f, is_swapped) + inOrder(0.0f) + word(particles) + word(attributes) +
           std::string(36, '\0') + body;
  }
};

PdbFile sample(bool is_swapped = false) {
  PdbFile pdb;
  pdb.is_swapped = is_swapped;
  pdb.add("position", 1, 12, pdb.floats(9, 0));
  pdb.add("life", 2, 8, pdb.floats(6, 50));
  pdb.add("id", 3, 4, pdb.word(7) + pdb.word(8) + pdb.word(9));
  return pdb;
}

class PdbTest : public RowFileTest {};

TEST_F(PdbTest, ReadsBothByteOrders) {
  for (const bool is_swapped : {false, true}) {
    write("a.pdb", sample(is_swapped).file());
    EXPECT_TRUE(recognisesPdb(contents("a.pdb")));
    const auto reader = openOk(openPdb, path("a.pdb"));
    ASSERT_NE(reader, nullptr);
    EXPECT_EQ(describeRow(reader->element()),
              "float x, float y, float z, float life_0, float life_1, int id");
    const std::vector<std::byte> rows = readAllRows(*reader);
    EXPECT_EQ(valueOf(*reader, rows, 2, "z"), 8);
    EXPECT_EQ(valueOf(*reader, rows, 1, "life_1"), 53);
    EXPECT_EQ(valueOf(*reader, rows, 2, "id"), 9);
    ASSERT_TRUE(reader->rewind().ok());
    expectReaderKeepsContract(*reader);
  }
}

TEST_F(PdbTest, DroppedAttributesAreSteppedOver) {
  write("a.pdb", sample().file());
  RowReaderOptions options;
  options.channels = {{"life", "-"}};
  const auto reader = openOk(openPdb, path("a.pdb"), options);
  ASSERT_NE(reader, nullptr);
  EXPECT_EQ(describeRow(reader->element()), "float x, float y, float z, int id");
  EXPECT_EQ(valueOf(*reader, readAllRows(*reader), 2, "id"), 9);
}

TEST_F(PdbTest, RefusesWhatItDoesNotKnow) {
  PdbFile pdb = sample();
  pdb.add("text", 4, 4, std::string(12, 'x'));
  EXPECT_NE(refusal(openPdb, pdb.file()).find("type 4"), std::string::npos);
  pdb = sample();
  pdb.add("odd", 2, 6, std::string(18, 'x'));
  EXPECT_NE(refusal(openPdb, pdb.file()).find("6 bytes"), std::string::npos);
  pdb = sample();
  pdb.add("blocks", 2, 4, std::string(12, 'x'), 1, 3);
  EXPECT_NE(refusal(openPdb, pdb.file()).find("3 blocks"), std::string::npos);
  pdb = sample();
  pdb.attributes = 4'000'000'000;
  EXPECT_NE(refusal(openPdb, pdb.file()).find("4000000000 attributes"), std::string::npos);
  pdb = PdbFile();
  pdb.particles = 4'000'000'000;
  pdb.add("position", 1, 12, "", 4'000'000'000);
  EXPECT_NE(refusal(openPdb, pdb.file()).find("ends early"), std::string::npos);
  pdb = PdbFile();
  pdb.add(std::string(300, 'n'), 1, 12, pdb.floats(9, 0));
  EXPECT_NE(refusal(openPdb, pdb.file()).find("name"), std::string::npos);
}

TEST_F(PdbTest, EveryTruncationIsRefused) {
  const std::string file = sample().file();
  expectEveryTruncationFails(openPdb, file, file.size());
  expectDamageIsHarmless(openPdb, file);
}

TEST_F(PdbTest, WrittenFilesAreReadBack) {
  RowWriterOptions options;
  for (const char* name :
       {"x", "y", "z", "radius", "red", "green", "blue", "foo_r", "foo_g", "foo_b", "foo_x"}) {
    options.properties.push_back(rowProperty(name));
  }
  options.properties.push_back(rowProperty("id", ValueType::kInt32));
  for (const char* file : {"b.pdb", "b.pdb.gz"}) {
    // More rows than a block of the temporary file has
    Result<std::unique_ptr<RowWriter>> writer = createPdb(path(file), options);
    ASSERT_TRUE(writer.ok()) << writer.status().message();
    const std::vector<std::byte> rows = randomRows((*writer)->element(), 40'000);
    writeAll(**writer, rows);
    const auto reader = openOk(openPdb, path(file));
    ASSERT_NE(reader, nullptr);
    EXPECT_EQ(describeRow(reader->element()), describeRow((*writer)->element()));
    EXPECT_TRUE(readAllRows(*reader) == rows);
  }
}

TEST_F(PdbTest, WriterNeedsAPosition) {
  RowWriterOptions options;
  options.properties = {rowProperty("radius")};
  EXPECT_EQ(createPdb(path("b.pdb"), options).status().code(), StatusCode::kInvalidArgument);
  EXPECT_EQ(fileCount(), 0);
}

TEST_F(PdbTest, LionIsTheSameInAllFormatsAndIsWrittenByteForByte) {
  SURFEIT_SKIP_WITHOUT_PARTICLES();
  const std::string lion = std::string(kParticleDirectory) + "/lion_20k.";
  const auto pdb = openOk(openPdb, lion + "pdb");
  const auto prt = openOk(openPrt, lion + "prt");
  const auto bgeo = openOk(openBgeo, lion + "bgeo");
  ASSERT_TRUE(pdb && prt && bgeo);
  EXPECT_EQ(describeRow(pdb->element()), describeRow(prt->element()));
  EXPECT_EQ(describeRow(pdb->element()), describeRow(bgeo->element()));
  const std::vector<std::byte> rows = readAllRows(*pdb);
  EXPECT_TRUE(readAllRows(*prt) == rows);
  EXPECT_TRUE(readAllRows(*bgeo) == rows);

  RowWriterOptions options;
  options.properties = pdb->element().properties;
  Result<std::unique_ptr<RowWriter>> writer = createPdb(path("lion.pdb"), options);
  ASSERT_TRUE(writer.ok()) << writer.status().message();
  writeAll(**writer, rows);
  std::ifstream original(lion + "pdb", std::ios::binary);
  EXPECT_TRUE(contents("lion.pdb") == std::string(std::istreambuf_iterator<char>(original), {}));
}

TEST_F(PdbTest, ReadsTheFileOfMaya) {
  SURFEIT_SKIP_WITHOUT_PARTICLES();
  const auto reader = openOk(openPdb, std::string(kParticleDirectory) + "/partio/test.pdb");
  ASSERT_NE(reader, nullptr);
  EXPECT_EQ(reader->element().count, 13u);
  const std::vector<std::byte> rows = readAllRows(*reader);
  EXPECT_EQ(valueOf(*reader, rows, 12, "radius"), 1);
  EXPECT_EQ(valueOf(*reader, rows, 7, "id"), 8);
  EXPECT_FLOAT_EQ(float(valueOf(*reader, rows, 0, "life_0")), 2.375f);
  ASSERT_TRUE(reader->rewind().ok());
  expectReaderKeepsContract(*reader);
}

}  // namespace
}  // namespace surfeit
