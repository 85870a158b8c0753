#include <gtest/gtest.h>
#include <plumbline/core/em.h>
#include <plumbline/detectors/builtins.h>
#include <plumbline/detectors/default_hierarchy.h>

#include <set>
#include <string>
#include <vector>

namespace plumbline {
namespace {

TEST(DefaultHierarchyTest, ByRawFeatures) {
  EXPECT_EQ(DefaultHierarchy({}), "");
  EXPECT_EQ(DefaultHierarchy({"pose"}), "");
  EXPECT_EQ(DefaultHierarchy({"segment", "pose"}),
            "orientation_mixture/orientation_relation");
  EXPECT_EQ(DefaultHierarchy({"line"}),
            "orientation_mixture/orientation_relation");
  EXPECT_EQ(DefaultHierarchy({"point", "pose"}),
            "line_ransac,circle_ransac/center_cluster,orientation_mixture/"
            "orientation_relation");
  EXPECT_EQ(DefaultHierarchy({"circle"}), "center_cluster");
  EXPECT_EQ(DefaultHierarchy({"point", "segment"}),
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
    const std::string description = DefaultHierarchy(raw);
    SCOPED_TRACE(description);
    EXPECT_NO_THROW(
        MakeHierarchy(description, registry, {raw.begin(), raw.end()}, {}));
  }
}

}  // namespace
}  // namespace plumbline
