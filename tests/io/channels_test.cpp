#include "cloud/rows/channels.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstring>
#include <string>
#include <vector>

namespace surfeit {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;

std::vector<std::string> names(std::string_view name, std::size_t components, ChannelKind kind,
                               const std::string& renames = "") {
  const Result<std::vector<ChannelRename>> parsed = parseChannelRenames(renames);
  EXPECT_TRUE(parsed.ok()) << parsed.status().message();
  return propertyNames(name, components, kind, *parsed);
}

RowLayout elementOf(const std::vector<std::pair<std::string, ValueType>>& properties) {
  RowLayout element;
  element.name = "vertex";
  for (const auto& [name, type] : properties) {
    RowProperty property;
    property.name = name;
    property.type = type;
    element.properties.push_back(property);
  }
  packRow(element);
  return element;
}

std::vector<std::string> channelNames(const RowLayout& element) {
  std::vector<std::string> found;
  for (const RowChannel& channel : channelsOf(element)) found.push_back(channel.name);
  return found;
}

TEST(Channels, WellKnownNamesOfManyProgramsAreOneChannel) {
  for (const char* name : {"P", "Position", "position", "POSITION", "p"}) {
    EXPECT_THAT(names(name, 3, ChannelKind::kPoint), ElementsAre("x", "y", "z")) << name;
  }
  for (const char* name : {"N", "Normal", "normal"}) {
    EXPECT_THAT(names(name, 3, ChannelKind::kVector), ElementsAre("nx", "ny", "nz")) << name;
  }
  for (const char* name : {"Cd", "Color", "color", "rgb"}) {
    EXPECT_THAT(names(name, 3, ChannelKind::kFloat), ElementsAre("red", "green", "blue")) << name;
  }
  EXPECT_THAT(names("Cd", 4, ChannelKind::kColor), ElementsAre("red", "green", "blue", "alpha"));
  for (const char* name : {"pscale", "radius", "Radius", "radiusPP"}) {
    EXPECT_THAT(names(name, 1, ChannelKind::kFloat), ElementsAre("radius")) << name;
  }
  EXPECT_THAT(names("_area", 1, ChannelKind::kFloat), ElementsAre("area"));
  EXPECT_THAT(names("_radiosity", 3, ChannelKind::kColor),
              ElementsAre("radiosity_r", "radiosity_g", "radiosity_b"));
  EXPECT_THAT(names("_occlusion", 1, ChannelKind::kFloat), ElementsAre("occlusion"));
  EXPECT_THAT(names("Velocity", 3, ChannelKind::kFloat),
              ElementsAre("velocity_x", "velocity_y", "velocity_z"));
  EXPECT_THAT(names("v", 3, ChannelKind::kVector),
              ElementsAre("velocity_x", "velocity_y", "velocity_z"));
  for (const char* name : {"opacity", "Opacity", "Oi", "Os", "_opacity"}) {
    EXPECT_THAT(names(name, 3, ChannelKind::kVector),
                ElementsAre("opacity_r", "opacity_g", "opacity_b"))
        << name;
  }
  EXPECT_THAT(names("opacity", 1, ChannelKind::kFloat), ElementsAre("opacity"));
  // By number of values too
  EXPECT_THAT(names("Os", 1, ChannelKind::kFloat), ElementsAre("Os"));
  EXPECT_THAT(names("v", 1, ChannelKind::kFloat), ElementsAre("v"));
  EXPECT_THAT(names("N", 1, ChannelKind::kFloat), ElementsAre("N"));
}

TEST(Channels, UnknownNamesKeepTheirLetters) {
  EXPECT_THAT(names("life", 1, ChannelKind::kFloat), ElementsAre("life"));
  EXPECT_THAT(names("life", 2, ChannelKind::kFloat), ElementsAre("life_0", "life_1"));
  EXPECT_THAT(names("Flow", 3, ChannelKind::kVector), ElementsAre("Flow_x", "Flow_y", "Flow_z"));
  EXPECT_THAT(names("tint", 3, ChannelKind::kColor), ElementsAre("tint_r", "tint_g", "tint_b"));
  EXPECT_EQ(names("world", 16, ChannelKind::kMatrix).back(), "world_15");
  EXPECT_THAT(names("a b\tc\xe4", 1, ChannelKind::kFloat), ElementsAre("a_b_c_"));
  EXPECT_THAT(names("", 1, ChannelKind::kFloat), ElementsAre("_"));
  EXPECT_THAT(names("none", 0, ChannelKind::kFloat), IsEmpty());
  // However long they are, they are names that PLY takes
  for (const std::string& name : names(std::string(200, 'q'), 16, ChannelKind::kMatrix)) {
    EXPECT_TRUE(isPropertyName(name));
  }
  // A known name of another shape is no known channel
  EXPECT_THAT(names("P", 2, ChannelKind::kFloat), ElementsAre("P_0", "P_1"));
  EXPECT_THAT(names("radius", 3, ChannelKind::kVector),
              ElementsAre("radius_x", "radius_y", "radius_z"));
}

TEST(Channels, RenamesGoBeforeTheTable) {
  EXPECT_THAT(names("Cd", 3, ChannelKind::kColor, "Cd=radiosity"),
              ElementsAre("radiosity_r", "radiosity_g", "radiosity_b"));
  EXPECT_THAT(names("foo", 3, ChannelKind::kFloat, "bar=x,foo=position"),
              ElementsAre("x", "y", "z"));
  EXPECT_THAT(names("foo", 3, ChannelKind::kFloat, "foo=albedo"),
              ElementsAre("albedo_r", "albedo_g", "albedo_b"));
  EXPECT_THAT(names("N", 3, ChannelKind::kNormal, "N=-"), IsEmpty());
  EXPECT_THAT(names("N", 3, ChannelKind::kNormal, "N=n"), ElementsAre("n_x", "n_y", "n_z"));
  // Case counts
  EXPECT_THAT(names("cd", 3, ChannelKind::kColor, "Cd=albedo"),
              ElementsAre("red", "green", "blue"));
}

TEST(Channels, RenamesThatAreNoneAreRefused) {
  EXPECT_THAT(*parseChannelRenames(""), IsEmpty());
  ASSERT_EQ(parseChannelRenames("a=b,c=-")->size(), 2u);
  for (const char* text : {"a", "=b", "a=", "a=b,", ",a=b", "a=b,,c=d", "a=b,c"}) {
    const auto renames = parseChannelRenames(text);
    EXPECT_EQ(renames.status().code(), StatusCode::kInvalidArgument) << text;
    EXPECT_THAT(renames.status().message(), HasSubstr("expected FROM=TO")) << text;
  }
  EXPECT_EQ(parseChannelRenames("a=b c").status().code(), StatusCode::kInvalidArgument);
}

TEST(Channels, AddedChannelsArePackedAndFoundAgain) {
  RowLayout element;
  const auto add = [&](const char* name, std::size_t components, ChannelKind kind, ValueType type) {
    const Status status = addChannel(name, components, kind, type, {}, "a.ptc", element);
    EXPECT_TRUE(status.ok()) << status.message();
  };
  add("P", 3, ChannelKind::kPoint, ValueType::kFloat64);
  add("_area", 1, ChannelKind::kFloat, ValueType::kFloat32);
  add("_radiosity", 3, ChannelKind::kColor, ValueType::kFloat32);
  add("life", 2, ChannelKind::kFloat, ValueType::kUint16);
  add("N", 3, ChannelKind::kNormal, ValueType::kFloat32);
  add("m", 16, ChannelKind::kMatrix, ValueType::kFloat32);
  add("Cd", 3, ChannelKind::kColor, ValueType::kFloat32);
  add("spin", 3, ChannelKind::kVector, ValueType::kFloat32);
  EXPECT_EQ(element.row_bytes, 24u + 4 + 12 + 4 + 12 + 64 + 12 + 12);
  EXPECT_EQ(element.find("life_1")->offset, 42u);

  EXPECT_THAT(channelNames(element),
              ElementsAre("position", "area", "radiosity", "life", "normal", "m", "color", "spin"));
  const std::vector<RowChannel> channels = channelsOf(element);
  EXPECT_EQ(channels[0].kind, ChannelKind::kPoint);
  EXPECT_EQ(channels[0].type, ValueType::kFloat64);
  EXPECT_EQ(channels[2].kind, ChannelKind::kColor);
  EXPECT_EQ(channels[3].properties.size(), 2u);
  EXPECT_EQ(channels[4].kind, ChannelKind::kNormal);
  EXPECT_EQ(channels[5].kind, ChannelKind::kMatrix);
  EXPECT_EQ(channels[7].kind, ChannelKind::kVector);

  const Status twin =
      addChannel("position", 3, ChannelKind::kPoint, ValueType::kFloat32, {}, "a.ptc", element);
  EXPECT_EQ(twin.code(), StatusCode::kCorruption);
  EXPECT_THAT(twin.message(), HasSubstr("a.ptc: channel 'position': found a second property x"));
}

TEST(Channels, TriplesInAnyOrderBelongTogether) {
  const RowLayout element = elementOf({{"nz", ValueType::kFloat32},
                                       {"blue", ValueType::kUint8},
                                       {"nx", ValueType::kFloat32},
                                       {"red", ValueType::kUint16},
                                       {"ny", ValueType::kFloat32},
                                       {"green", ValueType::kUint8}});
  EXPECT_THAT(channelNames(element), ElementsAre("normal", "color"));
  const std::vector<RowChannel> channels = channelsOf(element);
  EXPECT_THAT(channels[0].properties, ElementsAre(2, 4, 0));
  EXPECT_THAT(channels[1].properties, ElementsAre(3, 5, 1));
  EXPECT_EQ(channels[1].type, ValueType::kUint16);
}

TEST(Channels, WhatIsNotCompleteIsSingle) {
  RowLayout element = elementOf({{"x", ValueType::kFloat32},
                                 {"y", ValueType::kFloat32},
                                 {"tint_r", ValueType::kFloat32},
                                 {"tint_g", ValueType::kFloat32},
                                 {"a_0", ValueType::kFloat32},
                                 {"b_1", ValueType::kFloat32},
                                 {"_0", ValueType::kFloat32},
                                 {"faces", ValueType::kInt32}});
  element.properties.back().is_list = true;
  EXPECT_THAT(channelNames(element), ElementsAre("x", "y", "tint_r", "tint_g", "a_0", "b_1", "_0"));
}

TEST(Channels, TypeHoldsTheValuesOfAllComponents) {
  const auto type = [](ValueType a, ValueType b) {
    return channelsOf(elementOf({{"v_0", a}, {"v_1", b}}))[0].type;
  };
  using enum ValueType;
  EXPECT_EQ(type(kUint8, kInt8), kInt16);
  EXPECT_EQ(type(kInt16, kUint8), kInt16);
  EXPECT_EQ(type(kInt8, kUint16), kInt32);
  EXPECT_EQ(type(kUint32, kInt32), kFloat64);
  EXPECT_EQ(type(kFloat32, kInt16), kFloat32);
  EXPECT_EQ(type(kInt32, kFloat32), kFloat64);
  EXPECT_EQ(type(kFloat32, kFloat64), kFloat64);
  EXPECT_EQ(type(kUint16, kUint16), kUint16);
}

TEST(Channels, IntegersOfColorsAreTurnedLinear) {
  const RowLayout element = elementOf({{"red", ValueType::kUint8},
                                       {"green", ValueType::kUint16},
                                       {"blue", ValueType::kFloat32},
                                       {"count", ValueType::kUint8}});
  std::vector<std::byte> row(element.row_bytes);
  row[0] = std::byte{188};
  const std::uint16_t green = 65535;
  const float blue = 2.5f;
  std::memcpy(&row[1], &green, sizeof green);
  std::memcpy(&row[3], &blue, sizeof blue);
  row[7] = std::byte{188};
  const std::vector<RowChannel> channels = channelsOf(element);
  EXPECT_NEAR(channelValue(element, channels[0], 0, row.data()), 0.5029, 1e-4);
  EXPECT_EQ(channelValue(element, channels[0], 1, row.data()), 1);
  EXPECT_EQ(channelValue(element, channels[0], 2, row.data()), 2.5);
  EXPECT_EQ(channelValue(element, channels[1], 0, row.data()), 188);
}

}  // namespace
}  // namespace surfeit
