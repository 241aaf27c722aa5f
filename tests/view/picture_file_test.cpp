#include "view/picture_file.h"

#include <OpenEXR/ImfChannelList.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <png.h>

#include <cmath>
#include <cstring>
#include <filesystem>
#include <span>

#include "view/read_exr.h"

namespace surfeit {
namespace {

Picture testPicture() {
  Picture picture;
  picture.width = 3;
  picture.height = 2;
  picture.pixels.resize(6);
  picture.pixels[0] = {glm::vec3(0.5f, 0, 1), 1, 7};
  picture.pixels[1] = {glm::vec3(0.25f), 0.5f, 8};  // half covered by 0.5
  picture.pixels[2] = {glm::vec3(2, -1, 1e9f), 1, 9};
  return picture;
}

std::vector<int> decodePng(std::span<const std::byte> file) {
  png_image image;
  std::memset(&image, 0, sizeof(image));
  image.version = PNG_IMAGE_VERSION;
  EXPECT_NE(png_image_begin_read_from_memory(&image, file.data(), file.size()), 0);
  EXPECT_EQ(image.width, 3u);
  EXPECT_EQ(image.height, 2u);
  image.format = PNG_FORMAT_RGB;
  std::vector<png_byte> pixels(PNG_IMAGE_SIZE(image));
  EXPECT_NE(png_image_finish_read(&image, nullptr, pixels.data(), 0, nullptr), 0);
  return {pixels.begin(), pixels.end()};
}

TEST(PictureFile, PngHoldsSrgbOverTheBackground) {
  PngOptions options;
  options.background = {0.2f, 0.4f, 0.6f};
  const Result<std::vector<std::byte>> file = encodePng(testPicture(), options);
  ASSERT_TRUE(file.ok()) << file.status().message();
  const std::vector<int> pixels = decodePng(*file);
  EXPECT_EQ(pixels[0], 188);
  EXPECT_EQ(pixels[1], 0);
  EXPECT_EQ(pixels[2], 255);
  EXPECT_NEAR(pixels[3], 141, 1);  // 0.25 + 0.5 * linear(0.2), back on the curve
  EXPECT_EQ(pixels[6], 255);       // clamped
  EXPECT_EQ(pixels[7], 0);
  EXPECT_EQ(pixels[8], 255);
  EXPECT_EQ(pixels[9], 51);  // background alone comes back as given
  EXPECT_EQ(pixels[10], 102);
  EXPECT_EQ(pixels[11], 153);
}

TEST(PictureFile, ExposureCountsInStops) {
  PngOptions options;
  options.exposure = -1;
  const Result<std::vector<std::byte>> file = encodePng(testPicture(), options);
  ASSERT_TRUE(file.ok());
  EXPECT_EQ(decodePng(*file)[2], 188);
}

TEST(PictureFile, DataIsWrittenWithoutCurveOrExposure) {
  PngOptions options;
  options.is_data = true;
  options.exposure = 3;
  const Result<std::vector<std::byte>> file = encodePng(testPicture(), options);
  ASSERT_TRUE(file.ok());
  EXPECT_EQ(decodePng(*file)[0], 128);
}

TEST(PictureFile, ExrKeepsLinearValuesAlphaAndDepth) {
  const std::string path =
      (std::filesystem::path(testing::TempDir()) / "surfeit_picture_test.exr").string();
  ASSERT_TRUE(writePicture(path, testPicture(), {}).ok());
  Imf::InputFile file(path.c_str(), 0);
  EXPECT_EQ(file.header().channels().findChannel("R")->type, Imf::HALF);
  EXPECT_EQ(file.header().channels().findChannel("Z")->type, Imf::FLOAT);
  const ExrPicture picture = readExr(path);
  EXPECT_EQ(picture.width, 3);
  EXPECT_EQ(picture.height, 2);
  EXPECT_EQ(picture.r[0], 0.5f);
  EXPECT_EQ(picture.r[2], 2.0f);
  EXPECT_EQ(picture.g[2], -1.0f);
  EXPECT_EQ(picture.b[2], 65504.0f);  // the largest half
  EXPECT_EQ(picture.a[1], 0.5f);
  EXPECT_EQ(picture.a[5], 0.0f);
  EXPECT_EQ(picture.z[0], 7.0f);
  EXPECT_TRUE(std::isinf(picture.z[5]));
  std::filesystem::remove(path);
}

TEST(PictureFile, NameTellsTheFormat) {
  EXPECT_EQ(*pictureFormat("a/b.png"), PictureFormat::kPng);
  EXPECT_EQ(*pictureFormat("A.EXR"), PictureFormat::kExr);
  EXPECT_EQ(pictureFormat("a.jpeg").status().code(), StatusCode::kInvalidArgument);
  EXPECT_EQ(pictureFormat("png").status().code(), StatusCode::kInvalidArgument);
}

TEST(PictureFile, UnwritableFolderIsAnIoError) {
  EXPECT_EQ(writePicture("/no/such/folder/a.png", testPicture(), {}).code(), StatusCode::kIoError);
}

}  // namespace
}  // namespace surfeit
