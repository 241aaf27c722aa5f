#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <string>
#include <utility>
#include <vector>

#include "io/surfel_cloud_test.h"
#include "surfels/open_surfel_source.h"
#include "surfels/rows/surfel_writer.h"

namespace surfeit {
namespace {

using testing::HasSubstr;

using SurfelSourceTest = SurfelCloudTest;

TEST_F(SurfelSourceTest, PositionsAloneAreSpheresWithoutChannels) {
  const auto source = open(cloud(kXyz, {"1 2 3"}));
  const CloudChannels channels = source->channels();
  EXPECT_FALSE(channels.normal || channels.radius || channels.area || channels.radiosity ||
               channels.albedo || channels.two_sided);
  EXPECT_EQ(source->recordCount(), 1u);
  const std::vector<Surfel> surfels = readAll(*source);
  ASSERT_EQ(surfels.size(), 1u);
  EXPECT_EQ(surfels[0].position, glm::vec3(1, 2, 3));
  EXPECT_TRUE(surfels[0].isSphere());
  EXPECT_EQ(surfels[0].radius, 0);
  EXPECT_EQ(surfels[0].radiosity, glm::vec3(0));
  EXPECT_EQ(surfels[0].albedo, glm::vec3(0));
}

TEST_F(SurfelSourceTest, NormalsAreNormalisedAndZeroIsASphere) {
  const auto source =
      open(cloud(xyzAnd({"double nx", "double ny", "double nz"}),
                 {"0 0 0 0 3 4", "0 0 0 0 0 0", "0 0 0 0 1e-5 0", "0 0 0 3e38 0 0"}));
  EXPECT_TRUE(source->channels().normal);
  const std::vector<Surfel> surfels = readAll(*source);
  ASSERT_EQ(surfels.size(), 4u);
  EXPECT_EQ(surfels[0].normal, glm::vec3(0, 0.6f, 0.8f));
  EXPECT_FALSE(surfels[0].isSphere());
  EXPECT_EQ(surfels[1].normal, glm::vec3(0));
  EXPECT_TRUE(surfels[1].isSphere());
  EXPECT_EQ(surfels[2].normal, glm::vec3(0, 1, 0));
  EXPECT_EQ(surfels[3].normal, glm::vec3(1, 0, 0));
}

TEST_F(SurfelSourceTest, RadiusHasThreeNames) {
  EXPECT_EQ(readOne(cloud(xyzAnd({"float radius"}), {"0 0 0 2"})).radius, 2);
  EXPECT_EQ(readOne(cloud(xyzAnd({"float pscale"}), {"0 0 0 2"})).radius, 2);
  EXPECT_EQ(readOne(cloud(xyzAnd({"float width"}), {"0 0 0 2"})).radius, 1);
  EXPECT_EQ(readOne(cloud(xyzAnd({"float width", "float radius"}), {"0 0 0 2 5"})).radius, 5);
}

TEST_F(SurfelSourceTest, AllPropertiesAreFoundInAnyOrder) {
  const auto source =
      open(cloud({"double albedo_b", "float area", "float radiosity_g", "float z", "float y",
                  "uchar two_sided", "float x", "float radiosity_r", "float radiosity_b",
                  "float albedo_r", "float albedo_g", "float confidence"},
                 {"0.3 9 20 3 2 1 1 10 30 0.1 0.2 77", "0.3 9 20 3 2 0 1 10 30 0.1 0.2 nan"}));
  EXPECT_TRUE(source->channels().area && source->channels().radiosity &&
              source->channels().albedo && source->channels().two_sided);
  const std::vector<Surfel> surfels = readAll(*source);
  ASSERT_EQ(surfels.size(), 2u);  // a NaN in a property that is not used does no harm
  EXPECT_EQ(surfels[0].position, glm::vec3(1, 2, 3));
  EXPECT_EQ(surfels[0].area, 9);
  EXPECT_EQ(surfels[0].radiosity, glm::vec3(10, 20, 30));
  EXPECT_EQ(surfels[0].albedo, glm::vec3(0.1f, 0.2f, 0.3f));
  EXPECT_TRUE(surfels[0].isTwoSided());
  EXPECT_FALSE(surfels[1].isTwoSided());
}

TEST_F(SurfelSourceTest, ColorsBecomeLinearRadiosityAndAlbedo) {
  const Surfel bytes =
      readOne(cloud(xyzAnd({"uchar red", "uchar green", "uchar blue"}), {"0 0 0 0 255 188"}));
  EXPECT_EQ(bytes.radiosity.r, 0);
  EXPECT_EQ(bytes.radiosity.g, 1);
  EXPECT_NEAR(bytes.radiosity.b, 0.502886, 1e-6);
  EXPECT_EQ(bytes.albedo, bytes.radiosity);

  // 10/255 lies on the straight part of the curve
  EXPECT_NEAR(readOne(cloud(xyzAnd({"uchar red", "uchar green", "uchar blue"}), {"0 0 0 10 0 0"}))
                  .radiosity.r,
              10 / 255.0 / 12.92, 1e-8);

  const Surfel words = readOne(
      cloud(xyzAnd({"ushort red", "ushort green", "ushort blue"}), {"0 0 0 0 65535 48316"}));
  EXPECT_EQ(words.radiosity.g, 1);
  EXPECT_NEAR(words.radiosity.b, 0.502886, 1e-6);

  const Surfel floats =
      readOne(cloud(xyzAnd({"float red", "float green", "float blue"}), {"0 0 0 0 0.5 2"}));
  EXPECT_EQ(floats.radiosity, glm::vec3(0, 0.5f, 2));
}

TEST_F(SurfelSourceTest, ColorsFillOnlyWhatIsAbsent) {
  const std::vector<std::string> colors = {"float red", "float green", "float blue"};
  std::vector<std::string> properties = xyzAnd(colors);
  for (const char* name : {"float radiosity_r", "float radiosity_g", "float radiosity_b"}) {
    properties.push_back(name);
  }
  const Surfel surfel = readOne(cloud(properties, {"0 0 0 .1 .2 .3 4 5 6"}));
  EXPECT_EQ(surfel.radiosity, glm::vec3(4, 5, 6));
  EXPECT_EQ(surfel.albedo, glm::vec3(.1f, .2f, .3f));
}

TEST_F(SurfelSourceTest, DefectsAreSkippedAndCountedByKind) {
  const auto source =
      open(cloud(xyzAnd({"float radius", "float area", "float nx", "float ny", "float nz",
                         "float red", "float green", "float blue"}),
                 {
                     "0 0 0 1 1 0 0 1 1 1 1",      // 0: valid
                     "0 nan 0 1 1 0 0 1 1 1 1",    // 1: non-finite
                     "0 0 0 1 1 0 0 1 1 inf 1",    // 2: non-finite
                     "0 0 0 0 1 0 0 1 1 1 1",      // 3: radius
                     "0 0 0 -1 -1 0 0 1 1 1 1",    // 4: radius goes before area
                     "0 0 0 1 0 0 0 1 1 1 1",      // 5: area
                     "0 0 0 1 1 1e-9 0 0 1 1 1",   // 6: normal
                     "0 0 0 1 1 0 0 1 1 1 -1",     // 7: color
                     "1e39 0 0 0 1 0 0 1 1 1 -1",  // 8: non-finite goes before all others
                     "1 2 3 1 1 0 0 0 1 1 1",      // 9: valid
                 }));
  const std::vector<Surfel> surfels = readAll(*source);
  ASSERT_EQ(surfels.size(), 2u);
  EXPECT_EQ(surfels[1].position, glm::vec3(1, 2, 3));
  for (int pass = 0; pass < 2; ++pass) {
    const SurfelDefects& defects = source->defects();
    EXPECT_EQ(defects.total(), 8u);
    EXPECT_EQ(defects.non_finite.count, 3u);
    EXPECT_EQ(defects.non_finite.first_record, 1u);
    EXPECT_EQ(defects.bad_radius.count, 2u);
    EXPECT_EQ(defects.bad_area.first_record, 5u);
    EXPECT_EQ(defects.short_normal.first_record, 6u);
    EXPECT_EQ(defects.negative_color.first_record, 7u);
    EXPECT_EQ(defects.describe(),
              "3 records with a non-finite value (first: record 1, whose y is nan), "
              "2 records with a radius that is not positive (first: record 3, whose radius is 0), "
              "1 record with an area that is not positive (first: record 5, whose area is 0), "
              "1 record with a normal too short to point (first: record 6, whose length of nx, ny, "
              "nz is 1e-09), "
              "1 record with a negative radiosity or albedo (first: record 7, whose blue is -1); "
              "--channels radius=-,area=-,normal=-,color=- reads such records without these, "
              "convert --set changes values");
    ASSERT_TRUE(source->rewind().ok());
    EXPECT_EQ(source->defects().total(), 0u);
    EXPECT_EQ(source->defects().describe(), "");
    readAll(*source, 1);
  }
}

TEST_F(SurfelSourceTest, DoublesThatNoFloatHoldsAreNonFinite) {
  const auto source = open(cloud({"double x", "double y", "double z"}, {"1e39 0 0", "1e300 0 0"}));
  EXPECT_TRUE(readAll(*source).empty());
  EXPECT_EQ(source->defects().non_finite.count, 2u);
}

TEST_F(SurfelSourceTest, RadiusThatIsZeroAsAFloatIsBad) {
  const auto source = open(cloud(xyzAnd({"double radius"}), {"0 0 0 1e-60"}));
  EXPECT_TRUE(readAll(*source).empty());
  EXPECT_EQ(source->defects().bad_radius.count, 1u);
}

TEST_F(SurfelSourceTest, StrictNamesTheRecordAndTheDefect) {
  const auto message = [this](const std::vector<std::string>& rows) {
    const auto source =
        open(cloud(xyzAnd({"float width", "float nx", "float ny", "float nz"}), rows), true);
    std::vector<Surfel> surfels(10);
    const Result<std::size_t> count = source->read(surfels);
    EXPECT_EQ(count.status().code(), StatusCode::kCorruption);
    return count.status().message();
  };
  EXPECT_EQ(message({"0 0 0 1 0 0 1", "0 0 0 -2 0 0 1"}),
            path("a.ply") + ": record 1: width is -2, expected more than 0");
  EXPECT_THAT(message({"0 0 0 1 nan 0 1"}),
              HasSubstr("record 0: nx is nan, expected a number that a float can hold"));
  EXPECT_THAT(message({"0 0 0 1 1e-7 0 0"}), HasSubstr("record 0: length of nx, ny, nz is 1"));
}

TEST_F(SurfelSourceTest, PropertiesThatMakeNoSenseAreRefused) {
  EXPECT_THAT(refusal(cloud({"float x", "float y"}, {"1 2"})),
              HasSubstr("element vertex: found property y without z"));
  EXPECT_THAT(refusal(cloud({"float a"}, {"1"})), HasSubstr("found no properties x, y, z"));
  EXPECT_THAT(refusal(cloud(xyzAnd({"float nx"}), {"1 2 3 4"})), HasSubstr("nx without nz"));
  EXPECT_THAT(refusal(cloud(xyzAnd({"int red", "int green", "int blue"}), {"1 2 3 4 5 70000"})),
              HasSubstr("found 4 to 70000 in property red of type int"));
  EXPECT_THAT(refusal(cloud(xyzAnd({"list uchar float area"}), {"1 2 3 0"})),
              HasSubstr("property area is a list"));
}

TEST_F(SurfelSourceTest, ElementHasFourNames) {
  for (const char* name : {"vertex", "point", "points", "surfel"}) {
    EXPECT_EQ(readAll(*open(cloud(kXyz, {"1 2 3"}, name))).size(), 1u);
  }
  EXPECT_THAT(refusal(cloud(kXyz, {"1 2 3"}, "stuff")),
              HasSubstr("found 1 elements, first stuff, expected one named vertex"));
}

TEST_F(SurfelSourceTest, OtherFormatsAreRefusedByTheirFirstBytes) {
  write("a.abc", "what\x01is this?");
  EXPECT_THAT(refusal(path("a.abc")), HasSubstr("found 'what' at 0, expected a cloud (PLY"));
  write("empty", "");
  EXPECT_THAT(refusal(path("empty")), HasSubstr("the file is empty, expected a cloud"));
  EXPECT_EQ(openSurfelSource(path("missing"), false).status().code(), StatusCode::kIoError);
}

TEST_F(SurfelSourceTest, EmptyCloudHasNoSurfels) {
  const auto source = open(cloud(kXyz, {}));
  EXPECT_EQ(source->recordCount(), 0u);
  EXPECT_TRUE(readAll(*source).empty());
}

TEST_F(SurfelSourceTest, BlackColorsAreTold) {
  const auto notesOf = [&](const std::string& type, const std::string& colors) {
    std::vector<std::string> properties = {"float x", "float y", "float z"};
    for (const char* name : {" red", " green", " blue"}) properties.push_back(type + name);
    return open(cloud(properties, {"1 2 3 0 0 0", "2 3 4 " + colors}))->notes();
  };
  for (const char* type : {"uchar", "ushort", "float", "double"}) {
    EXPECT_THAT(notesOf(type, "0 0 0"),
                testing::ElementsAre(testing::HasSubstr("colors are all 0: surfels are black")))
        << type;
  }
  EXPECT_THAT(notesOf("uchar", "1 0 1"),
              testing::ElementsAre(testing::HasSubstr("colors are 0 or 1 in uchar")));
  for (const char* type : {"uchar", "float"}) {
    EXPECT_THAT(notesOf(type, "0 0 255"), testing::Each(testing::Not(testing::HasSubstr("black"))))
        << type;
  }
  EXPECT_THAT(notesOf("float", "0 0.25 0"), testing::IsEmpty());
}

TEST_F(SurfelSourceTest, DegreesAreTold) {
  const auto notesOf = [&](const std::string& crs) {
    write("a.ply", "ply\nformat ascii 1.0\ncomment crs " + crs +
                       "\nelement vertex 1\nproperty double x\nproperty double y\nproperty "
                       "double z\nend_header\n16.37 48.2 171\n");
    return open(path("a.ply"))->notes();
  };
  EXPECT_THAT(notesOf("EPSG:4326"), testing::ElementsAre(testing::HasSubstr("are degrees")));
  EXPECT_THAT(notesOf("EPSG:32633"), testing::IsEmpty());
}

TEST_F(SurfelSourceTest, CloudAfterAnotherElementIsFound) {
  write("a.ply",
        "ply\nformat ascii 1.0\nelement camera 1\nproperty list uchar float view\n"
        "element vertex 2\nproperty float x\nproperty float y\nproperty float z\nend_header\n"
        "2 8 9\n1 2 3\n4 5 6\n");
  const auto source = open(path("a.ply"));
  for (int pass = 0; pass < 2; ++pass) {
    const std::vector<Surfel> surfels = readAll(*source);
    ASSERT_EQ(surfels.size(), 2u);
    EXPECT_EQ(surfels[1].position, glm::vec3(4, 5, 6));
    ASSERT_TRUE(source->rewind().ok());
  }
}

TEST_F(SurfelSourceTest, EveryFlippedByteIsReadOrRefused) {
  Result<SurfelWriter> writer =
      SurfelWriter::create(path("a.ply"), {true, true, true, true, true, true});
  ASSERT_TRUE(writer.ok());
  ASSERT_TRUE(writer->write(std::vector<Surfel>(2)).ok());
  ASSERT_TRUE(writer->finish().ok());
  const std::string text = contents("a.ply");
  std::vector<Surfel> surfels(3);
  for (std::size_t i = 0; i < text.size(); ++i) {
    for (const bool is_strict : {false, true}) {
      std::string damaged = text;
      damaged[i] = static_cast<char>(~damaged[i]);
      write("b.ply", damaged);
      Result<std::unique_ptr<SurfelSource>> source = openSurfelSource(path("b.ply"), is_strict);
      if (!source.ok()) continue;
      const Result<std::size_t> count = (*source)->read(surfels);
      EXPECT_TRUE(count.ok() || count.status().code() == StatusCode::kCorruption);
    }
  }
}

TEST_F(SurfelSourceTest, RealCloudsHaveNoDefects) {
  const std::filesystem::path directory = std::filesystem::path(SURFEIT_SHARED_DATA_DIR) / "points";
  if (!std::filesystem::exists(directory)) GTEST_SKIP() << "no " << directory;
  for (const auto& [name, size] :
       {std::pair("autzen_stadium.ply", 1193240u), std::pair("lion_takanawa.ply", 341989u)}) {
    const auto source = open((directory / name).string(), true);
    EXPECT_EQ(source->recordCount(), size);
    EXPECT_TRUE(source->channels().radiosity && source->channels().albedo);
    EXPECT_EQ(readAll(*source).size(), size);
  }
}

}  // namespace
}  // namespace surfeit
