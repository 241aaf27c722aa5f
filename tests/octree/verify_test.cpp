#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <cstdlib>
#include <cstring>
#include <limits>

#include "io/page_file_damage.h"
#include "octree/scene_damage.h"
#include "octree/test_scenes.h"
#include "surfeit/version.h"

namespace surfeit {
namespace {

using testing::AnyOf;
using testing::Contains;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::Not;

class VerifyTest : public SceneTest {
 protected:
  std::string smallScene(bool full_precision = false, std::size_t count = 40) {
    IndexOptions options;
    options.leaf_capacity = 4;
    options.full_precision = full_precision;
    return index(randomCloud(count), kAllChannels, options);
  }

  // Whether the checker and the reader both see that `bytes` are damaged.
  testing::AssertionResult noticed(const std::string& bytes) {
    replaceContents(path("damaged.sft"), bytes);
    const std::vector<std::string> findings = findingsOf(path("damaged.sft"));
    if (findings.empty()) return testing::AssertionFailure() << "verify finds nothing";
    if (findings[0].find("damaged.sft: ") == std::string::npos) {
      return testing::AssertionFailure() << findings[0];
    }
    const Result<ReadScene> scene = readScene(path("damaged.sft"));
    if (scene.ok()) return testing::AssertionFailure() << "the reader does not notice";
    if (scene.status().code() != StatusCode::kCorruption) {
      return testing::AssertionFailure() << scene.status().message();
    }
    return testing::AssertionSuccess();
  }

  // What verify says about a scene of full precision with some nodes changed.
  std::vector<std::string> findingsAfter(std::uint32_t page,
                                         const std::function<void(std::vector<LevelNode>&)>& edit) {
    const Status status = editNodes(path("scene1.sft"), path("edited.sft"), page, edit);
    EXPECT_TRUE(status.ok()) << status.message();
    static_cast<void>(readScene(path("edited.sft")));  // must come back, well or not
    return findingsOf(path("edited.sft"));
  }
};

TEST_F(VerifyTest, SoundScenesHaveNoFindings) {
  for (const std::size_t count : {1, 5, 1000, 20000}) {
    const std::string scene = smallScene(count % 2 == 0, count);
    for (const int threads : {1, 2, 5}) EXPECT_THAT(findingsOf(scene, threads), IsEmpty());
  }
}

TEST_F(VerifyTest, EveryFlipIsFoundByVerifyAndReader) {
  std::string file = bytesOf(smallScene());
  for (std::size_t at = 0; at < file.size(); ++at) {
    const char right = file[at];
    for (const int flip : {1 << (at % 8), 0xff}) {
      file[at] = static_cast<char>(right ^ flip);
      ASSERT_TRUE(noticed(file)) << "byte " << at << ", bits " << flip;
    }
    file[at] = right;
  }
}

TEST_F(VerifyTest, EveryTruncationIsFoundByVerifyAndReader) {
  const std::string file = bytesOf(smallScene());
  for (std::size_t size = 0; size < file.size(); ++size) {
    ASSERT_TRUE(noticed(file.substr(0, size))) << size << " bytes";
  }
}

TEST_F(VerifyTest, WipedSectorsAndAppendedBytesAreFound) {
  const std::string file = bytesOf(smallScene());
  for (const char fill : {'\0', '\xff'}) {
    for (std::size_t at = 0; at < file.size(); at += 512) {
      std::string damaged = file;
      const std::size_t size = std::min<std::size_t>(512, file.size() - at);
      damaged.replace(at, size, size, fill);
      ASSERT_TRUE(noticed(damaged)) << at;
    }
  }
  for (const std::size_t size : {1, 511, 4096, 1 << 20}) {
    ASSERT_TRUE(noticed(file + std::string(size, '\0')));
  }
}

TEST_F(VerifyTest, ManyFaultsAtOnceAreFound) {
  const std::string file = bytesOf(smallScene());
  TestRandom random(7);
  const char* const files = std::getenv("SURFEIT_DAMAGED_FILES");
  for (int i = 0; i < (files != nullptr ? std::atoi(files) : 3000); ++i) {
    std::string damaged = file;
    const std::uint32_t faults = 1 + random.bits() % 64;
    for (std::uint32_t k = 0; k < faults; ++k) {
      damaged[random.bits() % file.size()] = static_cast<char>(random.bits());
    }
    ASSERT_TRUE(damaged == file || noticed(damaged)) << i;
  }
}

TEST_F(VerifyTest, DamagedPageIsNamedAndTheRestChecked) {
  const std::string scene = smallScene(false, 20000);
  std::string file = bytesOf(scene);
  const Result<PageFile> pages = PageFile::open(scene);
  ASSERT_TRUE(pages.ok());
  const std::uint32_t last = pages->pageCount() - 1;
  file[pages->entry(last).offset + 3] ^= 1;
  writeBytes(path("damaged.sft"), file);
  Progress progress;
  const Result<VerifyReport> report = verifyScene(path("damaged.sft"), 2, progress);
  ASSERT_TRUE(report.ok());
  EXPECT_EQ(report->pages_checked, pages->pageCount());
  EXPECT_EQ(report->bytes_checked, file.size());
  EXPECT_THAT(report->findings,
              Contains(HasSubstr("damaged.sft: page " + std::to_string(last) + " at ")));
}

TEST_F(VerifyTest, NewerVersionIsRefusedWithItsNumber) {
  std::string file = bytesOf(smallScene());
  setAt(file, 8, kFormatVersion + 1);
  sealFile(file);
  writeBytes(path("newer.sft"), file);
  EXPECT_THAT(findingsOf(path("newer.sft")),
              Contains(HasSubstr("version " + std::to_string(kFormatVersion + 1))));
}

TEST_F(VerifyTest, PagesOfAnotherVersionThanTheHeaderSaysAreCorruption) {
  for (const bool is_old : {false, true}) {
    std::string file = bytesOf(is_old ? SURFEIT_TEST_SOURCE_DIR "/golden/v1.sft" : smallScene());
    setAt(file, 8, is_old ? 2u : 1u);
    sealFile(file);
    EXPECT_TRUE(noticed(file)) << is_old;
  }
}

TEST_F(VerifyTest, ReservedBytesOfTheSceneFieldsAreZero) {
  constexpr std::size_t kUpAt = 252, kOriginEnd = 280;  // the origin follows the up axis
  for (const bool is_old : {false, true}) {
    const std::string sound =
        bytesOf(is_old ? SURFEIT_TEST_SOURCE_DIR "/golden/v1.sft" : smallScene());
    for (std::size_t at = is_old ? kUpAt : kOriginEnd; at < kHeaderChecksumAt; ++at) {
      std::string file = sound;
      ASSERT_EQ(file[at], 0);
      file[at] = 1;
      sealFile(file);
      replaceContents(path("reserved.sft"), file);
      EXPECT_THAT(findingsOf(path("reserved.sft")),
                  Contains(AnyOf(HasSubstr("reserved space"), HasSubstr("up axis"))));
    }
  }
}

TEST_F(VerifyTest, UpAxesAreThree) {
  for (const std::uint32_t up : {0u, 1u, 2u, 3u, 0x100u, ~0u}) {
    std::string file = bytesOf(smallScene());
    setAt(file, 252, up);
    sealFile(file);
    replaceContents(path("up.sft"), file);
    if (up <= 2) {
      EXPECT_THAT(findingsOf(path("up.sft")), IsEmpty()) << up;
    } else {
      EXPECT_THAT(findingsOf(path("up.sft")), Contains(HasSubstr("up axis"))) << up;
    }
  }
}

TEST_F(VerifyTest, OriginsAreFiniteAndInReach) {
  for (const double origin :
       {1.1e12, -1e300, std::numeric_limits<double>::infinity(), std::nan("")}) {
    std::string file = bytesOf(smallScene());
    std::memcpy(&file[256 + 8], &origin, sizeof origin);
    sealFile(file);
    replaceContents(path("far.sft"), file);
    EXPECT_THAT(findingsOf(path("far.sft")), Contains(HasSubstr("header: origin is")));
  }
}

TEST_F(VerifyTest, MissingFileIsAnIoErrorAndCancellingInterrupts) {
  Progress progress;
  EXPECT_EQ(verifyScene(path("absent.sft"), 1, progress).status().code(), StatusCode::kIoError);
  struct Cancelled : Progress {
    bool isCancelled() const override { return true; }
  } cancelled;
  EXPECT_EQ(verifyScene(smallScene(), 1, cancelled).status().code(), StatusCode::kInterrupted);
}

TEST_F(VerifyTest, HostileSceneFieldsWithValidChecksumsDoNoHarm) {
  const std::string file = bytesOf(smallScene());
  const auto start = std::chrono::steady_clock::now();
  int cases = 0;
  for (std::size_t at = kSceneFieldsOffset; at < kHeaderChecksumAt; at += 4) {
    for (const std::size_t bytes : {4u, 8u}) {
      if (at + bytes > kHeaderChecksumAt) continue;
      const std::uint64_t right =
          bytes == 4 ? getAt<std::uint32_t>(file, at) : getAt<std::uint64_t>(file, at);
      std::vector<std::uint64_t> values = hostileValues(right);
      values.push_back(0x7fc00000);          // NaN
      values.push_back(0x7f800000);          // infinity
      values.push_back(0x7ff0000000000000);  // infinity of a double
      for (const std::uint64_t value : values) {
        std::string damaged = file;
        std::memcpy(damaged.data() + at, &value, bytes);
        sealFile(damaged);
        replaceContents(path("damaged.sft"), damaged);
        static_cast<void>(findingsOf(path("damaged.sft")));
        static_cast<void>(readScene(path("damaged.sft")));
        ++cases;
      }
    }
  }
  const std::chrono::duration<double> seconds = std::chrono::steady_clock::now() - start;
  EXPECT_LT(seconds.count() / cases, 0.01);
}

TEST_F(VerifyTest, ClaimsThatDoNotHoldAreFound) {
  smallScene(true, 400);
  const std::uint32_t root = 0;
  EXPECT_THAT(findingsAfter(root, [](auto&) {}), IsEmpty());
  EXPECT_THAT(findingsAfter(root, [](auto& n) { n[0].node.area *= 1.01f; }),
              Contains(HasSubstr("edited.sft: page 0 at ")));
  EXPECT_THAT(findingsAfter(root, [](auto& n) { n[0].node.surfel_count += 1; }),
              Contains(HasSubstr("surfel count")));
  EXPECT_THAT(findingsAfter(root, [](auto& n) { n[0].node.radius *= 0.01f; }), Not(IsEmpty()));
  EXPECT_THAT(findingsAfter(root, [](auto& n) { n[0].node.position.x += 10; }), Not(IsEmpty()));
  EXPECT_THAT(findingsAfter(root, [](auto& n) { n.push_back(n[0]); }), Not(IsEmpty()));
}

TEST_F(VerifyTest, BoundsThatDoNotHoldForTheSurfelsBelowAreFound) {
  IndexOptions options;
  options.leaf_capacity = 4;
  options.full_precision = true;
  const Result<SceneInfo> info = readSceneInfo(index(sphereCloud(3000), kAllChannels, options));
  ASSERT_TRUE(info.ok());
  // The root, and nodes with and without children
  for (const std::uint32_t page : {0u, info->node_pages / 2, info->node_pages - 1}) {
    const auto findings = [&](const std::function<void(LevelNode&)>& edit) {
      return findingsAfter(page, [&](std::vector<LevelNode>& nodes) {
        edit(*std::max_element(nodes.begin(), nodes.end(), [](auto& a, auto& b) {
          return a.node.surfel_count < b.node.surfel_count;
        }));
      });
    };
    const auto finds = [&](const char* claim) {
      return Contains(testing::AllOf(HasSubstr("edited.sft: page " + std::to_string(page) + " at "),
                                     HasSubstr(claim)));
    };
    EXPECT_THAT(findings([](LevelNode&) {}), IsEmpty());
    EXPECT_THAT(findings([](LevelNode& n) { n.node.thickness *= .3f; }), finds(": thickness"));
    EXPECT_THAT(findings([](LevelNode& n) { n.normal_angle *= .5f; }), finds(": normal cosine"));
    EXPECT_THAT(findings([](LevelNode& n) { n.node.radius *= .5f; }), finds(": bounding radius"));
  }
}

// Nothing but the byte of a slab or a cone is other than it was.
TEST_F(VerifyTest, TamperedBytesOfBoundsAreFound) {
  const std::string scene = index(boxCloud(20, .1f, 2));
  // On a page of one node 54 bytes of position, radius, area, normal and flatness come before
  constexpr std::size_t kThickness = 62, kCone = 63;
  for (const std::size_t place : {kThickness, kCone}) {
    const Status status = rewriteScene(scene, path("edited.sft"),
                                       [&](std::uint32_t page, std::vector<std::byte>& payload) {
                                         if (page != 0) return;
                                         ASSERT_GT(payload[place], std::byte{40});
                                         payload[place] = std::byte{40};
                                       });
    ASSERT_TRUE(status.ok()) << status.message();
    const char* const claim = place == kCone ? "normal cosine" : "thickness";
    EXPECT_THAT(findingsOf(path("edited.sft")),
                testing::ElementsAre(
                    testing::AllOf(HasSubstr("edited.sft: page 0 at "), HasSubstr(claim))));
  }
}

TEST_F(VerifyTest, GroupsThatAreNotThoseBelowAreFound) {
  IndexOptions options;
  options.leaf_capacity = 4;
  options.full_precision = true;
  const std::string scene = index(inGroups(randomCloud(400), 3), kAllAndGroups, options);
  EXPECT_THAT(findingsOf(scene), IsEmpty());
  const auto groups = HasSubstr("groups 0x");
  EXPECT_THAT(findingsAfter(0, [](auto& n) { n[0].node.groups |= groupBit(63); }),
              Contains(groups));
  EXPECT_THAT(findingsAfter(0, [](auto& n) { n[0].node.groups &= ~groupBit(1); }),
              Contains(groups));
  // A leaf, on the last node page
  const Result<SceneInfo> info = readSceneInfo(scene);
  ASSERT_TRUE(info.ok()) << info.status().message();
  EXPECT_TRUE(info->channels.group);
  EXPECT_EQ(info->groups, 7u);
  EXPECT_THAT(findingsAfter(info->node_pages - 1,
                            [](auto& n) {
                              ASSERT_TRUE(n[0].node.isLeaf());
                              n[0].node.groups ^= groupBit(5);
                            }),
              Contains(groups));
  ASSERT_TRUE(
      editSurfels(scene, path("edited.sft"), 0, [](auto& surfels) { surfels[7].group = 9; }).ok());
  EXPECT_THAT(findingsOf(path("edited.sft")), Contains(groups));
}

TEST_F(VerifyTest, ReferencesThatLeadNowhereAreCorruption) {
  smallScene(true, 400);
  const struct {
    const char* name;
    std::function<void(LevelNode&)> edit;
  } edits[] = {
      {"own level", [](LevelNode& n) { n.child_level = 0; }},
      {"level beyond the last", [](LevelNode& n) { n.child_level = 22; }},
      {"level 255", [](LevelNode& n) { n.child_level = 255; }},
      {"empty level", [](LevelNode& n) { n.child_level = 21; }},
      {"page after the last", [](LevelNode& n) { n.node.page += 1; }},
      {"page 2^32 - 1", [](LevelNode& n) { n.node.page = 0xffffffff; }},
      {"first beyond the group", [](LevelNode& n) { n.node.first = 127; }},
      {"first 65535", [](LevelNode& n) { n.node.first = 65535; }},
      {"one child", [](LevelNode& n) { n.node.child_count = 1; }},
      {"nine children", [](LevelNode& n) { n.node.child_count = 9; }},
      {"255 children", [](LevelNode& n) { n.node.child_count = 255; }},
      {"unknown flag", [](LevelNode& n) { n.node.flags |= 2; }},
      {"a leaf with a child level", [](LevelNode& n) { n.node.child_count = 0; }},
      {"radius 0", [](LevelNode& n) { n.node.radius = 0; }},
      {"radius -1", [](LevelNode& n) { n.node.radius = -1; }},
      {"radius NaN", [](LevelNode& n) { n.node.radius = NAN; }},
      {"area infinite", [](LevelNode& n) { n.node.area = INFINITY; }},
      {"position NaN", [](LevelNode& n) { n.node.position.y = NAN; }},
      {"normal of length 2",
       [](LevelNode& n) {
         n.node.normal = {0, 0, 2};
       }},
      {"radiosity -1", [](LevelNode& n) { n.node.radiosity.x = -1; }},
      {"power that overflows",
       [](LevelNode& n) {
         n.node.radiosity.x = 3e38f;
         n.node.area = 10;
       }},
      {"flatness 2", [](LevelNode& n) { n.node.flatness = 2; }},
      {"coefficient NaN", [](LevelNode& n) { n.node.rough.sh[8][powerKind(2)] = NAN; }},
  };
  for (const auto& edit : edits) {
    SCOPED_TRACE(edit.name);
    EXPECT_THAT(findingsAfter(0, [&](auto& nodes) { edit.edit(nodes[0]); }), Not(IsEmpty()));
    EXPECT_EQ(readScene(path("edited.sft")).status().code(), StatusCode::kCorruption);
  }
}

TEST_F(VerifyTest, LeavesThatPointNowhereAreCorruption) {
  smallScene(true, 4);
  const struct {
    const char* name;
    std::function<void(LevelNode&)> edit;
  } edits[] = {
      {"page after the last", [](LevelNode& n) { n.node.page = 1; }},
      {"first beyond the page", [](LevelNode& n) { n.node.first = 4; }},
      {"first beyond the group", [](LevelNode& n) { n.node.first = 512; }},
      {"no surfels", [](LevelNode& n) { n.node.surfel_count = 0; }},
      {"more surfels than there are", [](LevelNode& n) { n.node.surfel_count = 5; }},
      {"2^63 surfels", [](LevelNode& n) { n.node.surfel_count = std::uint64_t{1} << 63; }},
      {"2^64 - 1 surfels", [](LevelNode& n) { n.node.surfel_count = ~std::uint64_t{0}; }},
  };
  for (const auto& edit : edits) {
    SCOPED_TRACE(edit.name);
    EXPECT_THAT(findingsAfter(0, [&](auto& nodes) { edit.edit(nodes[0]); }), Not(IsEmpty()));
    EXPECT_EQ(readScene(path("edited.sft")).status().code(), StatusCode::kCorruption);
  }
}

TEST_F(VerifyTest, NodesSharedByTwoParentsAreFound) {
  smallScene(true, 400);
  const Result<SceneInfo> info = readSceneInfo(path("scene1.sft"));
  ASSERT_TRUE(info.ok());
  // The first page with two interior nodes: the second becomes the first, so that all counts of
  // the page still hold and only the orphans below tell
  bool edited = false;
  for (std::uint32_t page = 0; page < info->node_pages && !edited; ++page) {
    const std::vector<std::string> findings =
        findingsAfter(page, [&](std::vector<LevelNode>& nodes) {
          LevelNode* first = nullptr;
          for (LevelNode& node : nodes) {
            if (node.node.isLeaf() || edited) continue;
            if (first == nullptr) {
              first = &node;
            } else {
              node = *first;
              edited = true;
            }
          }
        });
    EXPECT_EQ(findings.empty(), !edited);
  }
  EXPECT_TRUE(edited);
}

TEST_F(VerifyTest, OrphanedSurfelsAreFound) {
  // Two leaves of equal surfels: the second leaf comes to share those of the first
  std::vector<Surfel> cloud(4, randomCloud(1)[0]);
  cloud[2].position.x += 1e-3f;
  cloud[3].position.x += 1e-3f;
  IndexOptions options;
  options.leaf_capacity = 2;
  options.full_precision = true;
  index(cloud, kAllChannels, options);
  EXPECT_THAT(findingsAfter(1,
                            [](std::vector<LevelNode>& nodes) {
                              ASSERT_EQ(nodes.size(), 2u);
                              nodes[1] = nodes[0];
                            }),
              Contains(HasSubstr("surfels are not each referenced once")));
}

TEST_F(VerifyTest, SurfelsThatAreNoneAreCorruption) {
  const std::string scene = smallScene(true, 40);
  const struct {
    const char* name;
    std::function<void(Surfel&)> edit;
  } edits[] = {
      {"radius 0", [](Surfel& s) { s.radius = 0; }},
      {"radius -1", [](Surfel& s) { s.radius = -1; }},
      {"area NaN", [](Surfel& s) { s.area = NAN; }},
      {"position infinite", [](Surfel& s) { s.position.z = -INFINITY; }},
      {"normal of length 3",
       [](Surfel& s) {
         s.flags = 0;
         s.normal = {3, 0, 0};
       }},
      {"radiosity -1", [](Surfel& s) { s.radiosity.y = -1; }},
      {"radiosity NaN", [](Surfel& s) { s.radiosity.y = NAN; }},
      {"albedo -1", [](Surfel& s) { s.albedo.y = -1; }},
      {"outside its node", [](Surfel& s) { s.position.x += 100; }},
      {"larger than its node", [](Surfel& s) { s.radius = 100; }},
      {"more area than its node", [](Surfel& s) { s.area += 1; }},
  };
  for (const auto& edit : edits) {
    SCOPED_TRACE(edit.name);
    const Status status =
        editSurfels(scene, path("edited.sft"), 0, [&](auto& surfels) { edit.edit(surfels[7]); });
    ASSERT_TRUE(status.ok()) << status.message();
    EXPECT_THAT(findingsOf(path("edited.sft")), Contains(HasSubstr("edited.sft: page ")));
  }
}

TEST_F(VerifyTest, RandomPayloadsWithValidChecksumsDoNoHarm) {
  for (const bool full : {false, true}) {
    const std::string scene = smallScene(full, 100);
    TestRandom random(11);
    for (int i = 0; i < 100; ++i) {
      const Status status = rewriteScene(
          scene, path("edited.sft"), [&](std::uint32_t, std::vector<std::byte>& payload) {
            if (random.bits() % 4 != 0) return;
            for (std::uint32_t k = 1 + random.bits() % 4; k > 0; --k) {
              payload[random.bits() % payload.size()] = static_cast<std::byte>(random.bits());
            }
          });
      ASSERT_TRUE(status.ok()) << status.message();
      static_cast<void>(findingsOf(path("edited.sft")));
      static_cast<void>(readScene(path("edited.sft")));
    }
  }
}

}  // namespace
}  // namespace surfeit
