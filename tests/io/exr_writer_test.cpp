#include "cloud/exr/exr_writer.h"

#include <OpenEXR/ImfFloatAttribute.h>
#include <OpenEXR/ImfStandardAttributes.h>
#include <OpenEXR/ImfStringAttribute.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <memory>
#include <string>
#include <vector>

#include "cloud/exr/exr_image_writer.h"
#include "cloud/exr/exr_reader.h"
#include "io/exr_test_picture.h"
#include "io/test_directory.h"

namespace surfeit {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;
using testing::UnorderedElementsAre;

class ExrWriterTest : public DirectoryTest {
 protected:
  // Receivers with an offset window, a mask, and what a result keeps.
  void writePasses() const {
    ExrTestPart part = floorPasses(Imath::Box2i({10, -4}, {15, -1}));
    part.add("A", [](int x, int y) { return x == 2 || y == 1 ? 0 : 1; });
    part.add("Z", [](int x, int y) { return 5 + x + y; });
    part.add(
        "id", [](int x, int y) { return 4000000000.0 + 256.0 * (10 * y + x); }, Imf::UINT);
    for (const char* name : {"albedo.R", "albedo.G", "albedo.B"}) {
      part.add(
          name, [](int x, int) { return 0.125 * x; }, Imf::HALF);
    }
    part.name = "main";
    writeExrTest(path("passes.exr"), {part}, [](Imf::Header& header) {
      Imath::M44f matrix;
      matrix[3][2] = 7;
      Imf::addWorldToCamera(header, matrix);
      header.pixelAspectRatio() = 2;
      header.insert("myShutter", Imf::FloatAttribute(0.25f));
    });
  }

  std::unique_ptr<RowReader> openPasses() const {
    auto reader = openExr(path("passes.exr"), {});
    EXPECT_TRUE(reader.ok()) << reader.status().message();
    return reader.ok() ? std::move(*reader) : nullptr;
  }

  // What the gather does: all properties of the rows and some results.
  Status writeResult(RowReader& reader, const std::vector<std::string>& results, std::size_t batch,
                     const std::string& name = "result.exr") const {
    RowWriterOptions options;
    options.properties = reader.element().properties;
    for (const std::string& result : results) {
      RowProperty property;
      property.name = result;
      options.properties.push_back(property);
    }
    options.like = &reader;
    SURFEIT_ASSIGN_OR_RETURN(const auto writer, createExr(path(name), options));
    AlignedBuffer buffer;
    std::uint64_t index = 0;
    while (true) {
      SURFEIT_ASSIGN_OR_RETURN(const Bytes rows, reader.readRows(batch, buffer));
      if (rows.empty()) break;
      std::vector<std::byte> out;
      const std::size_t row_bytes = reader.element().row_bytes;
      for (std::size_t at = 0; at < rows.size(); at += row_bytes, ++index) {
        out.insert(out.end(), rows.begin() + std::ptrdiff_t(at),
                   rows.begin() + std::ptrdiff_t(at + row_bytes));
        for (std::size_t i = 0; i < results.size(); ++i) {
          const float value = float(index) + 100.0f * float(i);
          const auto* const bytes = reinterpret_cast<const std::byte*>(&value);
          out.insert(out.end(), bytes, bytes + sizeof(value));
        }
      }
      SURFEIT_RETURN_IF_ERROR(writer->writeRows(out));
    }
    return writer->finish();
  }
};

std::vector<std::string> channelNames(const std::string& path) {
  const Imf::InputFile file(path.c_str(), 0);
  std::vector<std::string> names;
  const Imf::ChannelList& channels = file.header().channels();
  for (auto i = channels.begin(); i != channels.end(); ++i) names.push_back(i.name());
  return names;
}

const std::vector<std::string> kIrradiance = {"irradiance_r", "irradiance_g", "irradiance_b",
                                              "occlusion"};

TEST_F(ExrWriterTest, ResultHasTheWindowsAndAttributesOfTheReceivers) {
  writePasses();
  const auto reader = openPasses();
  const Status status = writeResult(*reader, kIrradiance, 3);
  ASSERT_TRUE(status.ok()) << status.message();
  const Imf::InputFile file(path("result.exr").c_str(), 0);
  const Imf::Header& header = file.header();
  EXPECT_EQ(header.dataWindow(), Imath::Box2i({10, -4}, {15, -1}));
  EXPECT_EQ(header.displayWindow(), Imath::Box2i({-2, -3}, {40, 30}));
  EXPECT_EQ(header.pixelAspectRatio(), 2);
  EXPECT_EQ(Imf::worldToCamera(header)[3][2], 7);
  EXPECT_EQ(header.typedAttribute<Imf::FloatAttribute>("myShutter").value(), 0.25f);
  EXPECT_EQ(header.typedAttribute<Imf::StringAttribute>(kExrMainLayerAttribute).value(),
            "irradiance");
  EXPECT_FALSE(header.hasName());
  EXPECT_EQ(header.compression(), Imf::ZIP_COMPRESSION);
  EXPECT_THAT(channelNames(path("result.exr")),
              UnorderedElementsAre("P.X", "P.Y", "P.Z", "N.X", "N.Y", "N.Z", "A", "Z", "id",
                                   "albedo.R", "albedo.G", "albedo.B", "irradiance.R",
                                   "irradiance.G", "irradiance.B", "occlusion", "R", "G", "B"));
  EXPECT_EQ(header.channels().findChannel("albedo.G")->type, Imf::HALF);
  EXPECT_EQ(header.channels().findChannel("id")->type, Imf::UINT);
  EXPECT_EQ(header.channels().findChannel("P.X")->type, Imf::FLOAT);
  EXPECT_EQ(header.channels().findChannel("R")->type, Imf::HALF);
}

TEST_F(ExrWriterTest, PixelsWithoutARowAreEmpty) {
  writePasses();
  const auto reader = openPasses();
  ASSERT_TRUE(writeResult(*reader, kIrradiance, 4).ok());
  const std::vector<float> irradiance = readExrTest(path("result.exr"), "irradiance.G");
  const std::vector<float> alpha = readExrTest(path("result.exr"), "A");
  const std::vector<float> depth = readExrTest(path("result.exr"), "Z");
  const std::vector<float> green = readExrTest(path("result.exr"), "G");
  float index = 0;
  for (std::size_t i = 0; i < irradiance.size(); ++i) {
    const bool is_row = i % 6 != 2 && i / 6 != 1;
    EXPECT_EQ(alpha[i], is_row ? 1 : 0) << i;
    EXPECT_EQ(irradiance[i], is_row ? 100 + index : 0) << i;
    EXPECT_EQ(green[i], irradiance[i]) << i;
    EXPECT_EQ(std::isinf(depth[i]), !is_row) << i;
    index += is_row ? 1 : 0;
  }
  EXPECT_EQ(index, 15);
}

TEST_F(ExrWriterTest, ResultsAreReadBackAsTheyWere) {
  writePasses();
  const auto reader = openPasses();
  ASSERT_TRUE(writeResult(*reader, {}, 100).ok());
  const auto again = openExr(path("result.exr"), {});
  ASSERT_TRUE(again.ok()) << again.status().message();
  ASSERT_TRUE(reader->rewind().ok());
  ASSERT_EQ((*again)->element().count, reader->element().count);
  AlignedBuffer first_buffer, second_buffer;
  const Bytes first = *reader->readRows(100, first_buffer);
  const Bytes second = *(*again)->readRows(100, second_buffer);
  for (std::uint64_t row = 0; row < reader->element().count; ++row) {
    for (const RowProperty& property : reader->element().properties) {
      const RowProperty* const found = (*again)->element().find(property.name);
      ASSERT_NE(found, nullptr) << property.name;
      EXPECT_EQ(found->type, property.type);
      EXPECT_EQ(
          rowValue(&first[row * reader->element().row_bytes + property.offset], property.type),
          rowValue(&second[row * (*again)->element().row_bytes + found->offset], found->type))
          << property.name << " of row " << row;
    }
  }
}

TEST_F(ExrWriterTest, BatchesDoNotChangeTheBytes) {
  writePasses();
  const auto reader = openPasses();
  ASSERT_TRUE(writeResult(*reader, kIrradiance, 1, "one.exr").ok());
  for (const std::size_t batch : {2u, 5u, 100u}) {
    ASSERT_TRUE(reader->rewind().ok());
    ASSERT_TRUE(writeResult(*reader, kIrradiance, batch, "other.exr").ok());
    EXPECT_EQ(contents("one.exr"), contents("other.exr")) << batch;
  }
}

TEST_F(ExrWriterTest, PicturesThatHaveAColorKeepIt) {
  ExrTestPart part = floorPasses();
  for (const char* name : {"R", "G", "B"}) part.add(name, [](int x, int) { return x; });
  writeExrTest(path("passes.exr"), {part});
  const auto reader = openPasses();
  ASSERT_TRUE(writeResult(*reader, kIrradiance, 100).ok());
  const Imf::InputFile file(path("result.exr").c_str(), 0);
  EXPECT_EQ(file.header().findTypedAttribute<Imf::StringAttribute>(kExrMainLayerAttribute),
            nullptr);
  EXPECT_EQ(readExrTest(path("result.exr"), "R")[5], 5);
  EXPECT_EQ(readExrTest(path("result.exr"), "A")[5], 1);  // which the passes do not have
}

TEST_F(ExrWriterTest, SaysWhatItNeeds) {
  writePasses();
  const auto reader = openPasses();
  RowWriterOptions options;
  options.properties = reader->element().properties;
  EXPECT_EQ(createExr(path("a.exr"), options).status().code(), StatusCode::kInvalidArgument);
  EXPECT_THAT(createExr(path("a.exr"), options).status().message(),
              HasSubstr("write .exr from OpenEXR receivers"));
  options.like = reader.get();
  EXPECT_THAT(createExr(path("a.exr.gz"), options).status().message(),
              HasSubstr("OpenEXR is compressed inside"));
  options.properties.resize(3);
  EXPECT_THAT(createExr(path("a.exr"), options).status().message(),
              HasSubstr("without pixel_x and pixel_y"));
  options.properties = reader->element().properties;
  EXPECT_EQ(createExr("/no/such/folder/a.exr", options).status().code(), StatusCode::kIoError);
  EXPECT_EQ(fileCount(), 1);
}

TEST_F(ExrWriterTest, RowsOutOfOrderOrOutsideAreRefused) {
  writePasses();
  const auto reader = openPasses();
  RowWriterOptions options;
  for (const char* name : {"pixel_x", "pixel_y"}) {
    RowProperty property;
    property.name = name;
    property.type = ValueType::kInt32;
    options.properties.push_back(property);
  }
  options.like = reader.get();
  const auto statusOf = [&](const std::vector<std::int32_t>& pixels) {
    const auto writer = createExr(path("a.exr"), options);
    EXPECT_TRUE(writer.ok());
    SURFEIT_RETURN_IF_ERROR((*writer)->writeRows(std::as_bytes(std::span(pixels))));
    return (*writer)->finish();
  };
  EXPECT_TRUE(statusOf({10, -4, 15, -4, 10, -1}).ok());
  std::filesystem::remove(path("a.exr"));
  for (const std::vector<std::int32_t>& pixels :
       std::vector<std::vector<std::int32_t>>{{11, -4, 10, -4},
                                              {11, -4, 11, -4},
                                              {10, -3, 10, -4},
                                              {16, -4},
                                              {9, -4},
                                              {10, 0},
                                              {10, -5}}) {
    const Status status = statusOf(pixels);
    EXPECT_EQ(status.code(), StatusCode::kInvalidArgument);
    EXPECT_THAT(status.message(), HasSubstr("the data window 10 -4 to 15 -1"));
    EXPECT_EQ(fileCount(), 1);
  }
}

TEST_F(ExrWriterTest, UnfinishedPicturesLeaveNothing) {
  writePasses();
  const auto reader = openPasses();
  RowWriterOptions options;
  options.properties = reader->element().properties;
  options.like = reader.get();
  { ASSERT_TRUE(createExr(path("a.exr"), options).ok()); }
  EXPECT_EQ(fileCount(), 1);
}

TEST_F(ExrWriterTest, ChannelsMustDiffer) {
  const Imf::Header header(4, 4);
  EXPECT_EQ(ExrImageWriter::create(path("a.exr"), header, {{"A"}, {"A"}}).status().code(),
            StatusCode::kInvalidArgument);
  EXPECT_EQ(ExrImageWriter::create(path("a.exr"), header, {{""}}).status().code(),
            StatusCode::kInvalidArgument);
}

}  // namespace
}  // namespace surfeit
