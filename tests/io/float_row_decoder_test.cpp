#include "surfels/rows/float_row_decoder.h"

#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <limits>
#include <vector>

namespace surfeit {
namespace {

TEST(FloatRowDecoder, LeavesOverWhatIsNotPlainlyValidAndNothingElse) {
  constexpr std::size_t kRowBytes = 12;
  FloatRowDecoder decoder(kRowBytes);
  decoder.addFloat(0, offsetof(Surfel, radius), 1, 2);
  decoder.addFloat(4, offsetof(Surfel, normal), -10, 10);
  decoder.setTwoSided(8);
  std::vector<std::byte> rows(FloatRowDecoder::kBlockRows * kRowBytes);
  std::uint64_t expected = 0;
  for (std::size_t i = 0; i < FloatRowDecoder::kBlockRows; ++i) {
    float radius = 1.5f, normal = i % 2 == 0 ? 3.f : 0.f;
    if (i % 8 == 1) radius = std::numeric_limits<float>::quiet_NaN();
    if (i % 8 == 2) radius = std::nextafter(1.f, 0.f);
    if (i % 8 == 3) radius = std::nextafter(2.f, 3.f);
    if (i % 8 == 4) normal = 1e-7f;
    if (i % 8 == 5) radius = 1;
    if (i % 8 == 6) radius = 2;
    if (i % 8 >= 1 && i % 8 <= 4) expected |= std::uint64_t{1} << i;
    std::memcpy(&rows[i * kRowBytes], &radius, sizeof radius);
    std::memcpy(&rows[i * kRowBytes + 4], &normal, sizeof normal);
    rows[i * kRowBytes + 8] = std::byte(i);
  }
  std::vector<Surfel> surfels(FloatRowDecoder::kBlockRows);
  EXPECT_EQ(decoder.decode(rows.data(), surfels.size(), surfels.data()), expected);
  EXPECT_EQ(surfels[0].normal, glm::vec3(1, 0, 0));
  EXPECT_EQ(surfels[0].flags, 0u);
  EXPECT_EQ(surfels[7].flags, kSurfelSphere | kSurfelTwoSided);
  EXPECT_EQ(surfels[7].radius, 1.5f);

  // Rows behind the count are neither read nor written
  surfels[5].radius = 77;
  EXPECT_EQ(decoder.decode(rows.data(), 5, surfels.data()), expected & 31);
  EXPECT_EQ(surfels[5].radius, 77);
}

}  // namespace
}  // namespace surfeit
