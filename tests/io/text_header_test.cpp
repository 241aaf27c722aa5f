// Names of columns with units and names that come again, comments behind values, and numbers that
// doubles do not hold.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <string>
#include <vector>

#include "cloud/cloud_formats.h"
#include "cloud/text/xyz_header.h"
#include "cloud/text/xyz_units.h"
#include "io/row_damage_test.h"

namespace surfeit {
namespace {

using testing::AllOf;
using testing::Contains;
using testing::Each;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::Not;

class TextHeaderTest : public RowFileTest {
 protected:
  std::unique_ptr<RowReader> openText(const std::string& text, const std::string& channels = "") {
    write("a.txt", text);
    RowReaderOptions options;
    options.channels = *parseChannelRenames(channels);
    return openOk(openRowReader, path("a.txt"), options);
  }
  std::vector<std::string> notesOf(const std::string& text, const std::string& channels = "") {
    const auto reader = openText(text, channels);
    return reader ? reader->notes() : std::vector<std::string>();
  }
  double valueIn(const std::string& text, std::size_t row, const char* name) {
    const auto reader = openText(text);
    return valueOf(*reader, readAllRows(*reader), row, name);
  }
};

// --- Units

TEST(XyzUnits, AreTakenOffNames) {
  const auto split = [](const char* word) {
    const NameWithUnit parts = splitUnit(word);
    return std::string(parts.name) + "|" + std::string(parts.unit);
  };
  EXPECT_EQ(split("x [m]"), "x|m");
  EXPECT_EQ(split("x(mm)"), "x|mm");
  EXPECT_EQ(split("Easting ( us-ft )"), "Easting|us-ft");
  EXPECT_EQ(split("Radius_mm"), "Radius|mm");
  EXPECT_EQ(split("theta (deg)"), "theta|deg");
  EXPECT_EQ(split("z/mm"), "z|mm");
  EXPECT_EQ(split(" X "), "X|");
  // A letter behind a line is a unit behind the name of a length alone
  EXPECT_EQ(split("n_m"), "n_m|");
  EXPECT_EQ(split("x_"), "x_|");
  EXPECT_EQ(split("(m)"), "(m)|");
}

TEST_F(TextHeaderTest, SeveralUnitsAreToldWithTheFactor) {
  for (const char* head : {"x [m],y [m],z [m],radius [mm]", "x_m;y_m;z_m;radius_mm",
                           "X (m)\tY (m)\tZ (m)\tRadius (mm)", "x [m] y [m] z [m] radius [mm]",
                           "# x[m] y[m] z[m] radius[mm]"}) {
    const std::string text = std::string(head) + "\n1;2;3;50\n";
    EXPECT_EQ(valueIn(text, 0, "radius"), 50) << head;
    EXPECT_THAT(notesOf(text), ElementsAre(AllOf(HasSubstr("several units"),
                                                 HasSubstr("--set \"radius *= 0.001\""))))
        << head;
  }
  EXPECT_THAT(notesOf("x (mm);y (mm);z (m)\n1;2;3\n"),
              ElementsAre(HasSubstr("convert --set \"z *= 1000\"")));
  EXPECT_THAT(notesOf("x [ft];y [ft];z [ft];area [m2]\n1;2;3;4\n"),
              ElementsAre(HasSubstr("convert --set \"area *= 10.7639104\"")));
  EXPECT_THAT(notesOf("x [m];y [m];z [px]\n1;2;3\n"), ElementsAre(HasSubstr("give them one unit")));
}

TEST_F(TextHeaderTest, OneUnitIsToldUnlessItIsMetres) {
  EXPECT_THAT(notesOf("x [m];y [m];z [m];radius [m];area [m^2]\n1;2;3;4;5\n"), IsEmpty());
  EXPECT_THAT(notesOf("x_mm,y_mm,z_mm,radius_mm,area (mm2)\n1,2,3,4,5\n"),
              ElementsAre(AllOf(HasSubstr("places are in 'mm'"), HasSubstr("--units"))));
  EXPECT_THAT(notesOf("x;y;z;theta (deg)\n1;2;3;4\n"), IsEmpty());
}

// --- Names that come again

TEST_F(TextHeaderTest, ColorsThatStandTogetherAreTheColor) {
  for (const std::string head : {"X Y Z A B C R G B", "X Y Z A G B R G B", "X Y Z B C D R G B"}) {
    const std::string text = head + "\n1 2 3 11 12 13 100 150 200\n";
    EXPECT_EQ(valueIn(text, 0, "red"), 100) << head;
    EXPECT_EQ(valueIn(text, 0, "green"), 150) << head;
    EXPECT_EQ(valueIn(text, 0, "blue"), 200) << head;
    EXPECT_EQ(openText(text)->element().find("alpha"), nullptr) << head;
    EXPECT_THAT(notesOf(text), Contains(HasSubstr("column 9 ('B') is blue"))) << head;
  }
}

TEST_F(TextHeaderTest, NamesThatComeAgainAreTold) {
  EXPECT_THAT(notesOf("x,y,z,intensity,intensity\n1,2,3,4,5\n"),
              ElementsAre(AllOf(HasSubstr("column 4 ('intensity') is intensity, column 5"),
                                HasSubstr("NUMBER=-"))));
  EXPECT_THAT(notesOf("x y z r g b r g b\n1 2 3 40 50 60 7 8 9\n"),
              ElementsAre(HasSubstr("column 4 ('r') is red")));
  // Numbers are the way out
  EXPECT_THAT(notesOf("x,y,z,intensity,intensity\n1,2,3,4,5\n", "5=-"), IsEmpty());
  EXPECT_THAT(refusal(openRowReader, "x y z x y z\n1 2 3 4 5 6\n"),
              AllOf(HasSubstr("one x, y and z each"), HasSubstr("--channels 1=x,2=y,3=z")));
  EXPECT_EQ(openText("x y z x y z\n1 2 3 4 5 6\n", "1=x,2=y,3=z,4=-,5=-,6=-")->element().count, 1u);
}

TEST_F(TextHeaderTest, AnAIsAlphaBesideTheColor) {
  for (const char* head : {"x,y,z,r,g,b,a", "x,y,z,a,r,g,b", "X,Y,Z,R,G,B,A"}) {
    EXPECT_NE(openText(std::string(head) + "\n1,2,3,4,5,6,70\n")->element().find("alpha"), nullptr);
  }
  EXPECT_EQ(openText("x,y,z,a,i,r,g,b\n1,2,3,4,5,6,70,8\n")->element().find("alpha"), nullptr);
}

// --- Comments behind values

TEST_F(TextHeaderTest, CommentsBehindValuesAreTold) {
  for (const char* text :
       {"1 2 3 # a note\n4 5 6\n", "1,2,3, # 7\n4,5,6\n", "1;2;3 // a, b\n4;5;6\n",
        "x y z\n1 2 3\t% 9 9\n4 5 6\n", "x,y,z # all my points\n1,2,3 #\n4,5,6\n",
        "x y z // here\n1 2 3 // ok\n4 5 6\n"}) {
    EXPECT_EQ(valueIn(text, 0, "z"), 3) << text;
    EXPECT_EQ(valueIn(text, 1, "x"), 4) << text;
    EXPECT_EQ(openText(text)->element().properties.size(), 3u) << text;
    EXPECT_THAT(notesOf(text),
                Contains(HasSubstr("comments behind the values of 1 of 2 rows are not kept")))
        << text;
  }
  EXPECT_THAT(notesOf("x,y,z # all my points\n1,2,3\n"), IsEmpty());
  // Not behind a blank it is part of a word
  EXPECT_THAT(refusal(openRowReader, "x y z\n1 2 3\n1 2 3#4\n"), HasSubstr("'3#4'"));
  // A column of words has a name
  EXPECT_EQ(openText("x y z tag\n1 2 3 #1\n", "tag=-")->element().properties.size(), 3u);
}

TEST_F(TextHeaderTest, CommentsBehindNamesAndInFrontAreKept) {
  for (const char* text : {"x y z # from here\n1 2 3\n", "# from here\nx y z\n1 2 3\n",
                           "x,y,z // from here\n1,2,3\n", "# x y z # from here\n1 2 3\n"}) {
    const auto reader = openText(text);
    EXPECT_THAT(reader->comments(), ElementsAre("from here")) << text;
    EXPECT_THAT(reader->notes(), IsEmpty()) << text;
  }
  // Well-known text is long
  const std::string crs = "crs PROJCS[\"" + std::string(3000, 'a') + "\"]";
  EXPECT_THAT(openText("# " + crs + "\nx y z\n1 2 3\n")->comments(), ElementsAre(crs));
}

TEST_F(TextHeaderTest, CommentsThatAreNotKeptAreCounted) {
  EXPECT_THAT(notesOf("x y z\n1 2 3\n# b\n4 5 6\n\n# c\n"),
              ElementsAre(HasSubstr("2 lines of comments among the rows are not kept")));
  EXPECT_THAT(notesOf("1 2 3\n// b\n4 5 6\n"), ElementsAre(HasSubstr("1 lines of comments")));
  std::string many;
  for (int i = 0; i < 70; ++i) many += "# line\n";
  EXPECT_THAT(notesOf(many + "1 2 3\n"),
              ElementsAre(HasSubstr("6 comments in front of the rows are not kept")));
}

// --- Units below names

TEST_F(TextHeaderTest, ALineBelowNamesMayHoldUnits) {
  for (const char* text : {"x y z\nft ft ft\n1 2 3\n", "X,Y,Z\n[ft],[ft],[ft]\n1,2,3\n",
                           "x;y;z\n(ft);(ft);(ft)\n1;2;3\n",
                           "Easting\tNorthing\tHeight\n\"ft\"\t\"ft\"\t\"ft\"\n1\t2\t3\n",
                           "# x y z\nfeet feet feet\n1 2 3\n"}) {
    EXPECT_EQ(valueIn(text, 0, "z"), 3) << text;
    EXPECT_THAT(notesOf(text), ElementsAre(HasSubstr("convert --units ft:m"))) << text;
  }
  EXPECT_THAT(notesOf("x y z\nm m m\n1 2 3\n"), IsEmpty());
  EXPECT_THAT(notesOf("x,y,z,radius\nm,m,m,mm\n1,2,3,4\n"),
              ElementsAre(HasSubstr("--set \"radius *= 0.001\"")));
  EXPECT_THAT(notesOf("x,y,z,I\nm,m,m,\n1,2,3,4\n"), IsEmpty());
  EXPECT_THAT(refusal(openRowReader, "x,y,z\ndeg,deg,m\n1,2,3\n"), HasSubstr("are angles"));
  EXPECT_THAT(refusal(openRowReader, "x [deg],y [deg],z [m]\n1,2,3\n"), HasSubstr("are angles"));
  // What is none of units is refused with a way out
  for (const char* text : {"x y z\nfloat float float\n1 2 3\n", "x,y,z\nm,m\n1,2,3\n"}) {
    write("b.txt", text);
    EXPECT_THAT(openRowReader(path("b.txt")).status().message(),
                HasSubstr("a # in front makes a comment"))
        << text;
  }
}

// --- Whole numbers that no double holds

TEST_F(TextHeaderTest, WholeNumbersThatDoublesRoundAreTold) {
  const auto numbers = [](const char* number) {
    return std::string("x,y,z,id\n1,2,3,7\n1,2,3,") + number + "\n";
  };
  for (const char* rounded :
       {"9007199254740993", "-9007199254740993", "+18446744073709551615", "0009007199254740993"}) {
    EXPECT_THAT(notesOf(numbers(rounded)),
                ElementsAre(AllOf(HasSubstr("column 4 (id)"), HasSubstr("in 1 of 2 rows"),
                                  HasSubstr("--channels 4=-"))))
        << rounded;
  }
  for (const char* exact : {"9007199254740992", "9007199254740994", "1e20", "123456789012345",
                            "00000000000000000000001", "18446744073709551616"}) {
    EXPECT_THAT(notesOf(numbers(exact)), IsEmpty()) << exact;
  }
  EXPECT_THAT(notesOf(numbers("9007199254740993"), "id=-"), IsEmpty());
}

// --- Decimal commas where there is no choice

TEST_F(TextHeaderTest, DecimalCommasInOtherTextsAreNamed) {
  EXPECT_THAT(refusal(openRowReader,
                      "ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nproperty float "
                      "y\nproperty float z\nend_header\n1,5 2,5 3,5\n"),
              AllOf(HasSubstr("found '1,5'"), HasSubstr("write it with points")));
  EXPECT_THAT(refusal(openRowReader,
                      "# .PCD v0.7\nVERSION 0.7\nFIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nCOUNT 1 1 "
                      "1\nWIDTH 1\nHEIGHT 1\nPOINTS 1\nDATA ascii\n1,5 2,5 3,5\n"),
              HasSubstr("where they stand before decimals, write points"));
}

}  // namespace
}  // namespace surfeit
