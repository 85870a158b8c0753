#include <gtest/gtest.h>
#include <plumbline/core/detector.h>
#include <plumbline/core/registry.h>
#include <plumbline/detectors/builtins.h>

#include <memory>

namespace plumbline {
namespace {

TEST(DetectorBuiltinsTest, RegisterOnce) {
  Registry registry;
  RegisterBuiltins(&registry);
  const std::size_t detectors = registry.detectors().size();
  EXPECT_GE(detectors, 2u);
  EXPECT_NE(registry.FindRelation("segment_orientation"), nullptr);
  EXPECT_NO_THROW(RegisterBuiltins(&registry));
  EXPECT_EQ(registry.detectors().size(), detectors);
}

TEST(DetectorBuiltinsTest, EveryDetectorIsMadeFromItsDefaults) {
  Registry registry;
  RegisterBuiltins(&registry);
  for (const DetectorType* type : registry.detectors()) {
    const auto detector = type->make(type->defaults());
    ASSERT_NE(detector, nullptr) << type->name;
    EXPECT_EQ(detector->name(), type->name);
    EXPECT_FALSE(type->description.empty());
    EXPECT_FALSE(type->reads.empty());
    for (const std::string& name : type->reads) {
      EXPECT_NE(registry.FindFeature(name), nullptr) << name;
    }
    for (const std::string& name : type->makes) {
      EXPECT_NE(registry.FindFeature(name), nullptr) << name;
    }
    // An empty graph has no structure.
    EXPECT_TRUE(detector->Detect(Graph(), registry, {}).empty());
  }
}

}  // namespace
}  // namespace plumbline
