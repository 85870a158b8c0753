#include <gtest/gtest.h>
#include <plumbline/core/error.h>
#include <plumbline/core/hierarchy_spec.h>

#include <string>
#include <vector>

namespace plumbline {
namespace {

using Levels = std::vector<std::vector<std::string>>;

TEST(HierarchySpecTest, ReadsLevelsAndNames) {
  EXPECT_EQ(ParseHierarchy(" lines, circles/centres\n").levels,
            (Levels{{"lines", "circles"}, {"centres"}}));
  EXPECT_TRUE(ParseHierarchy("").empty());
  EXPECT_TRUE(ParseHierarchy(" \t").empty());
  // For MakeHierarchy to refuse.
  EXPECT_EQ(ParseHierarchy("a,/").levels, (Levels{{"a", ""}, {""}}));
}

TEST(HierarchySpecTest, TextReadsBack) {
  for (const char* text : {"", "a", "a,b", "a/b", "a,b/c,d/e"}) {
    EXPECT_EQ(FormatHierarchy(ParseHierarchy(text)), text);
  }
  EXPECT_EQ(FormatHierarchy(ParseHierarchy(" a , b / c ")), "a,b/c");
}

TEST(HierarchySpecTest, TakesFurtherDetectors) {
  HierarchySpec spec;
  spec.Add(0, "a");
  spec.Add(0, "b");
  spec.Add(1, "c");
  EXPECT_EQ(FormatHierarchy(spec), "a,b/c");
  EXPECT_TRUE(spec.Contains("c"));
  EXPECT_FALSE(spec.Contains("d"));
  EXPECT_THROW(spec.Add(3, "d"), Error);
  EXPECT_NE(spec, ParseHierarchy("a,b"));
}

}  // namespace
}  // namespace plumbline
