#include "surfels/rows/surfel_mapping.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstring>
#include <limits>
#include <random>
#include <string>
#include <vector>

#include "core/long_side.h"
#include "io/test_bytes.h"

namespace surfeit {
namespace {

struct Declared {
  ValueType type;
  const char* name;
};

RowLayout elementOf(const std::vector<Declared>& properties, std::uint64_t count) {
  RowLayout element;
  element.name = "vertex";
  element.count = count;
  for (const Declared& declared : properties) {
    RowProperty property;
    property.name = declared.name;
    property.type = declared.type;
    element.properties.push_back(property);
  }
  packRow(element);
  return element;
}

constexpr ValueType kFloat = ValueType::kFloat32;
constexpr ValueType kByte = ValueType::kUint8;

// What our own writer writes: all channels.
const std::vector<Declared> kFullCloud = {
    {kFloat, "x"},           {kFloat, "y"},           {kFloat, "z"},           {kFloat, "nx"},
    {kFloat, "ny"},          {kFloat, "nz"},          {kFloat, "radius"},      {kFloat, "area"},
    {kFloat, "radiosity_r"}, {kFloat, "radiosity_g"}, {kFloat, "radiosity_b"}, {kFloat, "albedo_r"},
    {kFloat, "albedo_g"},    {kFloat, "albedo_b"},    {kByte, "two_sided"}};

// Clouds that the fast decoder takes and such that it leaves to the general one.
const std::vector<std::vector<Declared>> kClouds = {
    kFullCloud,
    {{kFloat, "x"}, {kFloat, "y"}, {kFloat, "z"}},
    // Out of order, with gaps, at odd offsets
    {{kFloat, "nz"},
     {kByte, "two_sided"},
     {kFloat, "y"},
     {ValueType::kFloat64, "time"},
     {kFloat, "x"},
     {kByte, "class"},
     {kFloat, "z"},
     {kFloat, "nx"},
     {kFloat, "ny"},
     {kFloat, "width"}},
    {{kFloat, "x"},
     {kFloat, "y"},
     {kFloat, "z"},
     {kByte, "red"},
     {kByte, "green"},
     {kByte, "blue"},
     {kFloat, "area"}},
    {{kFloat, "x"},
     {kFloat, "y"},
     {kFloat, "z"},
     {kFloat, "red"},
     {kFloat, "green"},
     {kFloat, "blue"},
     {kFloat, "pscale"},
     {ValueType::kInt8, "two_sided"}},
    {{kByte, "red"},
     {kByte, "green"},
     {kByte, "blue"},
     {kFloat, "albedo_r"},
     {kFloat, "albedo_g"},
     {kFloat, "albedo_b"},
     {kFloat, "x"},
     {kFloat, "y"},
     {kFloat, "z"}},
    // Groups of every size
    {{kFloat, "x"}, {kFloat, "y"}, {kFloat, "z"}, {kByte, "group"}, {kByte, "light_group"}},
    {{kFloat, "x"}, {kFloat, "y"}, {kFloat, "z"}, {ValueType::kInt8, "light_group"}},
    {{ValueType::kInt16, "group"}, {kFloat, "x"}, {kFloat, "y"}, {kFloat, "z"}},
    {{kFloat, "x"}, {ValueType::kUint16, "group"}, {kFloat, "y"}, {kFloat, "z"}},
    {{kByte, "two_sided"},
     {ValueType::kInt32, "group"},
     {kFloat, "x"},
     {kFloat, "y"},
     {kFloat, "z"}},
    {{kFloat, "x"}, {kFloat, "y"}, {kFloat, "z"}, {ValueType::kUint32, "group"}},
    // Not fast
    {{ValueType::kFloat64, "x"}, {kFloat, "y"}, {kFloat, "z"}, {ValueType::kInt32, "group"}},
    {{ValueType::kFloat64, "x"},
     {ValueType::kFloat64, "y"},
     {ValueType::kFloat64, "z"},
     {kFloat, "nx"},
     {kFloat, "ny"},
     {kFloat, "nz"},
     {kFloat, "radius"}},
    {{kFloat, "x"},
     {kFloat, "y"},
     {kFloat, "z"},
     {ValueType::kUint16, "red"},
     {ValueType::kUint16, "green"},
     {ValueType::kUint16, "blue"},
     {kFloat, "two_sided"}},
};

SurfelMapping mappingOf(const RowLayout& element) {
  Result<SurfelMapping> mapping = SurfelMapping::create(element, "a.ply");
  EXPECT_TRUE(mapping.ok()) << mapping.status().message();
  return std::move(*mapping);
}

// Numbers at and around every limit there is.
std::vector<float> hostileFloats() {
  const float infinity = std::numeric_limits<float>::infinity();
  std::vector<float> floats = {0, std::numeric_limits<float>::quiet_NaN(),
                               std::bit_cast<float>(0x7f800001u), infinity};
  for (const float limit : {std::numeric_limits<float>::max(), std::numeric_limits<float>::min(),
                            std::numeric_limits<float>::denorm_min(), 1e-6f, 0.7071067f, 1.f,
                            kLargestLength, kLargestArea, 1e19f, 1e-30f}) {
    for (const float value :
         {limit, std::nextafter(limit, infinity), std::nextafter(limit, 0.f), limit * 2}) {
      floats.push_back(value);
    }
  }
  const std::size_t count = floats.size();
  for (std::size_t i = 0; i < count; ++i) floats.push_back(-floats[i]);
  return floats;
}

// Rows of plausible values; of every `hostile_every` values one is hostile (0: none).
std::vector<std::byte> randomRows(const RowLayout& element, unsigned hostile_every,
                                  std::mt19937& random) {
  static const std::vector<float> kHostile = hostileFloats();
  std::vector<std::byte> rows(element.count * element.row_bytes);
  for (std::size_t row = 0; row < rows.size(); row += element.row_bytes) {
    for (const RowProperty& property : element.properties) {
      std::byte* const to = &rows[row + property.offset];
      float value = float(random() % 1000 + 1) / 500;
      if (property.name[0] == 'n' && random() % 2 == 0) value = -value;
      if (hostile_every > 0 && random() % hostile_every == 0) {
        value = kHostile[random() % kHostile.size()];
      }
      if (property.type == ValueType::kFloat32) {
        std::memcpy(to, &value, sizeof value);
      } else if (property.type == ValueType::kFloat64) {
        const double wide = random() % 16 == 0 ? double(value) * 1e30 : double(value);
        std::memcpy(to, &wide, sizeof wide);
      } else {
        for (std::size_t i = 0; i < valueTypeBytes(property.type); ++i) to[i] = std::byte(random());
        if (property.name == "two_sided" && random() % 2 == 0) *to = std::byte{0};
        if (property.name == "group" && random() % 8 != 0) {
          std::memset(to, 0, valueTypeBytes(property.type));
          *to = std::byte(random() % kMaxGroups);
        }
      }
    }
  }
  return rows;
}

void expectEqual(const SurfelDefects& a, const SurfelDefects& b) {
  EXPECT_EQ(a.describe(), b.describe());
  EXPECT_EQ(a.total(), b.total());
}

// Of decode, row after row.
std::vector<Surfel> decodeOneByOne(const SurfelMapping& mapping, std::span<const std::byte> rows,
                                   std::uint64_t first_record, SurfelDefects& defects) {
  std::vector<Surfel> surfels;
  for (std::uint64_t i = 0; i < rows.size() / mapping.rowBytes(); ++i) {
    Surfel surfel;
    if (mapping.decode(&rows[i * mapping.rowBytes()], first_record + i, surfel, defects)) {
      surfels.push_back(surfel);
    }
  }
  return surfels;
}

TEST(SurfelMapping, RowsDecodeAsOneByOneToTheLastBit) {
  std::mt19937 random(11);
  for (const std::vector<Declared>& properties : kClouds) {
    for (const unsigned hostile_every : {0u, 2u, 5u, 20u, 500u}) {
      for (const std::uint64_t count : {1u, 63u, 64u, 65u, 3000u}) {
        const RowLayout element = elementOf(properties, count);
        const SurfelMapping mapping = mappingOf(element);
        const std::vector<std::byte> rows = randomRows(element, hostile_every, random);
        SurfelDefects expected_defects, defects;
        const std::vector<Surfel> expected = decodeOneByOne(mapping, rows, 7, expected_defects);
        std::vector<Surfel> surfels(count);
        surfels.resize(mapping.decodeRows(rows, 7, surfels, defects));
        ASSERT_TRUE(areEqual(surfels, expected));
        expectEqual(defects, expected_defects);
      }
    }
  }
}

TEST(SurfelMapping, EveryHostileValueOfEveryPropertyDecodesAsOneByOne) {
  for (const std::vector<Declared>& properties : kClouds) {
    const std::vector<float> hostile = hostileFloats();
    const RowLayout element = elementOf(properties, hostile.size());
    const SurfelMapping mapping = mappingOf(element);
    std::mt19937 random(12);
    const std::vector<std::byte> good_rows = randomRows(element, 0, random);
    for (const RowProperty& property : element.properties) {
      if (property.type != ValueType::kFloat32) continue;
      std::vector<std::byte> rows = good_rows;
      for (std::size_t i = 0; i < hostile.size(); ++i) {
        std::memcpy(&rows[i * element.row_bytes + property.offset], &hostile[i], sizeof(float));
      }
      SurfelDefects expected_defects, defects;
      const std::vector<Surfel> expected = decodeOneByOne(mapping, rows, 0, expected_defects);
      std::vector<Surfel> surfels(hostile.size());
      surfels.resize(mapping.decodeRows(rows, 0, surfels, defects));
      ASSERT_TRUE(areEqual(surfels, expected)) << property.name;
      expectEqual(defects, expected_defects);
    }
  }
}

TEST(SurfelMapping, NormalsOfAllLengthsDecodeAsOneByOne) {
  const RowLayout element = elementOf(kFullCloud, 4096);
  const SurfelMapping mapping = mappingOf(element);
  std::mt19937 random(13);
  std::vector<std::byte> rows = randomRows(element, 0, random);
  for (std::size_t i = 0; i < element.count; ++i) {
    // Around the shortest that points, and everywhere else
    const float length = i % 2 == 0 ? 1e-6f * (1 + 1e-7f * float(int(random() % 9) - 4))
                                    : std::ldexp(1.f, int(random() % 270) - 149);
    float normal[3] = {};
    for (float& value : normal) value = random() % 3 == 0 ? -0.f : length * float(random() % 3);
    if (i % 4 == 0) normal[i / 4 % 3] = length;
    std::memcpy(&rows[i * element.row_bytes + element.find("nx")->offset], normal, sizeof normal);
  }
  SurfelDefects expected_defects, defects;
  const std::vector<Surfel> expected = decodeOneByOne(mapping, rows, 0, expected_defects);
  std::vector<Surfel> surfels(element.count);
  surfels.resize(mapping.decodeRows(rows, 0, surfels, defects));
  ASSERT_TRUE(areEqual(surfels, expected));
  expectEqual(defects, expected_defects);
  EXPECT_GT(defects.short_normal.count, 100u);
  EXPECT_LT(defects.short_normal.count, 3000u);
}

TEST(SurfelMapping, LongSidesAreVectorsAndNeedAnArea) {
  for (const char* size : {"area", "radius"}) {
    const RowLayout element = elementOf({{kFloat, "x"},
                                         {kFloat, "y"},
                                         {kFloat, "z"},
                                         {kFloat, size},
                                         {kFloat, "long_side_x"},
                                         {kFloat, "long_side_y"},
                                         {kFloat, "long_side_z"}},
                                        3);
    const SurfelMapping mapping = mappingOf(element);
    EXPECT_TRUE(mapping.channels().long_side);
    const float rows[3][7] = {{0, 0, 0, .5f, 0, -2, 0},
                              {0, 0, 0, .5f, 0, 0, 0},
                              {0, 0, 0, .5f, std::numeric_limits<float>::quiet_NaN(), 0, 0}};
    std::vector<Surfel> surfels(3);
    SurfelDefects defects;
    ASSERT_EQ(mapping.decodeRows(std::as_bytes(std::span(rows)), 0, surfels, defects), 2u);
    const bool has_area = std::string(size) == "area";
    EXPECT_EQ(directionOf(surfels[0].long_side), glm::vec3(0, has_area ? -1 : 0, 0));
    EXPECT_NEAR(elongationOf(surfels[0]), has_area ? 8 : 1, 1e-3f);
    EXPECT_EQ(surfels[1].long_side, kNoLongSide);
    EXPECT_EQ(defects.non_finite.count, 1u);
  }
}

TEST(SurfelMapping, GroupsAreIntegersFromZeroTo63) {
  const RowLayout element = elementOf(
      {{kFloat, "x"}, {kFloat, "y"}, {kFloat, "z"}, {ValueType::kInt32, "light_group"}}, 6);
  const SurfelMapping mapping = mappingOf(element);
  EXPECT_TRUE(mapping.channels().group);
  std::vector<std::byte> rows(element.count * element.row_bytes);
  const std::int32_t groups[] = {0, 63, 64, -1, 5, 256};
  for (std::size_t i = 0; i < 6; ++i) std::memcpy(&rows[i * 16 + 12], &groups[i], 4);
  std::vector<Surfel> surfels(6);
  SurfelDefects defects;
  ASSERT_EQ(mapping.decodeRows(rows, 10, surfels, defects), 3u);
  EXPECT_EQ(surfels[0].group, 0u);
  EXPECT_EQ(surfels[1].group, 63u);
  EXPECT_EQ(surfels[2].group, 5u);
  EXPECT_EQ(
      defects.describe(),
      "3 records with a group that is not 0 to 63 (first: record 12, whose light_group is 64); "
      "--channels light_group=- reads such records without it, convert --set changes values");
  EXPECT_EQ(mapping.describeDefect(&rows[3 * 16]), "light_group is -1, expected 0 to 63");
}

TEST(SurfelMapping, GroupsMayBeWholeFloats) {
  for (const ValueType type : {ValueType::kFloat32, ValueType::kFloat64}) {
    const RowLayout element =
        elementOf({{kFloat, "x"}, {kFloat, "y"}, {kFloat, "z"}, {type, "group"}}, 6);
    const SurfelMapping mapping = mappingOf(element);
    std::vector<std::byte> rows(6 * element.row_bytes);
    const double groups[] = {0, 63, 64, -1, 2.5, 5};
    for (std::size_t i = 0; i < 6; ++i) {
      const float single = static_cast<float>(groups[i]);
      const void* const value =
          type == ValueType::kFloat32 ? static_cast<const void*>(&single) : &groups[i];
      std::memcpy(&rows[i * element.row_bytes + 12], value, valueTypeBytes(type));
    }
    std::vector<Surfel> surfels(6);
    SurfelDefects defects;
    ASSERT_EQ(mapping.decodeRows(rows, 10, surfels, defects), 3u);
    EXPECT_EQ(surfels[0].group, 0u);
    EXPECT_EQ(surfels[1].group, 63u);
    EXPECT_EQ(surfels[2].group, 5u);
    EXPECT_EQ(defects.describe(),
              "3 records with a group that is not 0 to 63 (first: record 12, whose group is 64); "
              "--channels group=- reads such records without it, convert --set changes values");
    EXPECT_EQ(mapping.describeDefect(&rows[4 * element.row_bytes]),
              "group is 2.5, expected 0 to 63");
  }
}

TEST(SurfelMapping, DefectsOfPartsAddUpInAnyOrder) {
  const RowLayout element = elementOf(kFullCloud, 2000);
  const SurfelMapping mapping = mappingOf(element);
  std::mt19937 random(14);
  const std::vector<std::byte> rows = randomRows(element, 30, random);
  std::vector<Surfel> surfels(element.count);
  SurfelDefects whole;
  mapping.decodeRows(rows, 100, surfels, whole);
  ASSERT_GT(whole.total(), 0u);

  std::vector<std::size_t> parts(20);
  for (std::size_t i = 0; i < parts.size(); ++i) parts[i] = i;
  for (int run = 0; run < 10; ++run) {
    std::shuffle(parts.begin(), parts.end(), random);
    SurfelDefects sum;
    for (const std::size_t part : parts) {
      SurfelDefects defects;
      mapping.decodeRows(
          std::span(rows).subspan(part * 100 * element.row_bytes, 100 * element.row_bytes),
          100 + part * 100, surfels, defects);
      sum.add(defects);
    }
    expectEqual(sum, whole);
    EXPECT_EQ(sum.firstRecord(), whole.firstRecord());
  }
}

TEST(SurfelMapping, FirstRecordIsTheSmallestOfAllKinds) {
  SurfelDefects defects;
  defects.bad_area = {3, 17};
  EXPECT_EQ(defects.firstRecord(), 17u);
  defects.out_of_range = {1, 5};
  EXPECT_EQ(defects.firstRecord(), 5u);
}

}  // namespace
}  // namespace surfeit
