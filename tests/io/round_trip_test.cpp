// What every format that is written keeps of a cloud, there and back.

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <map>
#include <string>
#include <vector>

#include "cloud/cloud_formats.h"
#include "cloud/rows/channels.h"
#include "io/convert_tables.h"
#include "io/exr_test_picture.h"

namespace surfeit {
namespace {

using testing::HasSubstr;

// By channel, values of all components ordered by id, colors scene-linear.
std::map<std::string, std::vector<double>> channelValues(const std::string& path) {
  std::map<std::string, std::vector<double>> values;
  Result<std::unique_ptr<RowReader>> reader = openRowReader(path);
  EXPECT_TRUE(reader.ok()) << reader.status().message();
  if (!reader.ok()) return values;
  const RowLayout element = (*reader)->element();
  const std::vector<std::byte> bytes = readAllRows(**reader);
  const RowProperty* const id = element.find("id");
  EXPECT_NE(id, nullptr);
  if (id == nullptr) return values;
  std::vector<const std::byte*> rows;
  for (std::size_t at = 0; at < bytes.size(); at += element.row_bytes) rows.push_back(&bytes[at]);
  std::sort(rows.begin(), rows.end(), [&](const std::byte* a, const std::byte* b) {
    return rowValue(a + id->offset, id->type) < rowValue(b + id->offset, id->type);
  });
  for (const RowChannel& channel : channelsOf(element)) {
    std::vector<double>& column = values[channel.name];
    for (const std::byte* const row : rows) {
      for (std::size_t c = 0; c < channel.properties.size(); ++c) {
        column.push_back(channelValue(element, channel, c, row));
      }
    }
  }
  return values;
}

// The largest error that a format may make in a channel, of values up to 50.
double allowedError(const std::string& extension, const std::string& channel) {
  const bool is_exact = extension == ".ply" || extension.starts_with(".xyz") ||
                        extension == ".txt" || extension == ".asc" || extension == ".csv";
  if (is_exact) return 0;
  if (channel == "color") return 6e-8;                           // sRGB bytes as linear floats
  if (extension == ".ptc" && channel == "normal") return 0.006;  // codes of 16 bits
  if (extension == ".vdb" && channel == "position") return 1e-5;
  if (extension == ".las" && channel == "position") return 6e-7;  // steps of 1e-6
  const bool keeps_doubles = extension == ".prt" || extension == ".vdb" || extension == ".las";
  if (channel == "weight" && !keeps_doubles) return 1.2e-7;
  return 0;
}

class RoundTripTest : public ConvertTest {
 protected:
  void SetUp() override {
    ConvertTest::SetUp();
    writeTable("in.ply", fullTable());
    before_ = channelValues(path("in.ply"));
    // What the picture needs of the one that its pixels came from
    ExrTestPart part;
    part.window = Imath::Box2i({0, 0}, {kWidth - 1, kHeight - 1});
    for (const char* channel : {"P.X", "P.Y", "P.Z"}) {
      part.add(channel, [](int x, int y) { return 1 + x + y; });
    }
    writeExrTest(path("like.exr"), {part});
  }

  // To the format and back: all channels are there, as exact as it may be expected.
  void expectRoundTrip(const std::string& extension, const std::string& compression) {
    SCOPED_TRACE(extension + compression);
    ConvertOptions options;
    if (extension == ".exr") options.like = path("like.exr");
    const std::string name = "there" + extension + compression;
    const ConvertStats stats = convertOk({"in.ply"}, name, options);
    EXPECT_EQ(stats.written_records, std::uint64_t{kWidth * kHeight});
    convertOk({name}, "back.ply");
    const auto after = channelValues(path("back.ply"));
    std::printf("%-10s", (extension + compression).c_str());
    for (const auto& [channel, values] : before_) {
      ASSERT_TRUE(after.contains(channel)) << channel;
      const std::vector<double>& found = after.at(channel);
      ASSERT_EQ(found.size(), values.size()) << channel;
      double error = 0;
      for (std::size_t i = 0; i < values.size(); ++i) {
        error = std::max(error, std::abs(found[i] - values[i]));
      }
      EXPECT_LE(error, allowedError(extension, channel)) << channel;
      if (error > 0) std::printf("  %s %.2g", channel.c_str(), error);
    }
    std::printf("\n");
  }

  std::map<std::string, std::vector<double>> before_;
};

TEST_F(RoundTripTest, EveryFormatKeepsEveryChannel) {
  std::printf("largest errors of %d points, where there are any:\n", kWidth * kHeight);
  int formats = 0;
  for (const CloudFormat& format : cloudFormats()) {
    if (format.create == nullptr) continue;
    ++formats;
    std::string extensions(format.extensions);
    while (!extensions.empty()) {
      const std::string extension = extensions.substr(0, extensions.find(' '));
      extensions.erase(0, extension.size() + 1);
      expectRoundTrip(extension, "");
      // OpenVDB and OpenEXR are compressed inside
      if (extension == ".vdb" || extension == ".exr") continue;
      expectRoundTrip(extension, ".gz");
      expectRoundTrip(extension, ".zst");
    }
  }
  EXPECT_GE(formats, 8);
}

TEST_F(RoundTripTest, PicturesKeepTheirWindows) {
  convertOk({"like.exr"}, "copy.exr");
  for (const char* name : {"x", "y", "z", "pixel_x", "pixel_y"}) {
    EXPECT_EQ(column(readTable("copy.exr"), name), column(readTable("like.exr"), name));
  }
  ConvertOptions moved;
  moved.transform[3] = 1;
  EXPECT_THAT(refusal("like.exr", moved, "moved.exr").message(), HasSubstr("needs the windows"));
  moved.like = path("like.exr");
  convertOk({"like.exr"}, "moved.exr", moved);
  EXPECT_EQ(column(readTable("moved.exr"), "x")[0], 2);
}

}  // namespace
}  // namespace surfeit
