#include "sample/meshes/texture.h"

#include <cmath>

#include "sample/scene_files.h"

namespace surfeit {
namespace {

TEST(Srgb, KnownValues) {
  EXPECT_EQ(linearFromSrgb8(0), 0);
  EXPECT_FLOAT_EQ(linearFromSrgb8(255), 1);
  EXPECT_NEAR(linearFromSrgb8(128), 0.2158605f, 1e-6f);
  EXPECT_NEAR(linearFromSrgb8(10), 10 / 255.0f / 12.92f, 1e-7f);
}

TEST(Texture, TexelCentresGiveTexelsWithTheOriginAtTheBottomLeft) {
  // Top row red, green; bottom row blue, white
  const Texture texture(2, 2, {255, 0, 0, 0, 255, 0, 0, 0, 255, 255, 255, 255});
  EXPECT_EQ(texture.lookup({0.25f, 0.75f}), glm::vec3(1, 0, 0));
  EXPECT_EQ(texture.lookup({0.75f, 0.75f}), glm::vec3(0, 1, 0));
  EXPECT_EQ(texture.lookup({0.25f, 0.25f}), glm::vec3(0, 0, 1));
  EXPECT_EQ(texture.lookup({0.75f, 0.25f}), glm::vec3(1, 1, 1));
}

TEST(Texture, BlendsInLinearLightAndRepeats) {
  const Texture texture(2, 1, {0, 0, 0, 255, 255, 255});
  EXPECT_NEAR(texture.lookup({0.5f, 0.5f}).x, 0.5f, 1e-6f);
  EXPECT_NEAR(texture.lookup({0.0f, 0.5f}).x, 0.5f, 1e-6f);  // between the last and the first
  EXPECT_NEAR(texture.lookup({-3.25f, 7.5f}).x, 1, 1e-6f);
  EXPECT_TRUE(std::isfinite(texture.lookup({1e30f, -1e30f}).x));
  EXPECT_TRUE(std::isfinite(texture.lookup({NAN, INFINITY}).x));
}

using TextureFiles = SceneFiles;

TEST_F(TextureFiles, MissingIsAnIoErrorAndGarbageIsCorruption) {
  EXPECT_EQ(Texture::load(path("none.png")).status().code(), StatusCode::kIoError);
  const Result<Texture> garbage = Texture::load(write("garbage.png", "not a picture"));
  EXPECT_EQ(garbage.status().code(), StatusCode::kCorruption);
  EXPECT_NE(garbage.status().message().find("garbage.png"), std::string::npos);
}

TEST_F(TextureFiles, PicturesOfOtherFormatsAreNamed) {
  using namespace std::string_literals;
  struct Case {
    std::string begin;
    std::string said;
  };
  const std::string convert = ", expected PNG, JPEG, TGA or BMP: convert it to PNG of 8 bits";
  const std::vector<Case> cases = {
      {"RIFF\x40\0\0\0WEBPVP8 "s, "found WebP" + convert},
      {"II*\0\x08\0\0\0"s, "found TIFF" + convert},
      {"MM\0*\0\0\0\x08"s, "found TIFF" + convert},
      {"\x76\x2f\x31\x01\x02\0\0\0"s, "found OpenEXR"},
      {"\0\0\0\x1c"s + "ftypavif"s, "found AVIF" + convert},
      {"DDS \x7c\0\0\0"s, "found DDS" + convert},
      {"\0\0\0\x0cjP  \r\n"s, "found JPEG 2000" + convert},
      {"version https://git-lfs.github.com/spec/v1\n"s,
       "found a pointer of Git LFS, expected PNG, JPEG, TGA or BMP: fetch"},
      {"RIFF\x40\0\0\0WAVEfmt "s, "not a picture"},
      {"II"s, "not a picture"},
      {""s, "not a picture"},
  };
  for (const Case& of : cases) {
    // The name says nothing
    const std::string file =
        write("t.png", of.begin.empty() ? "" : of.begin + std::string(64, 'x'));
    for (const Status& status : {Texture::load(file).status(), Mask::load(file).status()}) {
      EXPECT_EQ(status.code(), StatusCode::kCorruption);
      EXPECT_NE(status.message().find("t.png: " + of.said), std::string::npos)
          << status.message() << ", expected " << of.said;
    }
  }
}

TEST_F(TextureFiles, LightWithoutALimitIsRefusedWithTheWayOut) {
  const std::string picture =
      "#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 1 +X 1\n" + std::string("\x80\x80\x80\x85");
  const Result<Texture> light = Texture::load(write("light.hdr", picture));
  EXPECT_EQ(light.status().code(), StatusCode::kCorruption);
  EXPECT_NE(light.status().message().find("save it as PNG"), std::string::npos);
}

}  // namespace
}  // namespace surfeit
