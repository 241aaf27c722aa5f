#include "octree/column_codec.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <functional>
#include <limits>

#include "octree/test_scenes.h"

namespace surfeit {
namespace {

using Buffer = std::vector<std::byte>;

constexpr float kLargest = std::numeric_limits<float>::max();
constexpr float kSmallest = std::numeric_limits<float>::min();

// Encodes with `put`, checks that every truncation is refused, and decodes into `values`.
template <typename T, typename Put, typename Get>
void roundTrip(std::vector<T>& values, const Put& put, const Get& get) {
  Buffer buffer;
  ByteWriter writer(buffer);
  put(writer, values);
  for (std::size_t size = 0; size < buffer.size(); ++size) {
    ByteReader cut(std::span<const std::byte>(buffer).first(size));
    std::vector<T> scratch(values.size());
    ASSERT_FALSE(get(cut, std::span<T>(scratch)) && cut.ok()) << size << " bytes";
  }
  buffer.push_back(std::byte{0x5a});
  ByteReader reader(buffer);
  ASSERT_TRUE(get(reader, std::span<T>(values)));
  EXPECT_EQ(reader.remaining(), 1u);
}

std::vector<glm::vec3> randomPoints(std::size_t count, float scale = 1) {
  TestRandom random(5);
  std::vector<glm::vec3> points(count);
  for (glm::vec3& point : points) point = random.point() * scale;
  return points;
}

TEST(ColumnCodec, PositionsStayWithinTheErrorAskedFor) {
  for (const glm::vec3& offset : {glm::vec3(0), glm::vec3(-0.5f), glm::vec3(1e4f, -1e5f, 7)}) {
    for (const float max_error : {1.f, 1e-3f, 1e-4f, 1e-5f, 1e-6f, 1e-7f, 1e-9f, 0.f}) {
      std::vector<glm::vec3> values = randomPoints(300);
      for (glm::vec3& value : values) value += offset;
      const std::vector<glm::vec3> expected = values;
      const float error = positionError(values, max_error, false);
      EXPECT_LE(error, max_error);
      roundTrip(
          values,
          [&](ByteWriter& writer, std::span<const glm::vec3> v) {
            putPositions(writer, v, max_error, false);
          },
          getPositions);
      // A position is a float again in the end: half a unit in the last place on each axis
      const float rounding = 0x1p-24f * glm::length(glm::abs(offset) + 1.f);
      for (std::size_t i = 0; i < values.size(); ++i) {
        ASSERT_LE(glm::length(values[i] - expected[i]), error > 0 ? error + rounding : 0);
      }
    }
  }
}

TEST(ColumnCodec, PositionsOfAnyExtentComeBack) {
  for (const float scale : {0.f, 1e-40f, 1e-30f, 1e12f, 1e38f, kLargest}) {
    std::vector<glm::vec3> values = randomPoints(50, scale);
    values.push_back(-values.back());
    const std::vector<glm::vec3> expected = values;
    roundTrip(
        values,
        [&](ByteWriter& writer, std::span<const glm::vec3> v) {
          putPositions(writer, v, scale * 1e-3f, false);
        },
        getPositions);
    for (std::size_t i = 0; i < values.size(); ++i) {
      for (int axis = 0; axis < 3; ++axis) {
        ASSERT_NEAR(values[i][axis], expected[i][axis], scale * 1e-3f + 1e-45f);
      }
    }
  }
}

TEST(ColumnCodec, FullPrecisionIsExact) {
  std::vector<glm::vec3> points = randomPoints(100, 3);
  std::vector<glm::vec3> normals = points;
  for (glm::vec3& normal : normals) normal = glm::normalize(normal);
  normals.push_back(glm::vec3(0));
  std::vector<float> positive = {1, 2, 3e-40f, kLargest, 1e-20f};
  const std::vector<glm::vec3> expected_points = points, expected_normals = normals;
  const std::vector<float> expected_positive = positive;
  roundTrip(
      points, [](ByteWriter& w, auto& v) { putPositions(w, v, 1, true); }, getPositions);
  EXPECT_EQ(points, expected_points);
  roundTrip(
      points, [](ByteWriter& w, auto& v) { putColors(w, v, true); }, getColors);
  EXPECT_EQ(points, expected_points);
  roundTrip(
      points, [](ByteWriter& w, auto& v) { putReflectances(w, v, true); }, getReflectances);
  EXPECT_EQ(points, expected_points);
  roundTrip(
      normals, [](ByteWriter& w, auto& v) { putNormals(w, v, true); }, getNormals);
  EXPECT_EQ(normals, expected_normals);
  roundTrip(
      positive, [](ByteWriter& w, auto& v) { putPositive(w, v, Rounding::kUp, true); },
      getPositive);
  EXPECT_EQ(positive, expected_positive);
}

TEST(ColumnCodec, PositiveNumbersKeepTheirRelativeError) {
  for (const float range : {0.f, 1e-7f, 0.1f, 10.f, 40.f, 63.f, 80.f, 200.f}) {
    for (const Rounding rounding : {Rounding::kNearest, Rounding::kUp}) {
      TestRandom random(9);
      std::vector<float> values;
      for (int i = 0; i < 1000; ++i) {
        values.push_back(std::exp2(random.between(-range / 2, range / 2)));
      }
      const std::vector<float> expected = values;
      roundTrip(
          values, [&](ByteWriter& w, auto& v) { putPositive(w, v, rounding, false); }, getPositive);
      // Half a step to either side, or up to two steps upwards; and the rounding of exp2
      const float half_step = 0.5f * std::log(2.f) * std::min(range, 64.f) / 65535;
      const float below = rounding == Rounding::kUp ? 0 : half_step + 5e-6f;
      const float above = (rounding == Rounding::kUp ? 4 * half_step : half_step) + 1e-5f;
      for (std::size_t i = 0; i < values.size(); ++i) {
        ASSERT_GE(values[i], expected[i] * (1 - below)) << range << ' ' << i;
        ASSERT_LE(values[i], expected[i] * (1 + above)) << range << ' ' << i;
      }
    }
  }
}

TEST(ColumnCodec, PositiveNumbersOfAnyRangeComeBack) {
  for (const Rounding rounding : {Rounding::kNearest, Rounding::kUp}) {
    std::vector<float> values = {kLargest, kSmallest, 1e-45f, 1, 1e30f, 1e-30f};
    const std::vector<float> expected = values;
    roundTrip(
        values, [&](ByteWriter& w, auto& v) { putPositive(w, v, rounding, false); }, getPositive);
    EXPECT_EQ(values, expected);
    for (const float value : {kLargest, kSmallest, 1e-45f, 1.f}) {
      values.assign(3, value);
      roundTrip(
          values, [&](ByteWriter& w, auto& v) { putPositive(w, v, rounding, false); }, getPositive);
      EXPECT_EQ(values, std::vector<float>(3, value));
    }
  }
}

TEST(ColumnCodec, NormalsTurnByLessThanATenThousandth) {
  TestRandom random(6);
  std::vector<glm::vec3> values;
  for (int i = 0; i < 3000; ++i) values.push_back(random.direction());
  for (int axis = 0; axis < 3; ++axis) {
    for (const float sign : {-1.f, 1.f}) {
      values.push_back(glm::vec3(0));
      values.back()[axis] = sign;
    }
  }
  const std::vector<glm::vec3> expected = values;
  roundTrip(
      values, [](ByteWriter& w, auto& v) { putNormals(w, v, false); }, getNormals);
  for (std::size_t i = 0; i < values.size(); ++i) {
    ASSERT_LE(glm::length(values[i] - expected[i]), 1e-4f) << i;
    ASSERT_NEAR(glm::length(values[i]), 1, 1e-6f);
  }
}

TEST(ColumnCodec, ZeroNormalComesBackAsAUnitVector) {
  std::vector<glm::vec3> values(4, glm::vec3(0));
  roundTrip(
      values, [](ByteWriter& w, auto& v) { putNormals(w, v, false); }, getNormals);
  for (const glm::vec3& value : values) EXPECT_NEAR(glm::length(value), 1, 1e-6f);
}

TEST(ColumnCodec, ColorsKeepElevenBitsAtAnyScale) {
  for (const float scale : {1e-38f, 1e-20f, 1.f, 1000.f, 1e12f, 1e30f}) {
    std::vector<glm::vec3> values = randomPoints(300, scale);
    values.push_back(glm::vec3(0));
    const std::vector<glm::vec3> expected = values;
    roundTrip(
        values, [](ByteWriter& w, auto& v) { putColors(w, v, false); }, getColors);
    for (std::size_t i = 0; i < values.size(); ++i) {
      for (int c = 0; c < 3; ++c) {
        const float small = std::max(scale * 0x1p-37f, kSmallest * 0x1p-10f);
        ASSERT_NEAR(values[i][c], expected[i][c], expected[i][c] * 0x1p-11f + small);
      }
    }
  }
}

TEST(ColumnCodec, LargestColorStaysFinite) {
  std::vector<glm::vec3> values = {{kLargest, 0, 1}, {kLargest, kLargest, kLargest}};
  roundTrip(
      values, [](ByteWriter& w, auto& v) { putColors(w, v, false); }, getColors);
  EXPECT_NEAR(values[0].x, kLargest, kLargest * 0x1p-10f);
}

TEST(ColumnCodec, BlackTakesOneByte) {
  Buffer buffer;
  ByteWriter writer(buffer);
  std::vector<glm::vec3> values(100, glm::vec3(0));
  putColors(writer, values, false);
  EXPECT_EQ(buffer.size(), 1u);
  values.assign(100, glm::vec3(1));
  ByteReader reader(buffer);
  ASSERT_TRUE(getColors(reader, values));
  EXPECT_EQ(values, std::vector<glm::vec3>(100, glm::vec3(0)));
}

TEST(ColumnCodec, ReflectancesStayWithinHalfAStepOfTheirRoots) {
  std::vector<glm::vec3> values = randomPoints(500);
  values.push_back({0, 1, 7});
  const std::vector<glm::vec3> expected = values;
  roundTrip(
      values, [](ByteWriter& w, auto& v) { putReflectances(w, v, false); }, getReflectances);
  for (std::size_t i = 0; i + 1 < values.size(); ++i) {
    for (int c = 0; c < 3; ++c) {
      ASSERT_NEAR(std::sqrt(values[i][c]), std::sqrt(expected[i][c]), 0.5f / 255 + 1e-6f);
    }
  }
  EXPECT_EQ(values.back(), glm::vec3(0, 1, 1));
}

TEST(ColumnCodec, SignedNumbersStayWithinHalfAStep) {
  TestRandom random(8);
  std::vector<float> values = {-4, 4, 0, -5, 5};
  for (int i = 0; i < 500; ++i) values.push_back(random.between(-4, 4));
  const std::vector<float> expected = values;
  roundTrip(
      values, [](ByteWriter& w, auto& v) { putSigned(w, v, 4); },
      [](ByteReader& r, std::span<float> v) { return getSigned(r, v, 4); });
  for (std::size_t i = 0; i < values.size(); ++i) {
    ASSERT_NEAR(values[i], std::clamp(expected[i], -4.f, 4.f), 2.f / 32767 + 1e-6f);
  }
}

TEST(ColumnCodec, CountsAreExactAtAnyWidth) {
  for (int bits = 0; bits <= 64; ++bits) {
    const std::uint64_t largest = bits == 64 ? ~std::uint64_t{0} : (std::uint64_t{1} << bits) - 1;
    std::vector<std::uint64_t> values = {0, largest, largest / 2, largest / 3};
    const std::vector<std::uint64_t> expected = values;
    roundTrip(
        values, [](ByteWriter& w, auto& v) { putCounts(w, v); }, getCounts);
    EXPECT_EQ(values, expected);
  }
}

TEST(ColumnCodec, BytesAndFloatsAreExact) {
  std::vector<std::uint8_t> bytes = {0, 1, 128, 255};
  roundTrip(
      bytes, [](ByteWriter& w, auto& v) { putBytes8(w, v); }, getBytes8);
  EXPECT_EQ(bytes, (std::vector<std::uint8_t>{0, 1, 128, 255}));
  std::vector<float> floats = {0, -1, kLargest, 1e-45f};
  roundTrip(
      floats, [](ByteWriter& w, auto& v) { putFloats(w, v); }, getFloats);
  EXPECT_EQ(floats, (std::vector<float>{0, -1, kLargest, 1e-45f}));
}

TEST(ColumnCodec, RandomBytesDecodeToValidValuesOrNot) {
  TestRandom random(12);
  const std::size_t count = 5;
  std::vector<glm::vec3> vectors(count);
  std::vector<float> numbers(count);
  const auto isFinite = [](const glm::vec3& v) {
    return std::isfinite(v.x) && std::isfinite(v.y) && std::isfinite(v.z);
  };
  const auto isColor = [&](const glm::vec3& v) {
    return isFinite(v) && v.x >= 0 && v.y >= 0 && v.z >= 0;
  };
  for (int i = 0; i < 200000; ++i) {
    Buffer buffer(random.bits() % 80);
    for (std::byte& byte : buffer) byte = static_cast<std::byte>(random.bits());
    if (!buffer.empty()) buffer[0] = static_cast<std::byte>(random.bits() % 6);
    ByteReader positions(buffer), normals(buffer), colors(buffer), reflectances(buffer);
    if (getPositions(positions, vectors)) {
      ASSERT_TRUE(std::all_of(vectors.begin(), vectors.end(), isFinite));
    }
    if (getNormals(normals, vectors)) {
      ASSERT_TRUE(std::all_of(vectors.begin(), vectors.end(), isFinite));
    }
    if (getColors(colors, vectors)) {
      ASSERT_TRUE(std::all_of(vectors.begin(), vectors.end(), isColor));
    }
    if (getReflectances(reflectances, vectors)) {
      ASSERT_TRUE(std::all_of(vectors.begin(), vectors.end(), isColor));
    }
    ByteReader positive(buffer);
    if (getPositive(positive, numbers)) {
      for (const float v : numbers) ASSERT_TRUE(v > 0 && std::isfinite(v));
    }
  }
}

}  // namespace
}  // namespace surfeit
