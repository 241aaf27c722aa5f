#include "core/crs_comment.h"

#include <gtest/gtest.h>

namespace surfeit {
namespace {

TEST(CrsComment, DegreesAreTold) {
  for (const char* crs :
       {"geographic EPSG:4326+5703 WGS 84", "EPSG:4326", "EPSG:4979", "EPSG:4269 NAD83",
        "urn:ogc:def:crs:EPSG::4258", "geographic by GeoTIFF keys without a code",
        "GEOGCS[\"WGS 84\",UNIT[\"degree\",0.0174532925199433]]",
        "GEOGCRS [\"WGS 84\",DATUM[\"x\"],CS[ellipsoidal,2]]",
        "GEODCRS[\"WGS 84\",DATUM[\"x\"],CS[ellipsoidal,3]]",
        "COMPD_CS[\"both\",GEOGCS[\"NAD83\",DATUM[\"x\"]],VERT_CS[\"NAVD88\"]]",
        "BOUNDCRS[SOURCECRS[GEOGCRS[\"a\"]],TARGETCRS[PROJCRS[\"b\"]]]"}) {
    EXPECT_TRUE(isGeographicCrs(crs)) << crs;
    EXPECT_NE(noteOfDegrees(crs).find("x and y are degrees"), std::string::npos) << crs;
    EXPECT_NE(noteOfDegrees(crs).find("reproject"), std::string::npos) << crs;
  }
}

TEST(CrsComment, LengthsAreNoDegrees) {
  for (const char* crs :
       {"", "EPSG:32610", "EPSG:2263+6360 vertical unit 9003", "EPSG:43260", "EPSG:4978",
        "geocentric EPSG:4978", "geographic EPSG:4978", "EPSG:4936",
        "by GeoTIFF keys without a code", "WGS 84 / UTM zone 10N",
        "PROJCS[\"UTM\",GEOGCS[\"WGS 84\",AUTHORITY[\"EPSG\",\"4326\"]],UNIT[\"metre\",1]]",
        "PROJCRS[\"UTM\",BASEGEOGCRS[\"WGS 84\",ID[\"EPSG\",4326]],CS[Cartesian,2]]",
        "COMPD_CS[\"both\",PROJCS[\"UTM\",GEOGCS[\"WGS 84\"]],VERT_CS[\"NAVD88\"]]",
        "GEOCCS[\"WGS 84\",AUTHORITY[\"EPSG\",\"4978\"]]",
        "GEODCRS[\"WGS 84\",DATUM[\"x\"],CS[Cartesian,3],ID[\"EPSG\",4978]]",
        "LOCAL_CS[\"site\",UNIT[\"metre\",1],AUTHORITY[\"EPSG\",\"4326\"]]"}) {
    EXPECT_FALSE(isGeographicCrs(crs)) << crs;
    EXPECT_EQ(noteOfDegrees(crs), "") << crs;
  }
}

}  // namespace
}  // namespace surfeit
