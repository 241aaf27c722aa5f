#include "octree/page/column_codec.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <bit>
#include <cstring>
#include <limits>

#include "octree/axis_columns.h"
#include "octree/payload_cuts.h"
#include "octree/test_scenes.h"

namespace surfeit {
namespace {

using Buffer = std::vector<std::byte>;

constexpr float kLargest = std::numeric_limits<float>::max();
constexpr float kSmallest = std::numeric_limits<float>::min();

// Encodes with `put`, checks that every truncation is refused, and decodes into `values`. Returns
// the payload.
template <typename T, typename Put, typename Get>
Buffer roundTrip(std::vector<T>& values, const Put& put, const Get& get) {
  Buffer buffer;
  PayloadWriter writer(buffer, static_cast<std::uint32_t>(values.size()));
  put(writer, values);
  writer.finish();
  for (std::size_t size = 0; size < buffer.size(); ++size) {
    PayloadReader cut(std::span<const std::byte>(buffer).first(size));
    std::vector<T> scratch(values.size());
    EXPECT_FALSE(get(cut, std::span<T>(scratch)) && cut.ok()) << size << " bytes";
  }
  // Where nothing but the column's own end tells, with sound values in every scratch
  for (std::uint32_t size = kPayloadHeaderBytes; size < packedBytesOf(buffer); ++size) {
    const Buffer shorter = withPackedPart(buffer, size);
    PayloadReader cut(shorter);
    std::vector<T> scratch = values;
    EXPECT_FALSE(get(cut, std::span<T>(scratch))) << size << " packed bytes";
  }
  Buffer extended = buffer;
  extended.push_back(std::byte{0x5a});
  PayloadReader reader(extended);
  EXPECT_EQ(reader.recordCount(), values.size());
  EXPECT_TRUE(get(reader, std::span<T>(values)));
  EXPECT_EQ(reader.remaining(), 1u);
  return buffer;
}

// putNormals and the like for vectors.
template <typename Put, typename... Arguments>
auto putVectors(const Put& put, Arguments... arguments) {
  return [=](PayloadWriter& writer, std::span<const glm::vec3> vectors) {
    put(writer, AxisColumns(vectors).axes(), arguments...);
  };
}

template <typename Get>
auto getVectors(const Get& get) {
  return [=](PayloadReader& reader, std::span<glm::vec3> vectors) {
    AxisColumns columns(vectors.size());
    if (!get(reader, columns.mutableAxes())) return false;
    for (std::size_t i = 0; i < vectors.size(); ++i) {
      vectors[i] = {columns.values[0][i], columns.values[1][i], columns.values[2][i]};
    }
    return true;
  };
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
      roundTrip(values, putVectors(putPositions, max_error, false), getVectors(getPositions));
      // A position is a float again in the end: half a unit in the last place on each axis
      const float rounding = 0x1p-24f * glm::length(glm::abs(offset) + 1.f);
      for (std::size_t i = 0; i < values.size(); ++i) {
        ASSERT_LE(glm::length(values[i] - expected[i]), max_error > 0 ? max_error + rounding : 0);
      }
    }
  }
}

TEST(ColumnCodec, PositionsOfAnyExtentComeBack) {
  for (const float scale : {0.f, 1e-40f, 1e-30f, 1e12f, 1e38f, kLargest}) {
    std::vector<glm::vec3> values = randomPoints(50, scale);
    values.push_back(-values.back());
    const std::vector<glm::vec3> expected = values;
    roundTrip(values, putVectors(putPositions, scale * 1e-3f, false), getVectors(getPositions));
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
  roundTrip(points, putVectors(putPositions, 1.f, true), getVectors(getPositions));
  EXPECT_EQ(points, expected_points);
  roundTrip(points, putVectors(putColors, true), getVectors(getColors));
  EXPECT_EQ(points, expected_points);
  roundTrip(points, putVectors(putReflectances, true), getVectors(getReflectances));
  EXPECT_EQ(points, expected_points);
  roundTrip(normals, putVectors(putNormals, true), getVectors(getNormals));
  EXPECT_EQ(normals, expected_normals);
  roundTrip(
      positive, [](PayloadWriter& w, auto& v) { putPositive(w, v, Rounding::kUp, true); },
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
          values, [&](PayloadWriter& w, auto& v) { putPositive(w, v, rounding, false); },
          getPositive);
      // A step is at most twice a 65535th of the range
      const float step = 2 * range / 65535 + 1e-9f;
      const float below = rounding == Rounding::kUp ? 0 : step / 2;
      const float above = rounding == Rounding::kUp ? step : step / 2;
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
        values, [&](PayloadWriter& w, auto& v) { putPositive(w, v, rounding, false); },
        getPositive);
    EXPECT_EQ(values, expected);
    for (const float value : {kLargest, kSmallest, 1e-45f, 1.f}) {
      values.assign(3, value);
      roundTrip(
          values, [&](PayloadWriter& w, auto& v) { putPositive(w, v, rounding, false); },
          getPositive);
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
  roundTrip(values, putVectors(putNormals, false), getVectors(getNormals));
  for (std::size_t i = 0; i < values.size(); ++i) {
    ASSERT_LE(glm::length(values[i] - expected[i]), 1e-4f) << i;
    ASSERT_NEAR(glm::length(values[i]), 1, 1e-6f);
  }
}

TEST(ColumnCodec, NormalsAlongAnAxisAreExact) {
  std::vector<glm::vec3> values = {{1, 0, 0},  {0, 1, 0},  {0, 0, 1},
                                   {-1, 0, 0}, {0, -1, 0}, {0, 0, -1}};
  const std::vector<glm::vec3> expected = values;
  roundTrip(values, putVectors(putNormals, false), getVectors(getNormals));
  EXPECT_EQ(values, expected);
}

TEST(ColumnCodec, ZeroNormalComesBackAsAUnitVector) {
  std::vector<glm::vec3> values(4, glm::vec3(0));
  roundTrip(values, putVectors(putNormals, false), getVectors(getNormals));
  for (const glm::vec3& value : values) EXPECT_NEAR(glm::length(value), 1, 1e-6f);
}

TEST(ColumnCodec, ColorsKeepElevenBitsAtAnyScale) {
  for (const float scale : {1e-38f, 1e-20f, 1.f, 1000.f, 1e12f, 1e30f}) {
    std::vector<glm::vec3> values = randomPoints(300, scale);
    values.push_back(glm::vec3(0));
    const std::vector<glm::vec3> expected = values;
    roundTrip(values, putVectors(putColors, false), getVectors(getColors));
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
  roundTrip(values, putVectors(putColors, false), getVectors(getColors));
  EXPECT_NEAR(values[0].x, kLargest, kLargest * 0x1p-10f);
}

TEST(ColumnCodec, BlackTakesOneByte) {
  std::vector<glm::vec3> values(100, glm::vec3(0));
  const Buffer buffer = roundTrip(values, putVectors(putColors, false), getVectors(getColors));
  EXPECT_EQ(buffer.size(), 9u);  // with the 8 of the payload
  values.assign(100, glm::vec3(1));
  PayloadReader reader(buffer);
  ASSERT_TRUE(getVectors(getColors)(reader, values));
  EXPECT_EQ(values, std::vector<glm::vec3>(100, glm::vec3(0)));
}

TEST(ColumnCodec, ReflectancesStayWithinHalfAStepOfTheirRoots) {
  std::vector<glm::vec3> values = randomPoints(500);
  values.push_back({0, 1, 7});
  const std::vector<glm::vec3> expected = values;
  roundTrip(values, putVectors(putReflectances, false), getVectors(getReflectances));
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
      values, [](PayloadWriter& w, auto& v) { putSigned(w, v, 4); },
      [](PayloadReader& r, std::span<float> v) { return getSigned(r, v, 4); });
  for (std::size_t i = 0; i < values.size(); ++i) {
    ASSERT_NEAR(values[i], std::clamp(expected[i], -4.f, 4.f), 2.f / 32767 + 1e-6f);
  }
}

TEST(ColumnCodec, SmallIntegersAreExact) {
  std::vector<std::int16_t> values = {0, 1, -1, 32767, -32768, 255, -256};
  const std::vector<std::int16_t> expected = values;
  roundTrip(
      values, [](PayloadWriter& w, auto& v) { putSmallIntegers(w, v); }, getSmallIntegers);
  EXPECT_EQ(values, expected);
}

// Numbers of records that are no multiple of what a loop takes at once.
TEST(ColumnCodec, AnyNumberOfRecordsComesBack) {
  for (std::size_t count = 0; count < 70; ++count) {
    TestRandom random(static_cast<std::uint32_t>(count));
    std::vector<std::uint64_t> counts;
    std::vector<float> numbers;
    for (std::size_t i = 0; i < count; ++i) {
      counts.push_back(random.bits() >> 8);
      numbers.push_back(std::bit_cast<float>(0x3f800000 + (random.bits() & 0xffff)));
    }
    const std::vector<std::uint64_t> expected_counts = counts;
    const std::vector<float> expected_numbers = numbers;
    roundTrip(
        counts, [](PayloadWriter& w, auto& v) { putCounts(w, v); }, getCounts);
    EXPECT_EQ(counts, expected_counts);
    roundTrip(
        numbers, [](PayloadWriter& w, auto& v) { putPositive(w, v, Rounding::kNearest, false); },
        getPositive);
    EXPECT_EQ(numbers, expected_numbers);
  }
}

TEST(ColumnCodec, NoiseGoesToThePlainPartAndRepetitionToThePackedOne) {
  TestRandom random(4);
  std::vector<std::uint64_t> noise(500), runs(500);
  for (std::size_t i = 0; i < noise.size(); ++i) {
    noise[i] = random.bits() & 0xffff;
    runs[i] = 40000 + i / 100;
  }
  Buffer buffer;
  PayloadWriter noise_writer(buffer, 500);
  putCounts(noise_writer, noise);
  EXPECT_EQ(noise_writer.finish(), 8u + 2);
  EXPECT_EQ(buffer.size(), 8u + 2 + 1000);
  PayloadWriter runs_writer(buffer, 500);
  putCounts(runs_writer, runs);
  EXPECT_EQ(runs_writer.finish(), buffer.size());
}

TEST(ColumnCodec, CountsAreExactAtAnyWidth) {
  for (int bits = 0; bits <= 64; ++bits) {
    const std::uint64_t largest = bits == 64 ? ~std::uint64_t{0} : (std::uint64_t{1} << bits) - 1;
    std::vector<std::uint64_t> values = {0, largest, largest / 2, largest / 3};
    const std::vector<std::uint64_t> expected = values;
    roundTrip(
        values, [](PayloadWriter& w, auto& v) { putCounts(w, v); }, getCounts);
    EXPECT_EQ(values, expected);
  }
}

TEST(ColumnCodec, BytesAndFloatsAreExact) {
  std::vector<std::uint8_t> bytes = {0, 1, 128, 255};
  roundTrip(
      bytes, [](PayloadWriter& w, auto& v) { putBytes8(w, v); }, getBytes8);
  EXPECT_EQ(bytes, (std::vector<std::uint8_t>{0, 1, 128, 255}));
  std::vector<float> floats = {0, -1, kLargest, 1e-45f};
  roundTrip(
      floats, [](PayloadWriter& w, auto& v) { putFloats(w, v); }, getFloats);
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
    // A sound beginning: records, bytes of the packed part; then a form or a width
    Buffer buffer(8 + random.bits() % 80);
    for (std::byte& byte : buffer) byte = static_cast<std::byte>(random.bits());
    const auto packed = static_cast<std::uint32_t>(8 + random.bits() % (buffer.size() - 7));
    std::memcpy(&buffer[4], &packed, sizeof packed);
    if (buffer.size() > 8) buffer[8] = static_cast<std::byte>(random.bits() % 6);
    PayloadReader positions(buffer), normals(buffer), colors(buffer), reflectances(buffer);
    if (getVectors(getPositions)(positions, vectors)) {
      ASSERT_TRUE(std::all_of(vectors.begin(), vectors.end(), isFinite));
    }
    if (getVectors(getNormals)(normals, vectors)) {
      ASSERT_TRUE(std::all_of(vectors.begin(), vectors.end(), isFinite));
    }
    if (getVectors(getColors)(colors, vectors)) {
      ASSERT_TRUE(std::all_of(vectors.begin(), vectors.end(), isColor));
    }
    if (getVectors(getReflectances)(reflectances, vectors)) {
      ASSERT_TRUE(std::all_of(vectors.begin(), vectors.end(), isColor));
    }
    PayloadReader positive(buffer);
    if (getPositive(positive, numbers)) {
      for (const float v : numbers) ASSERT_TRUE(v > 0 && std::isfinite(v));
    }
  }
}

}  // namespace
}  // namespace surfeit
