#include "tools/frames.h"

#include <gmock/gmock.h>

#include <cstdio>
#include <set>
#include <string>

namespace surfeit {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;

std::vector<int> framesOf(const char* text) {
  const Result<std::vector<int>> frames = parseFrames(text);
  EXPECT_TRUE(frames.ok()) << frames.status().message();
  return frames.ok() ? *frames : std::vector<int>();
}

TEST(Frames, RangesStepsAndListsAreTakenInTheirOrder) {
  EXPECT_THAT(framesOf("7"), ElementsAre(7));
  EXPECT_THAT(framesOf("1-4"), ElementsAre(1, 2, 3, 4));
  EXPECT_THAT(framesOf("1-8x3"), ElementsAre(1, 4, 7));
  EXPECT_THAT(framesOf("9,1-3"), ElementsAre(9, 1, 2, 3));
  EXPECT_THAT(framesOf("-2-1"), ElementsAre(-2, -1, 0, 1));
  EXPECT_THAT(framesOf("-3--2"), ElementsAre(-3, -2));
  EXPECT_EQ(framesOf("1-240x2").size(), 120u);
}

TEST(Frames, AFrameIsTakenOnce) { EXPECT_THAT(framesOf("3,1-4,3"), ElementsAre(3, 1, 2, 4)); }

TEST(Frames, WhatIsNoListOfFramesIsRefused) {
  for (const char* text :
       {"", "a", "1-", "-", "1,,2", "1,", "1-3x0", "1-3x-1", "1-3x", "1..3", "1 2", "1.5", "1:3",
        "100000000", "999999999999", "1-3y2", "x2", "1x2"}) {
    const Result<std::vector<int>> frames = parseFrames(text);
    ASSERT_FALSE(frames.ok()) << text;
    EXPECT_EQ(frames.status().code(), StatusCode::kInvalidArgument) << text;
    EXPECT_THAT(frames.status().message(), HasSubstr("1-240x2")) << text;
  }
  EXPECT_THAT(parseFrames("10-1").status().message(), HasSubstr("1-10"));
  EXPECT_THAT(parseFrames("0-99999999").status().message(), HasSubstr("1000000 frames"));
}

TEST(Frames, DescribedFramesAreParsedBack) {
  for (const char* text : {"7", "1-3", "1-3,7", "1,3,5", "-3--1,4", "9,1-2"}) {
    EXPECT_EQ(describeFrames(framesOf(text)), text);
  }
}

// printf has the last word about %04d; the other patterns stand for the same.
TEST(FrameNames, PatternsGiveTheNamesOfPrintf) {
  for (const int frame : {0, 7, 240, 12345, -3}) {
    char four[32], plain[32], one[32];
    std::snprintf(four, sizeof four, "a.%04d.ply", frame);
    std::snprintf(plain, sizeof plain, "a.%d.ply", frame);
    std::snprintf(one, sizeof one, "a.%01d.ply", frame);
    EXPECT_EQ(frameName("a.####.ply", frame), four);
    EXPECT_EQ(frameName("a.%04d.ply", frame), four);
    EXPECT_EQ(frameName("a.$F4.ply", frame), four);
    EXPECT_EQ(frameName("a.%d.ply", frame), plain);
    EXPECT_EQ(frameName("a.$F.ply", frame), plain);
    EXPECT_EQ(frameName("a.#.ply", frame), one);
  }
}

TEST(FrameNames, EveryPlaceOfANameGetsTheNumber) {
  EXPECT_EQ(frameName("shot_##/$F4_%d.#.exr", 12), "shot_12/0012_12.12.exr");
  EXPECT_EQ(frameName("####", 5), "0005");
  EXPECT_EQ(frameName("a.%012d", 5), "a.000000000005");
}

TEST(FrameNames, WhatIsNoPatternStays) {
  for (const char* name : {"", "a.ply", "50%.ply", "%", "%s", "%4d", "%0d", "%0", "%x", "%0123d",
                           "$", "$G4", "$FPS", "$F45", "$F4x", "a$", "F4", "d04%"}) {
    EXPECT_FALSE(hasFramePattern(name)) << name;
    EXPECT_EQ(frameName(name, 7), name);
  }
}

TEST(FrameNames, DifferentFramesHaveDifferentNames) {
  for (const char* pattern : {"a##", "a%02d", "a$F2", "a$F", "a%d"}) {
    ASSERT_TRUE(hasFramePattern(pattern));
    std::set<std::string> names;
    for (int frame = -300; frame <= 300; ++frame) names.insert(frameName(pattern, frame));
    EXPECT_EQ(names.size(), 601u) << pattern;
  }
}

}  // namespace
}  // namespace surfeit
