#include <gtest/gtest.h>
#include <plumbline/core/em.h>
#include <plumbline/detectors/builtins.h>
#include <plumbline/detectors/default_hierarchy.h>

#include <set>
#include <string>
#include <vector>

namespace plumbline {
namespace {

std::string TextFor(const std::set<std::string>& raw) {
  return FormatHierarchy(DefaultHierarchy(raw));
}

TEST(DefaultHierarchyTest, ByRawFeatures) {
  EXPECT_EQ(TextFor({}), "");
  EXPECT_EQ(TextFor({"pose"}), "");
  EXPECT_EQ(TextFor({"segment", "pose"}),
            "orientation_mixture/orientation_relation");
  EXPECT_EQ(TextFor({"line"}), "orientation_mixture/orientation_relation");
  EXPECT_EQ(TextFor({"point", "pose"}),
            "line_ransac,circle_ransac/center_cluster,orientation_mixture/"
            "orientation_relation");
  EXPECT_EQ(TextFor({"circle"}), "center_cluster");
  EXPECT_EQ(TextFor({"point", "segment"}),
            "line_ransac,circle_ransac,orientation_mixture/"
            "center_cluster,orientation_mixture,orientation_relation/"
            "orientation_relation");
}

TEST(DefaultHierarchyTest, EveryOneCanBeMade) {
  Registry registry;
  RegisterBuiltins(&registry);
  const std::vector<std::string> types = {"point", "pose",   "segment",
                                          "line",  "circle", "orientation"};
  for (unsigned subset = 0; subset < 1u << types.size(); ++subset) {
    std::set<std::string> raw;
    for (std::size_t i = 0; i < types.size(); ++i) {
      if ((subset >> i) % 2 == 1) raw.insert(types[i]);
    }
    SCOPED_TRACE(TextFor(raw));
    EXPECT_NO_THROW(MakeHierarchy(DefaultHierarchy(raw), registry,
                                  {raw.begin(), raw.end()}, {}));
  }
}

}  // namespace
}  // namespace plumbline
