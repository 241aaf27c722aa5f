// Columns of pages that hold what no encoder writes: each check of a decoder by itself.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <cstddef>
#include <cstring>
#include <functional>
#include <limits>
#include <vector>

#include "octree/axis_columns.h"
#include "octree/page/column_codec.h"
#include "octree/payload_cuts.h"

namespace surfeit {
namespace {

using Buffer = std::vector<std::byte>;

AxisColumns threePoints() {
  return AxisColumns(std::vector<glm::vec3>{{.1f, .9f, .4f}, {.7f, .2f, 0}, {.5f, .5f, 1}});
}

// The bytes of a column from the end of the header on.
using ColumnGet = std::function<bool(PayloadReader&)>;

// Whether `get` takes the column with the byte at `at` changed to `value`.
bool takes(Buffer payload, std::size_t at, int value, const ColumnGet& get) {
  payload[kPayloadHeaderBytes + at] = static_cast<std::byte>(value);
  PayloadReader reader(payload);
  return get(reader);
}

template <typename Put>
Buffer payloadOf(const Put& put) {
  Buffer buffer;
  PayloadWriter writer(buffer, 3);
  put(writer);
  writer.finish();
  return buffer;
}

TEST(ColumnDamage, FormsAndPlanesThatThereAreNotAreRefused) {
  const AxisColumns points = threePoints();
  AxisColumns found(3);
  std::vector<float> numbers = {1, 2, 3};
  std::vector<std::uint64_t> counts = {1, 2, 3};
  AxisColumns normals(3);
  for (float& x : normals.values[0]) x = -1;
  struct Column {
    const char* name;
    Buffer payload;
    ColumnGet get;
    std::vector<int> forms;             // all that there are
    std::vector<std::size_t> plane_at;  // the bytes that tell which planes are plain
  };
  const std::vector<Column> columns = {
      // form, step and the least coordinate come before the planes of an axis
      {"positions",
       payloadOf([&](auto& w) { putPositions(w, points.axes(), 1e-3f, false); }),
       [&](auto& reader) { return getPositions(reader, found.mutableAxes()); },
       {2, 3, 4},
       {9, 20}},
      {"positions of three bytes",
       payloadOf([&](auto& w) { putPositions(w, points.axes(), 1e-6f, false); }),
       [&](auto& reader) { return getPositions(reader, found.mutableAxes()); },
       {2, 3, 4},
       {9}},
      {"normals",
       payloadOf([&](auto& w) { putNormals(w, normals.axes(), false); }),
       [&](auto& reader) { return getNormals(reader, found.mutableAxes()); },
       {2, 4},
       {1, 8}},
      {"colors",
       payloadOf([&](auto& w) { putColors(w, points.axes(), false); }),
       [&](auto& reader) { return getColors(reader, found.mutableAxes()); },
       {0, 2, 4},
       {2, 9}},
      {"reflectances",
       payloadOf([&](auto& w) { putReflectances(w, points.axes(), false); }),
       [&](auto& reader) { return getReflectances(reader, found.mutableAxes()); },
       {2, 4},
       {1, 5}},
      {"positive numbers",
       payloadOf([&](auto& w) { putPositive(w, numbers, Rounding::kNearest, false); }),
       [&](auto& reader) { return getPositive(reader, numbers); },
       {2, 4},
       {6}},
      {"counts",
       payloadOf([&](auto& w) { putCounts(w, counts); }),
       [&](auto& reader) { return getCounts(reader, counts); },
       {1, 2, 4, 8},
       {1}},
  };
  for (const Column& column : columns) {
    SCOPED_TRACE(column.name);
    EXPECT_TRUE(takes(column.payload, 0, int(column.payload[kPayloadHeaderBytes]), column.get));
    for (int form = 0; form < 256; ++form) {
      if (testing::Value(column.forms, testing::Contains(form))) continue;
      ASSERT_FALSE(takes(column.payload, 0, form, column.get)) << "form " << form;
    }
    for (const std::size_t at : column.plane_at) {
      ASSERT_EQ(column.payload[kPayloadHeaderBytes + at], std::byte{0}) << at;
      EXPECT_TRUE(takes(column.payload, at, 0, column.get)) << at;
      EXPECT_FALSE(takes(column.payload, at, 0x80, column.get)) << at;
    }
  }
}

// Scales of a column: each alone makes values that there are not.
TEST(ColumnDamage, ScalesThatThereAreNotAreRefused) {
  constexpr float kInfinity = std::numeric_limits<float>::infinity();
  const AxisColumns points = threePoints();
  AxisColumns found(3);
  std::vector<float> numbers = {1, 2, 3};
  const auto with = [](Buffer payload, std::size_t at, float value) {
    std::memcpy(&payload[kPayloadHeaderBytes + at], &value, sizeof value);
    return payload;
  };
  const Buffer positions =
      payloadOf([&](auto& w) { putPositions(w, points.axes(), 1e-3f, false); });
  const Buffer positive =
      payloadOf([&](auto& w) { putPositive(w, numbers, Rounding::kNearest, false); });
  const auto takesPositions = [&](std::size_t at, float value) {
    const Buffer payload = with(positions, at, value);
    PayloadReader reader(payload);
    return getPositions(reader, found.mutableAxes());
  };
  const auto takesPositive = [&](float value) {
    const Buffer payload = with(positive, 1, value);
    PayloadReader reader(payload);
    return getPositive(reader, numbers);
  };
  for (const std::size_t at : {std::size_t{1}, std::size_t{5}}) {  // the step, the least of x
    EXPECT_TRUE(takesPositions(at, 1));
    for (const float value : {kInfinity, -kInfinity, std::nanf("")}) {
      EXPECT_FALSE(takesPositions(at, value)) << at << ' ' << value;
    }
  }
  EXPECT_FALSE(takesPositions(1, 0));
  EXPECT_FALSE(takesPositions(1, -1));
  EXPECT_TRUE(takesPositive(1));
  for (const float value : {kInfinity, std::nanf(""), 0.f, -1.f}) {
    EXPECT_FALSE(takesPositive(value)) << value;
  }
}

TEST(ColumnDamage, ColorsBeyondHalvesAndFloatsAreRefused) {
  AxisColumns found(3);
  const auto takesCodes = [&](int exponent, std::uint16_t code) {
    const std::vector<std::uint16_t> codes = {0, code, 0};
    const Buffer payload = payloadOf([&](PayloadWriter& writer) {
      writer.put(std::uint8_t{2});
      writer.put(static_cast<std::int8_t>(exponent));
      for (int axis = 0; axis < 3; ++axis) putDifferences<2, std::uint16_t>(writer, codes);
    });
    PayloadReader reader(payload);
    return getColors(reader, found.mutableAxes());
  };
  EXPECT_TRUE(takesCodes(0, 0x7bff));
  EXPECT_FALSE(takesCodes(0, 0x7c00));
  EXPECT_TRUE(takesCodes(112, 0x7bff));
  EXPECT_FALSE(takesCodes(113, 0x7bff));
}

TEST(ColumnDamage, PackedPartsThatAreNotThereAreRefused) {
  std::vector<std::uint8_t> bytes(3);
  Buffer payload = payloadOf([&](auto& w) { putBytes8(w, bytes); });
  for (std::uint32_t packed = 0; packed < payload.size() + 3; ++packed) {
    setPackedBytes(payload, packed);
    const bool is_there = packed >= kPayloadHeaderBytes && packed <= payload.size();
    EXPECT_EQ(PayloadReader(payload).ok(), is_there) << packed;
  }
}

}  // namespace
}  // namespace surfeit
