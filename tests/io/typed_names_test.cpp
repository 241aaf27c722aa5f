// Advice to drop or rename a property calls it as --channels must: as the file does, or as the user
// did.
#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <string>
#include <vector>

#include "cloud/cloud_formats.h"
#include "cloud/rows/channels.h"
#include "io/surfel_cloud_test.h"
#include "surfeit/convert.h"
#include "surfels/open_surfel_source.h"

namespace surfeit {
namespace {

using testing::Contains;
using testing::HasSubstr;
using testing::Not;

class TypedNames : public SurfelCloudTest {
 protected:
  std::unique_ptr<SurfelSource> openAs(const std::string& file, const std::string& channels) {
    RowReaderOptions options;
    options.channels = *parseChannelRenames(channels);
    auto source = openSurfelSource(path(file), false, options);
    EXPECT_TRUE(source.ok()) << source.status().message();
    return source.ok() ? std::move(*source) : nullptr;
  }

  // What is told of the rows that are skipped.
  std::string skipped(const std::string& file, const std::string& channels) {
    const auto source = openAs(file, channels);
    if (source == nullptr) return {};
    readAll(*source);
    return source->defects().describe();
  }

  // The advice "--channels NAME=-" reads everything.
  void expectAdvice(const std::string& file, const std::string& channels, const std::string& drop) {
    EXPECT_THAT(skipped(file, channels), HasSubstr("--channels " + drop + " reads")) << file;
    const std::string rest = channels.substr(std::min(channels.find(',') + 1, channels.size()));
    EXPECT_EQ(skipped(file, channels.find(',') == channels.npos ? drop : drop + "," + rest), "")
        << file;
  }

  // A PLY whose property `names` are -1 in its second row, as a file of another format.
  void writeBad(const std::vector<std::string>& names, const std::string& file) {
    std::string head, good, bad;
    for (const std::string& name : names) {
      head += "property float " + name + "\n";
      good += " 1";
      bad += " -1";
    }
    write("source.ply",
          "ply\nformat ascii 1.0\nelement vertex 2\nproperty float x\nproperty float y\nproperty "
          "float z\n" +
              head + "end_header\n1 2 3" + good + "\n2 3 4" + bad + "\n");
    Progress progress;
    ASSERT_TRUE(convertClouds({path("source.ply")}, path(file), {}, progress).ok());
  }
};

TEST_F(TypedNames, RenamedPropertiesAreCalledAsTheUserCallsThem) {
  for (const char* file : {"a.ply", "a.csv"}) {
    writeBad({"weight"}, file);
    expectAdvice(file, "weight=radius", "weight=-");
    writeBad({"radius"}, file);
    expectAdvice(file, "", "radius=-");
    writeBad({"lum_r", "lum_g", "lum_b"}, file);
    expectAdvice(file, "lum=radiosity", "lum=-");
    EXPECT_THAT(skipped(file, "lum_r=red,lum_g=green,lum_b=blue"),
                HasSubstr("--channels lum_r=-,lum_g=-,lum_b=- reads"));
  }
  // By the number of a column, or by a name that is no name of a property
  write("b.txt", "1 2 3 4\n2 3 4 -1\n");
  expectAdvice("b.txt", "4=radius", "4=-");
  write("c.csv", "x,y,z,Scalar field\n1,2,3,4\n2,3,4,-1\n");
  expectAdvice("c.csv", "Scalar field=radius", "Scalar field=-");
}

TEST_F(TypedNames, ChannelsAreCalledAsTheFormatCallsThem) {
  writeBad({"red", "green", "blue"}, "a.bgeo");
  expectAdvice("a.bgeo", "", "Cd=-");
  writeBad({"radiosity_r", "radiosity_g", "radiosity_b"}, "a.ptc");
  expectAdvice("a.ptc", "", "_radiosity=-");
  writeBad({"radius"}, "a.bgeo");
  expectAdvice("a.bgeo", "", "pscale=-");
  writeBad({"weight"}, "a.vdb");
  expectAdvice("a.vdb", "weight=radius", "weight=-");
}

TEST_F(TypedNames, NotesOfWhatIsNotUsedDoSo) {
  write("a.csv", "x,y,z,radius,part\n1,2,3,4,.5\n2,3,4,1,.25\n");
  EXPECT_THAT(openAs("a.csv", "part=alpha")->notes(),
              Contains(HasSubstr("--channels part=opacity takes it")));
  write("b.csv", "x,y,z,part\n1,2,3,.5\n2,3,4,.25\n");
  EXPECT_THAT(openAs("b.csv", "part=coverage")->notes(),
              Contains(HasSubstr("--channels part=opacity takes it")));
  EXPECT_THAT(openAs("b.csv", "part=coverage")->notes(), Not(Contains(HasSubstr("coverage=-"))));
  write("c.csv", "x,y,z,a,b,c\n1,2,3,0,0,0\n2,3,4,0,0,0\n");
  EXPECT_THAT(openAs("c.csv", "a=red,b=green,c=blue")->notes(),
              Contains(HasSubstr("--channels a=-,b=-,c=- leaves the colors out")));
}

TEST_F(TypedNames, AreThoseOfAnElement) {
  RowLayout element;
  for (const char* name : {"nx", "ny", "nz", "red", "area"}) {
    RowProperty property;
    property.name = name;
    if (name[0] == 'n') property.typed = "N";
    element.properties.push_back(property);
  }
  EXPECT_EQ(dropsOf(element, "normal"), "N=-");
  EXPECT_EQ(dropsOf(element, "nx"), "N=-");
  EXPECT_EQ(dropsOf(element, "color"), "color=-");
  EXPECT_EQ(dropsOf(element, "area"), "area=-");
  EXPECT_EQ(dropsOf(element, "absent"), "absent=-");
}

}  // namespace
}  // namespace surfeit
