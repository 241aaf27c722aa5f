#include "view/channel.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstring>
#include <limits>

#include "view/srgb.h"

namespace surfeit {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;

// An element of float properties, and a row where property i has the value i + 1.
RowLayout floats(const std::vector<std::string>& names) {
  RowLayout element;
  element.name = "vertex";
  for (const std::string& name : names) {
    RowProperty property;
    property.name = name;
    property.offset = element.row_bytes;
    element.row_bytes += sizeof(float);
    element.properties.push_back(property);
  }
  return element;
}

glm::vec3 valueOf(const RowLayout& element, const std::string& name,
                  const std::vector<float>& row) {
  const Result<Channel> channel = Channel::find(element, name, "cloud.ply");
  EXPECT_TRUE(channel.ok()) << channel.status().message();
  return channel->value(std::as_bytes(std::span(row)).data());
}

const std::vector<std::string> kGathered = {
    "x",           "y",        "z",        "occlusion", "radiosity_r",  "radiosity_g",
    "radiosity_b", "albedo_r", "albedo_g", "albedo_b",  "irradiance_r", "irradiance_g",
    "irradiance_b"};

TEST(Channel, LitIsRadiosityPlusAlbedoTimesIrradiance) {
  const std::vector<float> row = {0, 0, 0, 0.25f, 1, 2, 3, 0.5f, 0.25f, 0, 4, 8, 16};
  EXPECT_EQ(valueOf(floats(kGathered), "lit", row), glm::vec3(3, 4, 3));
  EXPECT_EQ(valueOf(floats(kGathered), "indirect", row), glm::vec3(2, 2, 0));
  EXPECT_EQ(valueOf(floats(kGathered), "radiosity", row), glm::vec3(1, 2, 3));
  EXPECT_EQ(valueOf(floats(kGathered), "irradiance", row), glm::vec3(4, 8, 16));
}

TEST(Channel, AoIsOneMinusOcclusion) {
  const std::vector<float> row = {0, 0, 0, 0.25f, 1, 2, 3, 0.5f, 0.25f, 0, 4, 8, 16};
  EXPECT_EQ(valueOf(floats(kGathered), "ao", row), glm::vec3(0.75f));
  EXPECT_EQ(valueOf(floats(kGathered), "occlusion", row), glm::vec3(0.25f));
}

TEST(Channel, LitWithoutAlbedoShowsTheIrradiance) {
  const RowLayout element = floats({"x", "y", "z", "irradiance_r", "irradiance_g", "irradiance_b"});
  EXPECT_EQ(valueOf(element, "lit", {0, 0, 0, 1, 2, 3}), glm::vec3(1, 2, 3));
}

TEST(Channel, LitAddsTheLightOfTheEnvironment) {
  const std::vector<std::string> names = {
      "x",        "y",        "z",        "environment_r", "environment_g", "environment_b",
      "albedo_r", "albedo_g", "albedo_b", "irradiance_r",  "irradiance_g",  "irradiance_b"};
  const std::vector<float> row = {0, 0, 0, 1, 2, 3, 0.5f, 0.25f, 1, 3, 2, 1};
  EXPECT_EQ(valueOf(floats(names), "lit", row), glm::vec3(2, 1, 4));
  EXPECT_EQ(valueOf(floats(names), "indirect", row), glm::vec3(2, 1, 4));

  // Without color bleeding there is still the environment
  const RowLayout alone = floats({names.begin(), names.begin() + 9});
  EXPECT_EQ(valueOf(alone, "lit", row), glm::vec3(0.5f, 0.5f, 3));
  EXPECT_EQ(Channel::choose(alone), "lit");
}

TEST(Channel, TriplesOfAGatherAreChannels) {
  const RowLayout element =
      floats({"x", "y", "z", "reflection_r", "reflection_g", "reflection_b", "fluence_r",
              "fluence_g", "fluence_b", "bent_normal_x", "bent_normal_y", "bent_normal_z"});
  const std::vector<float> row = {0, 0, 0, 1, 2, 3, 4, 5, 6, 0, -1, 0};
  EXPECT_EQ(valueOf(element, "reflection", row), glm::vec3(1, 2, 3));
  EXPECT_EQ(valueOf(element, "fluence", row), glm::vec3(4, 5, 6));
  EXPECT_EQ(valueOf(element, "bent_normal", row), glm::vec3(0, -1, 0));
  EXPECT_EQ(Channel::find(element, "bent_normal", "cloud.ply")->kind(), ValueKind::kNormal);
}

TEST(Channel, EightBitColorsAreSrgb) {
  RowLayout element = floats({"x", "y", "z"});
  for (const char* name : {"red", "green", "blue"}) {
    RowProperty property;
    property.name = name;
    property.type = ValueType::kUint8;
    property.offset = element.row_bytes++;
    element.properties.push_back(property);
  }
  const unsigned char row[15] = {0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 188, 255};
  const Result<Channel> channel = Channel::find(element, "color", "cloud.ply");
  ASSERT_TRUE(channel.ok());
  const glm::vec3 value = channel->value(std::as_bytes(std::span(row)).data());
  EXPECT_EQ(value.x, 0);
  EXPECT_NEAR(value.y, 0.5029f, 1e-3);
  EXPECT_NEAR(value.z, 1, 1e-6);
}

// Classes, returns and groups of scans are numbers, and far from 255.
TEST(Channel, BytesThatAreNoColorsAreNumbers) {
  RowLayout element = floats({"x", "y", "z"});
  for (const char* name : {"classification", "red", "green", "blue"}) {
    RowProperty property;
    property.name = name;
    property.type = ValueType::kUint8;
    property.offset = element.row_bytes++;
    element.properties.push_back(property);
  }
  const unsigned char row[16] = {0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 6, 188, 0, 0};
  const auto bytes = std::as_bytes(std::span(row));
  const Result<Channel> number = Channel::find(element, "classification", "cloud.ply");
  ASSERT_TRUE(number.ok());
  EXPECT_EQ(number->kind(), ValueKind::kScalar);
  EXPECT_EQ(number->value(bytes.data()).x, 6);
  const Result<Channel> code = Channel::find(element, "red", "cloud.ply");
  ASSERT_TRUE(code.ok());
  EXPECT_EQ(code->kind(), ValueKind::kLight);
  EXPECT_NEAR(code->value(bytes.data()).x, 0.5029f, 1e-3);
}

TEST(Channel, UnknownNameListsWhatThereIs) {
  const Result<Channel> channel = Channel::find(floats(kGathered), "colour", "cloud.ply");
  ASSERT_EQ(channel.status().code(), StatusCode::kInvalidArgument);
  EXPECT_THAT(channel.status().message(),
              HasSubstr("cloud.ply: no channel \"colour\"; this cloud has: lit, indirect, ao, "
                        "position, occlusion, radiosity, albedo, irradiance"));
}

TEST(Channel, ListFoldsTriplesAndKeepsScalars) {
  EXPECT_THAT(Channel::list(floats({"x", "y", "z", "nx", "ny", "nz", "radius", "bent_x"})),
              ElementsAre("position", "normal", "radius", "bent_x"));
}

TEST(Channel, ChoosesTheMostTellingOne) {
  EXPECT_EQ(Channel::choose(floats(kGathered)), "lit");
  EXPECT_EQ(Channel::choose(floats({"x", "y", "z", "occlusion", "red", "green", "blue"})), "ao");
  EXPECT_EQ(Channel::choose(floats({"x", "y", "z", "nx", "ny", "nz"})), "normal");
  EXPECT_EQ(Channel::choose(floats({"x", "y", "z"})), "position");
}

TEST(Srgb, HalfIsOneHundredEightyEight) {
  EXPECT_NEAR(255 * srgbFromLinear(0.5f), 187.516f, 1e-2);
  for (const float display : {0.0f, 0.02f, 0.04045f, 0.3f, 1.0f}) {
    EXPECT_NEAR(srgbFromLinear(linearFromSrgb(display)), display, 1e-5);
  }
}

}  // namespace
}  // namespace surfeit
