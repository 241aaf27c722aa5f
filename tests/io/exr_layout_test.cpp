#include "cloud/exr/exr_layout.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <string>
#include <vector>

namespace surfeit {
namespace {

using testing::AllOf;
using testing::ElementsAre;
using testing::HasSubstr;

std::vector<ExrSource> sourcesOf(const std::vector<std::string>& names) {
  std::vector<ExrSource> sources;
  for (const std::string& name : names) sources.push_back({0, name, name, name == "id"});
  return sources;
}

Result<ExrLayout> layOut(const std::vector<std::string>& names, const std::string& renames = "",
                         const std::string& main_layer = "") {
  return layOutExr(sourcesOf(names), *parseChannelRenames(renames), main_layer, "a.exr");
}

std::vector<std::string> properties(const std::vector<std::string>& names,
                                    const std::string& renames = "",
                                    const std::string& main_layer = "") {
  const Result<ExrLayout> layout = layOut(names, renames, main_layer);
  EXPECT_TRUE(layout.ok()) << layout.status().message();
  std::vector<std::string> found;
  if (!layout.ok()) return found;
  for (const RowProperty& property : layout->element.properties) found.push_back(property.name);
  return found;
}

TEST(ExrLayout, FindsPositionsAndNormalsUnderTheirUsualNames) {
  for (const auto& [position, normal] :
       std::vector<std::pair<std::vector<std::string>, std::vector<std::string>>>{
           {{"P.X", "P.Y", "P.Z"}, {"N.X", "N.Y", "N.Z"}},
           {{"P.x", "P.y", "P.z"}, {"N.x", "N.y", "N.z"}},
           {{"P.R", "P.G", "P.B"}, {"N.R", "N.G", "N.B"}},
           {{"position.X", "position.Y", "position.Z"}, {"normal.X", "normal.Y", "normal.Z"}},
           {{"V.Position.X", "V.Position.Y", "V.Position.Z"},
            {"V.Normal.X", "V.Normal.Y", "V.Normal.Z"}}}) {
    std::vector<std::string> names = normal;
    names.insert(names.end(), position.begin(), position.end());
    EXPECT_THAT(properties(names),
                ElementsAre("x", "y", "z", "nx", "ny", "nz", "pixel_x", "pixel_y"));
    EXPECT_THAT(properties(position), ElementsAre("x", "y", "z", "pixel_x", "pixel_y"));
  }
}

TEST(ExrLayout, OtherNamesComeFromTheUser) {
  const std::vector<std::string> names = {"WorldPos.B", "WorldPos.G", "WorldPos.R", "id",
                                          "V.nrm.X",    "V.nrm.Y",    "V.nrm.Z"};
  const Status status = layOut(names).status();
  EXPECT_EQ(status.code(), StatusCode::kCorruption);
  EXPECT_THAT(status.message(), AllOf(HasSubstr("a.exr: found the channels"), HasSubstr("WorldPos"),
                                      HasSubstr("expected world positions"),
                                      HasSubstr("--channels WorldPos=position names")));
  // The only layer of three values, and a depth
  EXPECT_THAT(layOut({"Where.X", "Where.Y", "Where.Z"}).status().message(),
              HasSubstr("--channels Where=position"));
  EXPECT_THAT(layOut({"R", "G", "B", "Z"}).status().message(),
              AllOf(HasSubstr("--channels RGB=position"), HasSubstr("a depth alone is none")));
  EXPECT_THAT(properties(names, "WorldPos=position,nrm=normal"),
              ElementsAre("x", "y", "z", "nx", "ny", "nz", "pixel_x", "pixel_y", "id"));
  EXPECT_THAT(properties(names, "WorldPos=position,V.nrm=-,id=-"),
              ElementsAre("x", "y", "z", "pixel_x", "pixel_y"));
  // What the user names comes before what has the usual name
  EXPECT_THAT(properties({"P.X", "P.Y", "P.Z", "Q.X", "Q.Y", "Q.Z"}, "Q=position"),
              ElementsAre("x", "y", "z", "pixel_x", "pixel_y"));
}

TEST(ExrLayout, GroupsColorsVectorsAndSingleValues) {
  EXPECT_THAT(properties({"A", "B", "G", "P.X", "P.Y", "P.Z", "R", "Z", "albedo.B", "albedo.G",
                          "albedo.R", "id", "motion.X", "motion.Y", "motion.Z", "uv.U", "uv.V"}),
              ElementsAre("x", "y", "z", "pixel_x", "pixel_y", "alpha", "red", "green", "blue",
                          "depth", "albedo_r", "albedo_g", "albedo_b", "id", "motion_x", "motion_y",
                          "motion_z", "uv.U", "uv.V"));
  const Result<ExrLayout> layout = layOut({"P.X", "P.Y", "P.Z", "id"});
  EXPECT_EQ(layout->element.find("id")->type, ValueType::kUint32);
  EXPECT_EQ(layout->element.find("pixel_x")->type, ValueType::kInt32);
  EXPECT_EQ(layout->element.row_bytes, 24u);
}

TEST(ExrLayout, MaskChannelsAreFoundInLayersAndKeptForTheMaskWhenDropped) {
  const Result<ExrLayout> layered =
      layOut({"V.Combined.A", "V.Depth.Z", "V.Position.X", "V.Position.Y", "V.Position.Z"});
  EXPECT_TRUE(layered->alpha && layered->depth);
  const Result<ExrLayout> dropped = layOut({"A", "P.X", "P.Y", "P.Z", "Z"}, "A=-,Z=-");
  EXPECT_TRUE(dropped->alpha && dropped->depth);
  EXPECT_EQ(dropped->element.properties.size(), 5u);
  EXPECT_FALSE(layOut({"P.X", "P.Y", "P.Z", "albedo.A"})->alpha);
}

TEST(ExrLayout, NamesThatAreTakenAreNotedAndLeftOut) {
  const Result<ExrLayout> layout =
      layOut({"P.X", "P.Y", "P.Z", "position.X", "position.Y", "position.Z"});
  ASSERT_TRUE(layout.ok());
  EXPECT_EQ(layout->element.properties.size(), 5u);
  EXPECT_THAT(layout->notes, ElementsAre(HasSubstr("channel position is not read: x is there")));
}

TEST(ExrLayout, CopyOfTheMainLayerIsNotRead) {
  const std::vector<std::string> names = {"B", "G",           "P.X",         "P.Y",        "P.Z",
                                          "R", "radiosity.B", "radiosity.G", "radiosity.R"};
  EXPECT_THAT(properties(names, "", "radiosity"),
              ElementsAre("x", "y", "z", "pixel_x", "pixel_y", "radiosity_r", "radiosity_g",
                          "radiosity_b"));
  EXPECT_THAT(properties(names, "", "irradiance"),
              ElementsAre("x", "y", "z", "pixel_x", "pixel_y", "red", "green", "blue",
                          "radiosity_r", "radiosity_g", "radiosity_b"));
}

TEST(ExrLayout, PartsAreLayersOfTheirBareChannels) {
  EXPECT_EQ(exrLayerName("X", "P", true, {}), "P.X");
  EXPECT_EQ(exrLayerName("R", "beauty", true, {}), "R");
  EXPECT_EQ(exrLayerName("R", "albedo", false, {}), "albedo.R");
  EXPECT_EQ(exrLayerName("albedo.R", "part2", false, {}), "albedo.R");
  EXPECT_EQ(exrLayerName("R", "", false, {}), "R");
}

}  // namespace
}  // namespace surfeit
