// Every column of a page is looked at when it is read: a page that ends within one, or holds there
// what cannot be, is refused by the name of that column and by no later one.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstddef>
#include <span>
#include <string>
#include <vector>

#include "octree/node/hidden_layers.h"
#include "octree/node/lobe.h"
#include "octree/node/node_sums.h"
#include "octree/page/column_codec.h"
#include "octree/page/node_bounds.h"
#include "octree/page/node_group.h"
#include "octree/page/surfel_group.h"
#include "octree/payload_cuts.h"
#include "octree/test_scenes.h"

namespace surfeit {
namespace {

using testing::ElementsAreArray;
using testing::HasSubstr;

using Payload = std::vector<std::byte>;
using Messages = std::vector<std::string>;

constexpr PageForm kAllColumns = {.has_albedo = true,
                                  .has_groups = true,
                                  .has_long_sides = true,
                                  .has_opacity = true,
                                  .has_lobes = true,
                                  .has_tints = true};

PageForm exact(PageForm form) {
  form.full_precision = true;
  return form;
}

Messages damagedFields(const std::string& page, const std::vector<const char*>& fields) {
  Messages messages;
  for (const char* field : fields) messages.push_back(page + ": damaged field " + field);
  return messages;
}

// Few enough that no column looks like noise: all are in the packed part.
std::vector<Surfel> fewSurfels() {
  std::vector<Surfel> cloud = inGroups(withLongSides(randomCloud(6)), 4);
  cloud[3].setOpacity(.995, .4, .7);
  return cloud;
}

class SurfelPageFields : public testing::Test {
 protected:
  static Payload encode(const std::vector<Surfel>& cloud, const PageForm& form) {
    Payload payload;
    encodeSurfelGroup(cloud, form, payload);
    return payload;
  }
  Status decode(std::span<const std::byte> payload, const PageForm& form) {
    return decodeSurfelGroup(payload, form, found_).status();
  }
  Status relight(std::span<const std::byte> payload, const PageForm& form, std::size_t count = 6) {
    const std::vector<glm::vec3> light(count, glm::vec3(1));
    Payload replaced;
    return replaceSurfelRadiosity(payload, form, light, replaced).status();
  }
  void expectCuts(const PageForm& form, const std::vector<const char*>& fields) {
    const Payload payload = encode(fewSurfels(), form);
    const Messages expected = damagedFields("surfel group", fields);
    EXPECT_THAT(messagesOfCuts(payload, [&](auto cut) { return decode(cut, form); }),
                ElementsAreArray(expected));
    EXPECT_THAT(messagesOfCuts(payload, [&](auto cut) { return relight(cut, form); }),
                ElementsAreArray(expected));
  }

  std::vector<Surfel> found_ = std::vector<Surfel>(64);
};

TEST_F(SurfelPageFields, PageThatEndsWithinOneIsToldByItsName) {
  for (const bool is_exact : {false, true}) {
    const auto form = [&](PageForm of) { return is_exact ? exact(of) : of; };
    expectCuts(form(kAllColumns),
               {"flags", "position", "normal", "radius", "area", "radiosity", "albedo", "group",
                "long_side", "transparency", "tint", "lobes"});
    // Each of those that some pages lack is the last one, too
    std::vector<const char*> all = {"flags", "position", "normal", "radius", "area", "radiosity"};
    const auto with = [&](const char* last) {
      std::vector<const char*> fields = all;
      fields.push_back(last);
      return fields;
    };
    expectCuts(form({}), all);
    expectCuts(form({.has_albedo = true}), with("albedo"));
    expectCuts(form({.has_groups = true}), with("group"));
    expectCuts(form({.has_long_sides = true}), with("long_side"));
    expectCuts(form({.has_opacity = true}), with("transparency"));
    expectCuts(form({.has_lobes = true}), with("lobes"));
    all.push_back("transparency");
    expectCuts(form({.has_opacity = true, .has_tints = true}), with("tint"));
  }
}

TEST_F(SurfelPageFields, ValuesThatThereAreNotAreToldByTheirName) {
  std::vector<Surfel> cloud = fewSurfels();
  cloud[2].flags = kSurfelSphere | 1u << 5;
  EXPECT_THAT(decode(encode(cloud, kAllColumns), kAllColumns).message(), HasSubstr("field flags"));
  cloud = fewSurfels();
  cloud[2].transparency = kMostTransparency + 1;
  EXPECT_THAT(decode(encode(cloud, kAllColumns), kAllColumns).message(),
              HasSubstr("field transparency"));
  for (const int color : {0, 1}) {
    cloud = fewSurfels();
    cloud[2].transparency = 40000;
    cloud[2].tint[std::size_t(color)] = 65535 - 40000;
    EXPECT_THAT(decode(encode(cloud, kAllColumns), kAllColumns).message(), HasSubstr("field tint"));
  }
}

TEST_F(SurfelPageFields, TintsComeBack) {
  const std::vector<Surfel> cloud = fewSurfels();
  ASSERT_TRUE(decode(encode(cloud, kAllColumns), kAllColumns).ok());
  for (std::size_t i = 0; i < cloud.size(); ++i) {
    for (int color = 0; color < 3; ++color) {
      EXPECT_EQ(found_[i].opacity(color), cloud[i].opacity(color)) << i;
    }
  }
  // Lit again, the page keeps them
  Payload replaced;
  const std::vector<glm::vec3> light(cloud.size(), glm::vec3(1));
  ASSERT_TRUE(
      replaceSurfelRadiosity(encode(cloud, kAllColumns), kAllColumns, light, replaced).ok());
  PageForm without_lobes = kAllColumns;
  without_lobes.has_lobes = false;
  ASSERT_TRUE(decode(replaced, without_lobes).ok());
  EXPECT_EQ(found_[3].tint, cloud[3].tint);
  EXPECT_TRUE(found_[3].isTinted());
}

TEST_F(SurfelPageFields, HeaderIsThatOfThePage) {
  Payload payload = encode(fewSurfels(), {});
  EXPECT_THAT(relight(payload, {}, 5).message(), HasSubstr("field number of surfels"));
  EXPECT_THAT(relight(payload, {}, 7).message(), HasSubstr("field number of surfels"));
  payload.push_back(std::byte{0});
  EXPECT_THAT(relight(payload, {}).message(), HasSubstr("field end"));
  payload.pop_back();
  for (const std::size_t bytes : {std::size_t{0}, std::size_t{7}, payload.size() + 1}) {
    setPackedBytes(payload, static_cast<std::uint32_t>(bytes));
    EXPECT_THAT(decode(payload, {}).message(), HasSubstr("bytes of the packed part")) << bytes;
    EXPECT_THAT(relight(payload, {}).message(), HasSubstr("number of surfels")) << bytes;
  }
}

TEST_F(SurfelPageFields, PagesHoldASurfel) {
  Payload payload;
  PayloadWriter writer(payload, 0);
  putPositions(writer, {}, 1, false);
  putNormals(writer, {}, false);
  for (int column = 0; column < 2; ++column) putPositive(writer, {}, Rounding::kNearest, true);
  putColors(writer, {}, false);
  writer.finish();
  EXPECT_EQ(decode(payload, {}).message(), "surfel group: 0 surfels, expected 1 to 64");
}

// One page on level 0, ten on each of the levels 1 to 5, as many of surfels.
class NodePageFields : public testing::Test {
 protected:
  NodePageFields() {
    for (std::uint32_t level = 0; level < kCurveLevels + 2; ++level) {
      first_page_[level] = level == 0 ? 0 : 1 + 10 * std::min(level - 1, 5u);
    }
    // A rough leaf, one with facets, and a flat one
    const std::vector<Surfel> clouds[] = {randomCloud(9), boxCloud(3, .1f, 3), planeCloud(4, .1f)};
    for (const std::vector<Surfel>& cloud : clouds) {
      NodeSums sums;
      for (const Surfel& surfel : cloud) sums.add(surfel);
      nodes_.push_back({sums.toNode(0.97f, radiusOfBox(sums.centre(), sums.disk_bounds))});
      boundSurfels(cloud, nodes_.back());
      nodes_.back().node.page = 3;
    }
  }

  Payload encode(const PageForm& form) const {
    Payload payload;
    encodeNodeGroup(nodes_, form, payload);
    return payload;
  }
  Status decode(std::span<const std::byte> payload, const PageForm& form) {
    return decodeNodeGroup(payload, form, 1, {first_page_, 10, 128, 512}, found_).status();
  }
  Status decodeEdited(const PageForm& form) { return decode(encode(form), form); }
  Status relight(std::span<const std::byte> payload, const PageForm& form, std::size_t count = 3) {
    Payload replaced;
    return replaceNodeRadiosity(payload, form, std::span(found_).first(count), replaced).status();
  }

  std::uint32_t first_page_[kCurveLevels + 2];
  std::vector<LevelNode> nodes_;
  std::vector<Node> found_ = std::vector<Node>(128);
};

constexpr PageForm kAllOfNodes = {.has_groups = true,
                                  .has_opacity = true,
                                  .has_lobes = true,
                                  .has_tints = true,
                                  .has_variances = true,
                                  .has_slopes = true};
const std::vector<const char*> kNodeFields = {
    "position", "radius",    "area",         "normal", "flatness",     "thickness",
    "cone",     "radiosity", "variance",     "flags",  "child count",  "child level",
    "page",     "first",     "surfel count", "groups", "transparency", "tint",
    "facets",   "moments",   "coefficients"};

TEST_F(NodePageFields, PageThatEndsWithinOneIsToldByItsName) {
  for (const PageForm& form : {kAllOfNodes, exact(kAllOfNodes)}) {
    const Payload payload = encode(form);
    std::vector<const char*> fields = kNodeFields;
    for (const char* field : {"facet radiosity", "coefficients", "lobes"}) fields.push_back(field);
    EXPECT_THAT(messagesOfCuts(payload, [&](auto cut) { return decode(cut, form); }),
                ElementsAreArray(damagedFields("node group", fields)));
  }
}

// What follows the coefficients of the area is replaced, and not read.
TEST_F(NodePageFields, RelitPageThatEndsWithinOneIsToldByItsName) {
  for (const PageForm& form : {kAllOfNodes, exact(kAllOfNodes)}) {
    const Payload payload = encode(form);
    ASSERT_TRUE(decode(payload, form).ok());
    Messages expected = damagedFields("node group", kNodeFields);
    expected.push_back("");
    EXPECT_THAT(messagesOfCuts(payload, [&](auto cut) { return relight(cut, form); }),
                ElementsAreArray(expected));
  }
}

// Their numbers and what they are made of are two columns of one name.
TEST_F(NodePageFields, EveryByteOfFacetsIsLookedAt) {
  constexpr std::size_t kNodes = 3, kFacets = 3;
  // Without hidden sides and with some, a byte for each facet and the flat node
  for (const bool has_hidden : {false, true}) {
    if (has_hidden) nodes_[1].node.facets[1].hidden = nodes_[2].node.hidden = kHiddenFront;
    const Payload payload = encode({});
    std::size_t told = 0;
    for (std::uint32_t bytes = kPayloadHeaderBytes; bytes < packedBytesOf(payload); ++bytes) {
      ASSERT_TRUE(decode(payload, {}).ok());
      told += decode(withPackedPart(payload, bytes), {}).message() ==
              "node group: damaged field facets";
    }
    EXPECT_EQ(told, kNodes + 1 + kFacets * (4 * 2 + 9) + (has_hidden ? kFacets + 1 : 0));
  }
}

TEST_F(NodePageFields, PageThatEndsWithinItsLastColumnIsRefused) {
  for (const PageForm& form : {PageForm{}, exact({})}) {
    const Payload payload = encode(form);
    const Messages messages = messagesOfCuts(payload, [&](auto cut) { return decode(cut, form); });
    EXPECT_EQ(messages.back(), "node group: damaged field coefficients");
  }
}

TEST_F(NodePageFields, ValuesThatThereAreNotAreToldByTheirName) {
  const PageForm opacity = {.has_opacity = true};
  nodes_[0].node.transparency = kMostTransparency + 1;
  EXPECT_THAT(decodeEdited(opacity).message(), HasSubstr("field transparency"));
  nodes_[0].node.transparency = 0;
  ASSERT_TRUE(nodes_[1].node.hasFacets());
  nodes_[1].node.facets[2].transparency = kMostTransparency + 1;
  EXPECT_THAT(decodeEdited(opacity).message(), HasSubstr("field facets"));

  const PageForm tints = {.has_opacity = true, .has_tints = true};
  nodes_[1].node.facets[2].transparency = 0;
  ASSERT_EQ(decodeEdited(tints).message(), "");
  nodes_[1].node.facets[2].tint = {0, 65535};
  EXPECT_THAT(decodeEdited(tints).message(), HasSubstr("field facets"));
  nodes_[1].node.facets[2].tint = {65534, 0};
  nodes_[0].node.tint = {65535, 0};
  EXPECT_THAT(decodeEdited(tints).message(), HasSubstr("field tint"));
  nodes_[0].node.tint = {65534, 3};
  ASSERT_EQ(decodeEdited(tints).message(), "");
  EXPECT_EQ(found_[0].tint, nodes_[0].node.tint);
  EXPECT_EQ(found_[1].facets[2].tint, nodes_[1].node.facets[2].tint);
}

TEST_F(NodePageFields, ReferencesToSurfelsStayInTheirPages) {
  const auto told = [&](std::uint32_t page, int first, std::uint64_t surfels) {
    nodes_[0].node.page = page;
    nodes_[0].node.first = static_cast<std::uint16_t>(first);
    nodes_[0].node.surfel_count = surfels;
    return std::string(decodeEdited({}).message());
  };
  EXPECT_EQ(told(9, 0, 512), "");
  EXPECT_EQ(told(9, 511, 1), "");
  EXPECT_THAT(told(10, 0, 1), HasSubstr("surfel reference"));
  EXPECT_THAT(told(9, 512, 1), HasSubstr("surfel reference"));
  EXPECT_THAT(told(9, 513, 1), HasSubstr("surfel reference"));
  EXPECT_THAT(told(9, 0, 0), HasSubstr("surfel reference"));
  EXPECT_THAT(told(9, 0, 513), HasSubstr("surfel count"));
  EXPECT_THAT(told(8, 1, 512), HasSubstr("surfel count"));
}

TEST_F(NodePageFields, HeaderIsThatOfThePage) {
  Payload payload = encode({});
  ASSERT_TRUE(decode(payload, {}).ok());
  EXPECT_THAT(relight(payload, {}, 2).message(), HasSubstr("field number of nodes"));
  EXPECT_THAT(relight(payload, {}, 4).message(), HasSubstr("field number of nodes"));
  for (const std::size_t bytes : {std::size_t{0}, std::size_t{7}, payload.size() + 1}) {
    setPackedBytes(payload, static_cast<std::uint32_t>(bytes));
    EXPECT_THAT(decode(payload, {}).message(), HasSubstr("bytes of the packed part")) << bytes;
    EXPECT_THAT(relight(payload, {}).message(), HasSubstr("number of nodes")) << bytes;
  }
  Payload none;
  encodeNodeGroup({}, {}, none);
  EXPECT_EQ(decode(none, {}).message(), "node group: 0 nodes, expected 1 to 128");
}

}  // namespace
}  // namespace surfeit
