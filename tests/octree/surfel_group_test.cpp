#include "octree/page/surfel_group.h"

#include <gtest/gtest.h>

#include <cstring>
#include <utility>

#include "octree/test_scenes.h"
#include "storage/page_codec.h"

namespace surfeit {
namespace {

constexpr PageForm kForms[] = {{},
                               {false, true},
                               {true, false},
                               {true, true},
                               {false, false, true},
                               {true, true, true},
                               {false, true, false, true}};

TEST(SurfelGroup, FullPrecisionIsExact) {
  const std::vector<Surfel> cloud = withLongSides(inGroups(randomCloud(300), kMaxGroups));
  std::vector<std::byte> payload;
  const PageForm all = {true, true, true, true};
  encodeSurfelGroup(cloud, all, payload);
  std::vector<Surfel> found(512);
  const Result<std::uint32_t> count = decodeSurfelGroup(payload, all, found);
  ASSERT_TRUE(count.ok()) << count.status().message();
  ASSERT_EQ(*count, cloud.size());
  EXPECT_EQ(std::memcmp(found.data(), cloud.data(), cloud.size() * sizeof(Surfel)), 0);
}

TEST(SurfelGroup, QuantizedSurfelsAreCloseToWhatTheyWere) {
  const std::vector<Surfel> cloud = randomCloud(300);
  std::vector<std::byte> payload;
  encodeSurfelGroup(cloud, {false, false}, payload);
  EXPECT_LT(payload.size(), cloud.size() * 26);
  std::vector<Surfel> found(300);
  ASSERT_TRUE(decodeSurfelGroup(payload, {false, false}, found).ok());
  for (std::size_t i = 0; i < cloud.size(); ++i) {
    // The error counts against the smallest radius of the group
    ASSERT_LE(glm::length(found[i].position - cloud[i].position), 1.01e-3f * cloud[i].radius);
    ASSERT_LE(glm::length(found[i].normal - cloud[i].normal), 1e-4f);
    ASSERT_EQ(found[i].flags, cloud[i].flags);
    ASSERT_EQ(found[i].albedo, glm::vec3(0));
    ASSERT_EQ(found[i].group, 0u);
    ASSERT_EQ(found[i].isSphere(), found[i].normal == glm::vec3(0));
  }
}

TEST(SurfelGroup, GroupsAreExactInEveryForm) {
  const std::vector<Surfel> cloud = inGroups(randomCloud(300), kMaxGroups);
  for (const bool full : {false, true}) {
    for (const bool has_albedo : {false, true}) {
      const PageForm form = {full, has_albedo, true};
      std::vector<std::byte> payload;
      encodeSurfelGroup(cloud, form, payload);
      std::vector<Surfel> found(300);
      ASSERT_TRUE(decodeSurfelGroup(payload, form, found).ok());
      for (std::size_t i = 0; i < cloud.size(); ++i) ASSERT_EQ(found[i].group, cloud[i].group);
    }
  }
}

TEST(SurfelGroup, LongSidesAreExactWhenQuantized) {
  const std::vector<Surfel> cloud = withLongSides(randomCloud(300));
  std::vector<std::byte> payload;
  encodeSurfelGroup(cloud, {false, true, false, true}, payload);
  std::vector<Surfel> found(300);
  ASSERT_TRUE(decodeSurfelGroup(payload, {false, true, false, true}, found).ok());
  for (std::size_t i = 0; i < cloud.size(); ++i) {
    ASSERT_EQ(found[i].long_side, cloud[i].long_side);
    ASSERT_EQ(found[i].elongation, cloud[i].elongation);
  }
}

TEST(SurfelGroup, DecodeRejectsLongSidesThatThereAreNot) {
  const PageForm form = {false, false, false, true};
  for (const auto& [direction, elongation] : {std::pair{0x0001, 0}, {0x0007, 3}}) {
    std::vector<Surfel> cloud = withLongSides(randomCloud(20));
    cloud[7].long_side = static_cast<std::uint16_t>(direction);
    cloud[7].elongation = static_cast<std::uint8_t>(elongation);
    std::vector<std::byte> payload;
    encodeSurfelGroup(cloud, form, payload);
    std::vector<Surfel> found(20);
    EXPECT_EQ(decodeSurfelGroup(payload, form, found).status().message(),
              "surfel group: damaged field long_side");
  }
}

TEST(SurfelGroup, DecodeRejectsSpheresThatShareAPieceOrAreTiles) {
  const PageForm form = {false, false, false, true};
  for (const auto& [tile, elongation] : {std::pair{0x0000, 64}, {0x8000, 0}}) {
    std::vector<Surfel> cloud = randomCloud(20), found(20);
    ASSERT_FALSE(cloud[7].isSphere());
    for (Surfel& surfel : cloud) {
      if (surfel.isSphere()) continue;
      surfel.long_side = static_cast<std::uint16_t>(tile);
      surfel.elongation = static_cast<std::uint8_t>(elongation);
    }
    std::vector<std::byte> payload;
    encodeSurfelGroup(cloud, form, payload);
    EXPECT_TRUE(decodeSurfelGroup(payload, form, found).ok());
    EXPECT_EQ(found[7].long_side, tile);
    cloud[7].flags = kSurfelSphere;
    payload.clear();
    encodeSurfelGroup(cloud, form, payload);
    EXPECT_EQ(decodeSurfelGroup(payload, form, found).status().message(),
              "surfel group: damaged field long_side");
  }
}

TEST(SurfelGroup, DecodeRejectsGroupsThatThereAreNot) {
  std::vector<Surfel> cloud = randomCloud(20);
  cloud[7].group = kMaxGroups;
  std::vector<std::byte> payload;
  encodeSurfelGroup(cloud, {false, true, true}, payload);
  std::vector<Surfel> found(64);
  const Status status = decodeSurfelGroup(payload, {false, true, true}, found).status();
  EXPECT_EQ(status.code(), StatusCode::kCorruption);
  EXPECT_NE(status.message().find("field group"), std::string::npos) << status.message();
}

TEST(SurfelGroup, DecodeRejectsEveryTruncationAndExtension) {
  for (const PageForm& form : kForms) {
    std::vector<std::byte> payload;
    encodeSurfelGroup(randomCloud(20), form, payload);
    std::vector<Surfel> found(64);
    for (std::size_t size = 0; size < payload.size(); ++size) {
      const auto status = decodeSurfelGroup(Bytes(payload).first(size), form, found).status();
      ASSERT_EQ(status.code(), StatusCode::kCorruption) << size;
    }
    payload.push_back(std::byte{0});
    EXPECT_EQ(decodeSurfelGroup(payload, form, found).status().code(), StatusCode::kCorruption);
  }
}

TEST(SurfelGroup, StoredPagesComeBackAndDamagedOnesDoNot) {
  for (const PageForm& form : kForms) {
    std::vector<std::byte> payload, stored;
    const std::size_t packed = encodeSurfelGroup(randomCloud(200), form, payload);
    EXPECT_LT(packed, payload.size());  // random surfels are mostly noise
    ASSERT_TRUE(compressPage(payload, packed, stored).ok());
    EXPECT_LT(stored.size(), payload.size());
    std::vector<std::byte> found(payload.size());
    ASSERT_TRUE(decompressPage(stored, found).ok());
    EXPECT_EQ(found, payload);
    // The frame is cut as well: the rest is counted from the end
    for (std::size_t size = 0; size < stored.size(); ++size) {
      ASSERT_EQ(decompressPage(Bytes(stored).first(size), found).code(), StatusCode::kCorruption);
    }
    stored.push_back(std::byte{0});
    EXPECT_EQ(decompressPage(stored, found).code(), StatusCode::kCorruption);
    stored.pop_back();
    std::vector<std::byte> short_payload(packed - 1);
    EXPECT_EQ(decompressPage(stored, short_payload).code(), StatusCode::kCorruption);
  }
}

TEST(SurfelGroup, EncodingDoesNotDependOnWhatTheThreadEncodedBefore) {
  std::vector<std::byte> expected, found, other;
  encodeSurfelGroup(randomCloud(100), {false, true}, expected);
  encodeSurfelGroup(randomCloud(512, 7), {true, true}, other);
  encodeSurfelGroup(randomCloud(100), {false, true}, found);
  EXPECT_EQ(found, expected);
}

TEST(SurfelGroup, DecodeRejectsMoreThanTheGroupHolds) {
  std::vector<std::byte> payload;
  encodeSurfelGroup(randomCloud(65), {false, false}, payload);
  std::vector<Surfel> found(64);
  EXPECT_EQ(decodeSurfelGroup(payload, {false, false}, found).status().code(),
            StatusCode::kCorruption);
}

TEST(SurfelGroup, DamagedPayloadsDecodeToValidSurfelsOrNot) {
  TestRandom random(21);
  for (const PageForm& form : kForms) {
    std::vector<std::byte> payload;
    encodeSurfelGroup(randomCloud(12), form, payload);
    std::vector<Surfel> found(64);
    for (int i = 0; i < 30000; ++i) {
      std::vector<std::byte> damaged = payload;
      for (std::uint32_t k = 1 + random.bits() % 6; k > 0; --k) {
        damaged[random.bits() % damaged.size()] = static_cast<std::byte>(random.bits());
      }
      const Result<std::uint32_t> count = decodeSurfelGroup(damaged, form, found);
      if (!count.ok()) {
        ASSERT_EQ(count.status().code(), StatusCode::kCorruption);
        continue;
      }
      ASSERT_LE(*count, found.size());
      for (const Surfel& surfel : std::span(found).first(*count)) {
        ASSERT_TRUE(surfel.radius > 0 && surfel.area > 0);
        ASSERT_TRUE(std::isfinite(glm::length(surfel.normal)));
        for (int c = 0; c < 3; ++c) {
          ASSERT_TRUE(std::isfinite(surfel.position[c]) && std::isfinite(surfel.radiosity[c]));
          ASSERT_TRUE(surfel.radiosity[c] >= 0 && surfel.albedo[c] >= 0);
        }
        ASSERT_LT(surfel.group, kMaxGroups);
      }
    }
  }
}

}  // namespace
}  // namespace surfeit
