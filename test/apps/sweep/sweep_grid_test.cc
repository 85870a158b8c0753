#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <plumbline/apps/sweep/sweep_grid.h>
#include <plumbline/core/error.h>

#include <cstdio>
#include <string>
#include <vector>

namespace plumbline {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

std::vector<std::string> Values(const std::string& values) {
  return ParseGrid("x=" + values).at(0).values;
}

std::string Refusal(const std::string& grid) {
  try {
    ParseGrid(grid);
  } catch (const Error& error) {
    return error.what();
  }
  return "";
}

TEST(SweepGridTest, AxesAreSeparatedBySemicolons) {
  const std::vector<SweepAxis> axes =
      ParseGrid(" delta_threshold = 0.05, 0.1,0.3 ; link_radius=5,10;");
  ASSERT_EQ(axes.size(), 2u);
  EXPECT_EQ(axes[0].flag, "delta_threshold");
  EXPECT_THAT(axes[0].values, ElementsAre("0.05", "0.1", "0.3"));
  EXPECT_EQ(axes[1].flag, "link_radius");
  EXPECT_THAT(axes[1].values, ElementsAre("5", "10"));
  EXPECT_THAT(ParseGrid(""), IsEmpty());
}

TEST(SweepGridTest, RangesHoldTheirEndsAndNoDust) {
  EXPECT_THAT(Values("0.1:0.1:0.5"),
              ElementsAre("0.1", "0.2", "0.3", "0.4", "0.5"));
  EXPECT_THAT(Values("1:2:6"), ElementsAre("1", "3", "5"));
  EXPECT_THAT(Values("1:-0.5:0"), ElementsAre("1", "0.5", "0"));
  EXPECT_THAT(Values("3:1:3"), ElementsAre("3"));
  EXPECT_EQ(Values("0:0.001:1").size(), 1001u);
  EXPECT_EQ(Values("0:0.001:1")[999], "0.999");
}

TEST(SweepGridTest, LogarithmicValuesHaveEqualRatios) {
  EXPECT_THAT(Values("log(0.01, 10, 4)"),
              ElementsAre("0.01", "0.1", "1", "10"));
  EXPECT_THAT(Values("log(8,1,4)"), ElementsAre("8", "4", "2", "1"));
}

TEST(SweepGridTest, ValuesOfAllKindsCanBeMixed) {
  EXPECT_THAT(Values("0.5,1:1:3,log(10,1000,3)"),
              ElementsAre("0.5", "1", "2", "3", "10", "100", "1000"));
  EXPECT_THAT(Values("\"0,45,90,135\",\"0,90\",\"a;b\",\"\""),
              ElementsAre("0,45,90,135", "0,90", "a;b", ""));
  // Words with colons are words.
  EXPECT_THAT(Values("a:b:c,\"1:2\",C:\\x"),
              ElementsAre("a:b:c", "1:2", "C:\\x"));
  EXPECT_THAT(Values("line_ransac/orientation_mixture,x=1"),
              ElementsAre("line_ransac/orientation_mixture", "x=1"));
}

TEST(SweepGridTest, RefusesWhatIsNoGrid) {
  EXPECT_THAT(Refusal("x=0.05:0.3"), HasSubstr("'0.05:0.3' has no step"));
  EXPECT_THAT(Refusal("link_radius"), HasSubstr("cannot read 'link_radius'"));
  EXPECT_THAT(Refusal("=1"), HasSubstr("cannot read '=1'"));
  EXPECT_THAT(Refusal("--x=1"), HasSubstr("without dashes in front"));
  EXPECT_THAT(Refusal("x=1;x=2"), HasSubstr("'x' comes twice"));
  EXPECT_THAT(Refusal("x=1,2,1"), HasSubstr("the value '1' twice"));
  EXPECT_THAT(Refusal("x=1:1:3,2"), HasSubstr("the value '2' twice"));
  EXPECT_THAT(Refusal("x="), HasSubstr("an empty value of 'x'"));
  EXPECT_THAT(Refusal("x=1,,2"), HasSubstr("an empty value of 'x'"));
  EXPECT_THAT(Refusal("x=\"1,2"), HasSubstr("a quote does not end"));
  for (const std::string range : {"1:0:2", "1:-1:2", "2:1:1"}) {
    EXPECT_THAT(Refusal("x=" + range), HasSubstr("does not get to its end"));
  }
  EXPECT_THAT(Refusal("x=0:1e-9:1"), HasSubstr("too many values"));
  for (const std::string log : {"log(0,1,3)", "log(1,2,1)", "log(1,2)",
                                "log(1,2,x)", "log(1,-2,3)", "log(1,2,3,4)"}) {
    EXPECT_THAT(Refusal("x=" + log), HasSubstr("positive a and b"));
  }
}

TEST(SweepGridTest, NamesMayHoldCommas) {
  using Names = std::vector<std::string>;
  EXPECT_EQ(SplitNames(""), Names());
  EXPECT_EQ(SplitNames("a,b c,,d"), (Names{"a", "b c", "d"}));
  EXPECT_EQ(SplitNames("\"a, 0.1 m.right\",b"), (Names{"a, 0.1 m.right", "b"}));
  EXPECT_THROW(SplitNames("a,\"b"), Error);
}

TEST(SweepGridTest, WordsAreCutAsAShellDoes) {
  EXPECT_THAT(SplitWords("  a  b\tc\n"), ElementsAre("a", "b", "c"));
  EXPECT_THAT(SplitWords("--x='a b' \"c 'd'\"e '' \\  f\\\"g"),
              ElementsAre("--x=a b", "c 'd'e", "", " ", "f\"g"));
  EXPECT_THAT(SplitWords("'a\\b'"), ElementsAre("a\\b"));
  EXPECT_THAT(SplitWords(""), IsEmpty());
  EXPECT_THROW(SplitWords("a 'b"), Error);
  EXPECT_THROW(SplitWords("a \"b"), Error);
}

TEST(SweepGridTest, QuotedWordsComeBackFromAShell) {
  EXPECT_EQ(QuoteForShell("--a=b/c,d.e"), "--a=b/c,d.e");
  for (const std::string word :
       {"", "a b", "it's", "$HOME;`ls`", "\"\\", "*", "a\nb"}) {
    const std::string quoted = QuoteForShell(word);
    EXPECT_THAT(SplitWords(quoted), ElementsAre(word));
    FILE* const pipe = popen(("printf %s " + quoted).c_str(), "r");
    char buffer[64];
    const std::size_t count = fread(buffer, 1, sizeof(buffer), pipe);
    pclose(pipe);
    EXPECT_EQ(std::string(buffer, count), word);
  }
}

}  // namespace
}  // namespace plumbline
