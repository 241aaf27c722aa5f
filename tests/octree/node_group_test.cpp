#include "octree/page/node_group.h"

#include <gtest/gtest.h>

#include <algorithm>

#include "core/curve_key.h"
#include "octree/node/hidden_layers.h"
#include "octree/node/node_sums.h"
#include "octree/page/node_bounds.h"
#include "octree/test_scenes.h"

namespace surfeit {
namespace {

// One page on level 0, ten on each of levels 1 to 5.
class NodeGroupTest : public testing::Test {
 protected:
  NodeGroupTest() {
    for (std::uint32_t level = 0; level < kCurveLevels + 2; ++level) {
      first_page_[level] = level == 0 ? 0 : 1 + 10 * std::min(level - 1, 5u);
    }
  }

  // Nodes of level 1: leaves and parents of nodes on level 2, flat ones, rough ones, and some with
  // 2 to 6 facets.
  static std::vector<LevelNode> someNodes(std::size_t count) {
    std::vector<LevelNode> nodes;
    for (std::size_t i = 0; i < count; ++i) {
      NodeSums sums;
      const auto seed = static_cast<std::uint32_t>(i);
      std::vector<Surfel> cloud = i % 3 == 0 ? planeCloud(4, 0.1f) : randomCloud(9, seed);
      if (i % 4 == 3) cloud = boxCloud(3, 0.1f, 2 + int(i / 4 % 5));
      for (const Surfel& surfel : cloud) sums.add(surfel);
      LevelNode node{sums.toNode(0.97f, radiusOfBox(sums.centre(), sums.disk_bounds))};
      boundSurfels(cloud, node);
      node.node.page = seed % 10;
      node.node.first = static_cast<std::uint16_t>(i);
      if (i % 2 == 0) {
        node.child_level = 2;
        node.node.child_count = static_cast<std::uint8_t>(2 + i % 7);
      }
      nodes.push_back(node);
    }
    return nodes;
  }

  Result<std::uint32_t> decode(Bytes payload, const PageForm& form, std::uint32_t page = 1) {
    return decodeNodeGroup(payload, form, page, {first_page_, 10, 128, 512}, found_);
  }

  Result<std::uint32_t> storeAndRead(std::span<const LevelNode> nodes, const PageForm& form) {
    std::vector<std::byte> payload;
    encodeNodeGroup(nodes, form, payload);
    return decode(payload, form);
  }

  static constexpr PageForm kQuantized = {}, kFull = {true};
  static constexpr PageForm kVersionOne = {.has_bounds = false};
  static constexpr PageForm kForms[] = {
      kQuantized, kFull, {false, true, true}, {true, true, true}, kVersionOne};

  std::uint32_t first_page_[kCurveLevels + 2];
  std::vector<Node> found_ = std::vector<Node>(128);
};

TEST_F(NodeGroupTest, FullPrecisionIsExact) {
  const std::vector<LevelNode> nodes = someNodes(50);
  std::vector<std::byte> payload;
  encodeNodeGroup(nodes, kFull, payload);
  const Result<std::uint32_t> count = decode(payload, kFull);
  ASSERT_TRUE(count.ok()) << count.status().message();
  ASSERT_EQ(*count, nodes.size());
  for (std::size_t i = 0; i < nodes.size(); ++i) {
    const Node& a = nodes[i].node;
    const Node& b = found_[i];
    EXPECT_EQ(a.position, b.position);
    EXPECT_EQ(a.radius, b.radius);
    EXPECT_EQ(a.normal, b.normal);
    EXPECT_EQ(a.area, b.area);
    EXPECT_EQ(a.radiosity, b.radiosity);
    EXPECT_EQ(a.flatness, b.flatness);
    EXPECT_EQ(a.first, b.first);
    EXPECT_EQ(a.flags, b.flags);
    EXPECT_EQ(a.child_count, b.child_count);
    EXPECT_EQ(a.surfel_count, b.surfel_count);
    // Pages count within the level of the children in the file, and through it afterwards
    EXPECT_EQ(b.page, a.isLeaf() ? a.page : a.page + first_page_[2]);
    EXPECT_EQ(a.covariance.entries, b.covariance.entries);
    ASSERT_EQ(a.facet_count, b.facet_count);
    if (a.hasFacets()) {
      EXPECT_EQ(a.facets, b.facets);
      continue;
    }
    EXPECT_EQ(a.rough.sh, b.rough.sh);
    EXPECT_EQ(a.rough.front_moment, b.rough.front_moment);
    EXPECT_EQ(a.rough.area_band_4, b.rough.area_band_4);
  }
}

TEST_F(NodeGroupTest, QuantizedNodesAreCloseAndHoldWhatTheyHeld) {
  const std::vector<LevelNode> nodes = someNodes(100);
  ASSERT_TRUE(storeAndRead(nodes, kQuantized).ok());
  for (std::size_t i = 0; i < nodes.size(); ++i) {
    const Node& a = nodes[i].node;
    const Node& b = found_[i];
    const float moved = glm::length(a.position - b.position);
    EXPECT_LE(moved, 1.01e-3f * a.radius);
    EXPECT_GE(b.radius * 1.000001f, a.radius + moved);
    EXPECT_LE(b.radius, a.radius * 1.01f);
    EXPECT_NEAR(a.area, b.area, 1e-3f * a.area);
    EXPECT_LE(glm::length(a.normal - b.normal), 1e-4f);
    EXPECT_NEAR(a.flatness, b.flatness, 2e-5f);
    for (std::size_t k = 0; k < a.facet_count; ++k) {
      NodeFacet facet = b.facets[k];
      EXPECT_LE(glm::length(facet.radiosity - a.facets[k].radiosity),
                1e-3f * glm::length(a.facets[k].radiosity));
      facet.radiosity = a.facets[k].radiosity;
      EXPECT_EQ(facet, a.facets[k]);
    }
    if (!a.isRough()) continue;
    for (std::size_t k = 0; k < kShCount; ++k) {
      EXPECT_NEAR(a.rough.sh[k][kAreaKind], b.rough.sh[k][kAreaKind], 2e-3f * a.area);
      for (int c = 0; c < 3; ++c) {
        EXPECT_NEAR(a.rough.sh[k][powerKind(c)], b.rough.sh[k][powerKind(c)],
                    4e-3f * a.area * a.radiosity[c]);
      }
    }
  }
}

TEST_F(NodeGroupTest, QuantizedMomentsAreClose) {
  const std::vector<LevelNode> nodes = someNodes(100);
  ASSERT_TRUE(storeAndRead(nodes, kQuantized).ok());
  for (std::size_t i = 0; i < nodes.size(); ++i) {
    const Node& a = nodes[i].node;
    const Node& b = found_[i];
    const float trace = a.covariance.trace();
    ASSERT_GT(trace, 0);
    EXPECT_NEAR(std::sqrt(b.covariance.trace() / trace), 1,
                .5f / 255 * a.radius / std::sqrt(trace) + 2e-3f);
    for (std::size_t k = 0; k < SymmetricMatrix::kEntries; ++k) {
      EXPECT_NEAR(a.covariance.entries[k] / trace, b.covariance.entries[k] / b.covariance.trace(),
                  5e-3f);
    }
    if (!a.isRough()) continue;
    for (std::size_t k = 0; k < kShCount; ++k) {
      EXPECT_NEAR(a.rough.area_band_4[k], b.rough.area_band_4[k], .012f * a.area);
    }
    for (std::size_t row = 0; row < 3; ++row) {
      for (int column = 0; column < 3; ++column) {
        EXPECT_NEAR(a.rough.front_moment[row][column], b.rough.front_moment[row][column],
                    6e-3f * a.area * a.radius);
      }
    }
  }
}

TEST_F(NodeGroupTest, MomentsOfEnormousNodesStayNumbers) {
  for (const PageForm& form : {kQuantized, kFull}) {
    NodeSums sums;
    for (Surfel surfel : moved(sphereCloud(2000), 1e12f, glm::vec3(0))) {
      surfel.radiosity = glm::vec3(0);
      surfel.area = 1e24f;
      sums.add(surfel);
    }
    sums.facets.giveUp();
    LevelNode node{sums.toNode(0.97f, 1.1e12f)};
    const Result<std::uint32_t> count = storeAndRead(std::span(&node, 1), form);
    ASSERT_TRUE(count.ok()) << count.status().message();
    for (const glm::vec3& row : found_[0].rough.front_moment) {
      EXPECT_TRUE(std::isfinite(row.x) && std::isfinite(row.y) && std::isfinite(row.z));
    }
  }
}

TEST_F(NodeGroupTest, PagesOfVersionOneHaveNoBounds) {
  const std::vector<LevelNode> nodes = someNodes(20);
  std::vector<std::byte> payload, with_bounds;
  encodeNodeGroup(nodes, kVersionOne, payload);
  encodeNodeGroup(nodes, kQuantized, with_bounds);
  EXPECT_EQ(payload.size() + 2 * nodes.size(), with_bounds.size());
  ASSERT_TRUE(decode(payload, kVersionOne).ok());
  for (const Node& node : std::span(found_).first(nodes.size())) {
    EXPECT_EQ(node.thickness, node.radius);
    EXPECT_EQ(node.normal_cosine, -1);
  }
}

TEST_F(NodeGroupTest, ReplacingRadiosityByItselfChangesNoByte) {
  for (PageForm form : kForms) {
    form.has_variances = form.has_slopes = true;
    std::vector<std::byte> payload, replaced;
    encodeNodeGroup(someNodes(50), form, payload);
    ASSERT_TRUE(decode(payload, form).ok());
    ASSERT_TRUE(replaceNodeRadiosity(payload, form, std::span(found_).first(50), replaced).ok());
    EXPECT_EQ(replaced, payload);
  }
}

TEST_F(NodeGroupTest, DecodeRejectsMomentsOfNoSuchNode) {
  for (const int moment : {0, 1, 2}) {
    std::vector<LevelNode> nodes = someNodes(5);
    Node& node = nodes[1].node;
    ASSERT_TRUE(node.isRough());
    if (moment == 2) {
      node.rough.area_band_4[4] = 2.6f * node.area;
    } else if (moment == 1) {
      node.rough.front_moment[2].x = 1.1f * node.area * node.radius;
    } else {
      node.covariance.entries[4] = -1.1f * node.radius * node.radius;
    }
    const Status status = storeAndRead(nodes, kFull).status();
    EXPECT_EQ(status.code(), StatusCode::kCorruption);
    EXPECT_NE(status.message().find("field moments"), std::string::npos) << status.message();
  }
}

TEST_F(NodeGroupTest, DecodeRejectsFacetsOfNoSuchNode) {
  for (const bool too_many : {false, true}) {
    std::vector<LevelNode> nodes = someNodes(5);
    Node& node = nodes[3].node;
    ASSERT_EQ(node.facet_count, 2);
    if (too_many) node.facet_count = kMostFacets + 1;
    if (!too_many) node.flags = kNodeFlat;
    const Status status = storeAndRead(nodes, kFull).status();
    EXPECT_EQ(status.code(), StatusCode::kCorruption);
    EXPECT_NE(status.message().find("field facets"), std::string::npos) << status.message();
  }
}

TEST_F(NodeGroupTest, HiddenSidesAreKeptAndThoseOfNoSuchPieceRejected) {
  for (const PageForm& form : kForms) {
    std::vector<LevelNode> nodes = someNodes(20);
    ASSERT_TRUE(nodes[0].node.isFlat() && nodes[3].node.hasFacets());
    nodes[0].node.hidden = kHiddenFront;
    nodes[3].node.facets[1].hidden = kHiddenFront;
    const Status status = storeAndRead(nodes, form).status();
    ASSERT_TRUE(status.ok()) << status.message();
    for (std::size_t i = 0; i < nodes.size(); ++i) {
      EXPECT_EQ(found_[i].hidden, i == 0 ? kHiddenFront : 0);
      for (std::size_t k = 0; k < found_[i].facet_count; ++k) {
        EXPECT_EQ(found_[i].facets[k].hidden, i == 3 && k == 1 ? kHiddenFront : 0);
      }
    }
    // Nothing stays of what was there before
    ASSERT_TRUE(storeAndRead(someNodes(20), form).ok());
    for (const Node& node : std::span(found_).first(20)) EXPECT_EQ(node.hidden, 0);
    // A one-sided piece has no back
    for (const int wrong : {int(kHiddenBack), int(kHiddenSides), 4}) {
      nodes[0].node.hidden = std::uint8_t(wrong);
      const Status rejected = storeAndRead(nodes, form).status();
      EXPECT_EQ(rejected.code(), StatusCode::kCorruption);
      EXPECT_NE(rejected.message().find("field facets"), std::string::npos) << rejected.message();
    }
  }
}

TEST_F(NodeGroupTest, FlagsOfTwoSidedPiecesAreKeptAndThoseOfOthersRejected) {
  for (const bool is_last : {true, false}) {
    for (const std::size_t i : {0u, 1u, 3u}) {
      std::vector<LevelNode> nodes = someNodes(5);
      Node& node = nodes[i].node;
      const std::size_t pieces = node.isFlat() ? 1 : node.facet_count;
      if (is_last && pieces == 0) continue;
      node.flags |= std::uint8_t(kNodeTwoSided << (is_last ? pieces - 1 : pieces));
      const Status status = storeAndRead(nodes, kFull).status();
      if (is_last) {
        ASSERT_TRUE(status.ok()) << status.message();
        EXPECT_TRUE(found_[i].isTwoSided(pieces - 1));
        EXPECT_EQ(found_[i].flags, node.flags);
      } else {
        EXPECT_EQ(status.code(), StatusCode::kCorruption);
        EXPECT_NE(status.message().find("field flags"), std::string::npos) << status.message();
      }
    }
  }
}

TEST_F(NodeGroupTest, GroupsAreExactOrTheFirstAlone) {
  std::vector<LevelNode> nodes = someNodes(40);
  TestRandom random(23);
  for (LevelNode& node : nodes) {
    node.node.groups = std::uint64_t{random.bits()} << 32 | random.bits() | 1;
  }
  for (const PageForm& form : kForms) {
    std::vector<std::byte> payload;
    encodeNodeGroup(nodes, form, payload);
    ASSERT_TRUE(decode(payload, form).ok());
    for (std::size_t i = 0; i < nodes.size(); ++i) {
      EXPECT_EQ(found_[i].groups, form.has_groups ? nodes[i].node.groups : groupBit(0));
    }
  }
}

TEST_F(NodeGroupTest, DecodeRejectsNodesWithoutAnyGroup) {
  std::vector<LevelNode> nodes = someNodes(5);
  nodes[3].node.groups = 0;
  std::vector<std::byte> payload;
  encodeNodeGroup(nodes, {false, false, true}, payload);
  const Status status = decode(payload, {false, false, true}).status();
  EXPECT_EQ(status.code(), StatusCode::kCorruption);
  EXPECT_NE(status.message().find("field groups"), std::string::npos) << status.message();
}

TEST_F(NodeGroupTest, DecodeRejectsEveryTruncationAndExtension) {
  for (const PageForm& form : kForms) {
    std::vector<std::byte> payload;
    encodeNodeGroup(someNodes(20), form, payload);
    for (std::size_t size = 0; size < payload.size(); ++size) {
      ASSERT_EQ(decode(Bytes(payload).first(size), form).status().code(), StatusCode::kCorruption)
          << size;
    }
    payload.push_back(std::byte{0});
    EXPECT_EQ(decode(payload, form).status().code(), StatusCode::kCorruption);
  }
}

TEST_F(NodeGroupTest, ChildrenNeverLieOnTheirParentsLevelOrAbove) {
  std::vector<std::byte> payload;
  encodeNodeGroup(someNodes(3), kQuantized, payload);
  EXPECT_TRUE(decode(payload, kQuantized, 1).ok());    // level 1 points at level 2
  EXPECT_TRUE(decode(payload, kQuantized, 10).ok());   // the last page of level 1
  EXPECT_FALSE(decode(payload, kQuantized, 11).ok());  // level 2 at itself
  EXPECT_FALSE(decode(payload, kQuantized, 35).ok());  // level 4 at one above
}

TEST_F(NodeGroupTest, DamagedPayloadsDecodeToValidNodesOrNot) {
  TestRandom random(22);
  for (const PageForm& form : kForms) {
    std::vector<std::byte> payload;
    encodeNodeGroup(someNodes(6), form, payload);
    int decoded = 0;
    for (int i = 0; i < 50000; ++i) {
      std::vector<std::byte> damaged = payload;
      for (std::uint32_t k = 1 + random.bits() % 6; k > 0; --k) {
        damaged[random.bits() % damaged.size()] = static_cast<std::byte>(random.bits());
      }
      const Result<std::uint32_t> count = decode(damaged, form);
      if (!count.ok()) {
        ASSERT_EQ(count.status().code(), StatusCode::kCorruption);
        continue;
      }
      ++decoded;
      for (const Node& node : std::span(found_).first(*count)) {
        ASSERT_TRUE(node.radius > 0 && node.area > 0 && node.surfel_count <= 5120u * 1000);
        ASSERT_TRUE(node.flatness >= 0 && node.flatness <= 1);
        ASSERT_TRUE(node.thickness >= 0 && node.thickness <= node.radius);
        ASSERT_TRUE(node.normal_cosine >= -1 && node.normal_cosine <= 1);
        ASSERT_NE(node.groups, 0u);
        for (const float entry : node.covariance.entries) ASSERT_TRUE(std::isfinite(entry));
        if (node.isLeaf()) {
          ASSERT_LT(node.page, 10u);
          ASSERT_LT(node.first, 512);
        } else {
          ASSERT_GE(node.page, first_page_[2]);
          ASSERT_LT(node.page, first_page_[kCurveLevels + 1]);
          ASSERT_LE(node.first + node.child_count, 128);
        }
        for (std::size_t k = 0; k < node.facet_count; ++k) {
          const Facet facet = node.facet(k);
          ASSERT_TRUE(std::isfinite(facet.radius) && facet.area >= 0);
          ASSERT_GE(std::min({facet.radiosity.x, facet.radiosity.y, facet.radiosity.z}), 0);
        }
        if (node.hasFacets()) continue;
        for (const glm::vec3& row : node.rough.front_moment) {
          ASSERT_TRUE(std::isfinite(row.x) && std::isfinite(row.y) && std::isfinite(row.z));
        }
        for (const float value : node.rough.area_band_4) ASSERT_TRUE(std::isfinite(value));
        for (int c = 0; c < 3; ++c) {
          ASSERT_TRUE(std::isfinite(node.position[c]) && node.radiosity[c] >= 0);
          for (const float k : node.rough.coefficients(powerKind(c))) ASSERT_TRUE(std::isfinite(k));
        }
      }
    }
    EXPECT_GT(decoded, 1000);
  }
}

}  // namespace
}  // namespace surfeit
