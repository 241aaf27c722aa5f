// Channel arithmetic on packed rows.
#include "cloud/edits/channel_assignment.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <string>
#include <vector>

namespace surfeit {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;

class ChannelAssignmentTest : public testing::Test {
 protected:
  ChannelAssignmentTest() {
    for (const char* const name : {"x", "y", "z", "radiosity_r", "radiosity_g", "radiosity_b"}) {
      RowProperty property;
      property.name = name;
      element_.properties.push_back(property);
    }
    RowProperty group;
    group.name = "group";
    group.type = ValueType::kUint8;
    element_.properties.push_back(group);
    packRow(element_);
    for (int i = 0; i < 4; ++i) {
      addRow({float(i), 1, 2, 1 + float(i), 10, 100}, std::uint8_t(i % 2 == 0 ? 3 : 1));
    }
  }

  void addRow(const std::vector<float>& floats, std::uint8_t group) {
    const std::size_t at = rows_.size();
    rows_.resize(at + element_.row_bytes);
    std::memcpy(&rows_[at], floats.data(), floats.size() * sizeof(float));
    rows_[at + floats.size() * sizeof(float)] = std::byte{group};
  }

  // Applies it to all rows; what was lost.
  std::string set(const std::string& text) {
    Result<ChannelAssignment> made = ChannelAssignment::create(text, element_);
    EXPECT_TRUE(made.ok()) << made.status().message();
    if (!made.ok()) return {};
    made->apply(rows_.data(), rows_.size() / element_.row_bytes);
    described_ = made->describe();
    return made->loss();
  }

  std::string refusal(const std::string& text) const {
    const Result<ChannelAssignment> made = ChannelAssignment::create(text, element_);
    EXPECT_FALSE(made.ok()) << text;
    EXPECT_EQ(made.status().code(), StatusCode::kInvalidArgument);
    return made.ok() ? "" : made.status().message();
  }

  std::vector<double> column(const char* name) const {
    std::vector<double> values;
    const RowProperty* const property = element_.find(name);
    for (std::size_t at = 0; at < rows_.size(); at += element_.row_bytes) {
      values.push_back(rowValue(&rows_[at + property->offset], property->type));
    }
    return values;
  }

  RowLayout element_;
  std::vector<std::byte> rows_;
  std::string described_;
};

TEST_F(ChannelAssignmentTest, ChannelsAreSetByComponentWhereAConditionHolds) {
  EXPECT_EQ(set("radiosity *= .5 where group == 3"), "");
  EXPECT_THAT(column("radiosity_r"), ElementsAre(0.5, 2, 1.5, 4));
  EXPECT_THAT(column("radiosity_g"), ElementsAre(5, 10, 5, 10));
  EXPECT_THAT(column("radiosity_b"), ElementsAre(50, 100, 50, 100));
  EXPECT_THAT(described_, HasSubstr("2 of 4 records"));
  set("radiosity = max(radiosity, 8) + position * 0 where x >= 1 and not (group == 3)");
  EXPECT_THAT(column("radiosity_r"), ElementsAre(0.5, 8, 1.5, 8));
  EXPECT_THAT(column("radiosity_b"), ElementsAre(50, 100, 50, 100));
}

TEST_F(ChannelAssignmentTest, EveryOperationComputesInDoubles) {
  set("x += 1");
  EXPECT_THAT(column("x"), ElementsAre(1, 2, 3, 4));
  set("x -= 2 * y");
  EXPECT_THAT(column("x"), ElementsAre(-1, 0, 1, 2));
  set("x /= 2");
  EXPECT_THAT(column("x"), ElementsAre(-0.5, 0, 0.5, 1));
  set("y = pow(x, 2) + abs(x) - min(x, z) + sqrt(z * 8) * (x > 0)");
  EXPECT_THAT(column("y"), ElementsAre(1.25, 0, 4.25, 5));
  set("position *= -1");
  EXPECT_THAT(column("x"), ElementsAre(0.5, 0, -0.5, -1));
  EXPECT_THAT(column("z"), ElementsAre(-2, -2, -2, -2));
}

// All components are computed from the values before.
TEST_F(ChannelAssignmentTest, ComponentsDoNotSeeEachOther) {
  set("radiosity = (radiosity_r + radiosity_g + radiosity_b) / 3");
  EXPECT_THAT(column("radiosity_r"), ElementsAre(37, double(112.f / 3), double(113.f / 3), 38));
  EXPECT_EQ(column("radiosity_r"), column("radiosity_b"));
}

TEST_F(ChannelAssignmentTest, IntegersTakeTheNearestAndLossIsTold) {
  EXPECT_EQ(set("group = 2.6"), "");
  EXPECT_THAT(column("group"), ElementsAre(3, 3, 3, 3));
  EXPECT_THAT(set("group = x * 200 - 1"), HasSubstr("3 values do not fit the type of group"));
  EXPECT_THAT(column("group"), ElementsAre(0, 199, 255, 255));
  EXPECT_THAT(set("group = 0 / 0"), HasSubstr("4 values"));
  EXPECT_THAT(column("group"), ElementsAre(0, 199, 255, 255));
  EXPECT_THAT(set("z = 1 / x"), HasSubstr("1 values are not finite"));
}

TEST_F(ChannelAssignmentTest, MoreRowsThanABlockAreSet) {
  for (int i = 0; i < 3000; ++i) addRow({float(i), 0, 0, 1, 1, 1}, 7);
  set("radiosity = x where group == 7");
  const std::vector<double> found = column("radiosity_g");
  for (int i = 0; i < 3000; ++i) EXPECT_EQ(found[std::size_t(i) + 4], i);
  EXPECT_EQ(found[0], 10);
}

TEST_F(ChannelAssignmentTest, HostileTextsAreRefusedWithTheirPlace) {
  EXPECT_THAT(refusal(""), HasSubstr("set: at 1: found the end, expected the name"));
  EXPECT_THAT(refusal("radiosity"), HasSubstr("at 10: found the end, expected =, *="));
  EXPECT_THAT(refusal("radiosity == 3"), HasSubstr("at 11: found"));
  EXPECT_THAT(refusal("colour = 3"), HasSubstr("at 1: found 'colour', expected one of position"));
  EXPECT_THAT(refusal("radiosity *= "), HasSubstr("expected a number, a name or ("));
  EXPECT_THAT(refusal("radiosity *= foo"), HasSubstr("at 14: found 'foo'"));
  EXPECT_THAT(refusal("x = radiosity"),
              HasSubstr("of 3 numbers, expected one number, such as radiosity_r"));
  EXPECT_THAT(refusal("x = 1 where radiosity > 1"), HasSubstr("at 13: found"));
  EXPECT_THAT(refusal("x = 1 where"), HasSubstr("at 12: found the end"));
  EXPECT_THAT(refusal("x = max(1)"), HasSubstr("at 10: found ')', expected a comma"));
  EXPECT_THAT(refusal("x = system(1)"), HasSubstr("at 5: found 'system', expected min, max"));
  EXPECT_THAT(refusal("x = 1, 2"), HasSubstr("at 6"));
  EXPECT_THAT(refusal("'x = 1"), HasSubstr("a name between quotes"));
  EXPECT_THAT(refusal("x = " + std::string(100000, '(')), HasSubstr("at most 64 parentheses"));
  std::string many = "x = 1";
  for (int i = 0; i < 1000; ++i) many += "+1";
  EXPECT_THAT(refusal(many), HasSubstr("at most 256 steps"));
  std::string deep = "x = ";
  for (int i = 0; i < 1000; ++i) deep += "abs(";
  EXPECT_THAT(refusal(deep), HasSubstr("at most 64 parentheses"));
}

TEST_F(ChannelAssignmentTest, WellKnownChannelsMayBeNew) {
  std::vector<RowProperty> properties = element_.properties;
  ASSERT_TRUE(ChannelAssignment::declare("albedo = 0.5", properties).ok());
  ASSERT_TRUE(ChannelAssignment::declare("two_sided = 1 where group == 3", properties).ok());
  ASSERT_TRUE(ChannelAssignment::declare("radiosity = 1", properties).ok());
  ASSERT_EQ(properties.size(), element_.properties.size() + 4);
  EXPECT_EQ(properties.back().name, "two_sided");
  EXPECT_EQ(properties.back().type, ValueType::kUint8);
  EXPECT_FALSE(ChannelAssignment::declare("occlusion *= 2", properties).ok());
  EXPECT_FALSE(ChannelAssignment::declare("radiosty = 2", properties).ok());
}

}  // namespace
}  // namespace surfeit
