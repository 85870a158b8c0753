#include <gtest/gtest.h>
#include <plumbline/core/em.h>
#include <plumbline/detectors/builtins.h>
#include <plumbline/detectors/default_hierarchy.h>

#include <string>
#include <utility>
#include <vector>

namespace plumbline {
namespace {

class DefaultHierarchyTest : public ::testing::Test {
 protected:
  DefaultHierarchyTest() { RegisterBuiltins(&registry_); }

  HierarchySpec For(const std::vector<std::string>& raw) const {
    std::vector<const FeatureType*> types;
    for (const std::string& name : raw) {
      types.push_back(&registry_.GetFeature(name));
    }
    return DefaultHierarchy(types, registry_);
  }
  std::string TextFor(const std::vector<std::string>& raw) const {
    return FormatHierarchy(For(raw));
  }

  Registry registry_;
};

TEST_F(DefaultHierarchyTest, ByRawFeatures) {
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

TEST_F(DefaultHierarchyTest, ATypeThatNoDetectorReadsHasNone) {
  FeatureType fence = registry_.GetFeature("segment");
  fence.name = "fence";
  fence.g2o_tag = "FENCE";
  fence.other_g2o_formats.clear();
  registry_.Register(std::move(fence));
  EXPECT_EQ(TextFor({"fence"}), "");
}

TEST_F(DefaultHierarchyTest, EveryOneCanBeMade) {
  const std::vector<std::string> types = {"point", "pose",   "segment",
                                          "line",  "circle", "orientation"};
  for (unsigned subset = 0; subset < 1u << types.size(); ++subset) {
    std::vector<std::string> raw;
    for (std::size_t i = 0; i < types.size(); ++i) {
      if ((subset >> i) % 2 == 1) raw.push_back(types[i]);
    }
    SCOPED_TRACE(TextFor(raw));
    EXPECT_NO_THROW(MakeHierarchy(For(raw), registry_, raw, {}));
  }
}

}  // namespace
}  // namespace plumbline
