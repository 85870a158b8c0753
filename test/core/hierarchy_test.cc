#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <plumbline/core/builtins.h>
#include <plumbline/core/error.h>
#include <plumbline/core/hierarchy.h>

#include <map>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "core/em_test_util.h"

namespace plumbline {
namespace {

using ::testing::HasSubstr;

class HierarchyTest : public ::testing::Test {
 protected:
  HierarchyTest() {
    RegisterBuiltinRelations(&registry_);
    Register("lines", {"point"}, {"line"});
    Register("circles", {"point"}, {"circle"});
    Register("centres", {"circle"}, {"point"});
    Register("orientations", {"segment", "line"}, {"orientation"});
    Register("relations", {"orientation"}, {});
  }

  void Register(const std::string& name, std::vector<std::string> reads,
                std::vector<std::string> makes) {
    DetectorType type;
    type.name = name;
    type.reads = std::move(reads);
    type.makes = std::move(makes);
    type.parameters = {{"sigma", 0.5}, {"support", 2.0}};
    type.make = [this, name](const DetectorParameters& parameters) {
      if (parameters.count("typo") > 0) {
        throw PLUMBLINE_ERROR("unknown parameter typo", "sigma or support");
      }
      given_[name] = parameters;
      return std::make_unique<TestDetector>(name, 1, nullptr);
    };
    registry_.Register(std::move(type));
  }

  std::string MessageOf(const std::string& description,
                        const std::vector<std::string>& raw) {
    try {
      MakeHierarchy(ParseHierarchy(description), registry_, raw, {});
    } catch (const Error& error) {
      return error.what();
    }
    return "no error";
  }

  Registry registry_;
  std::map<std::string, DetectorParameters> given_;
};

TEST_F(HierarchyTest, ReadsLevelsAndNames) {
  const Hierarchy hierarchy = MakeHierarchy(
      ParseHierarchy("lines, circles/centres,orientations/relations"),
      registry_, {"point"}, {});
  ASSERT_EQ(hierarchy.size(), 3u);
  ASSERT_EQ(hierarchy[0].size(), 2u);
  EXPECT_EQ(hierarchy[0][1]->name(), "circles");
  ASSERT_EQ(hierarchy[1].size(), 2u);
  EXPECT_EQ(hierarchy[1][0]->name(), "centres");
  ASSERT_EQ(hierarchy[2].size(), 1u);
}

TEST_F(HierarchyTest, EmptyMeansNoDetectors) {
  EXPECT_TRUE(
      MakeHierarchy(ParseHierarchy(""), registry_, {"point"}, {}).empty());
}

TEST_F(HierarchyTest, ParametersOverrideDefaults) {
  MakeHierarchy(ParseHierarchy("lines/orientations"), registry_, {"point"},
                {{"lines", {{"sigma", 0.1}}}, {"centres", {{"sigma", 9.0}}}});
  EXPECT_EQ(given_["lines"],
            (DetectorParameters{{"sigma", 0.1}, {"support", 2.0}}));
  EXPECT_EQ(given_["orientations"],
            (DetectorParameters{{"sigma", 0.5}, {"support", 2.0}}));
  EXPECT_THROW(MakeHierarchy(ParseHierarchy("lines"), registry_, {"point"},
                             {{"lines", {{"typo", 1}}}}),
               Error);
  EXPECT_THROW(MakeHierarchy(ParseHierarchy("lines"), registry_, {"point"},
                             {{"line", {}}}),
               Error);
}

TEST_F(HierarchyTest, UnknownNamesListTheDetectors) {
  EXPECT_THAT(MessageOf("line/orientations", {"point"}),
              HasSubstr("unknown detector 'line': expected one of lines, "));
  EXPECT_THAT(MessageOf("lines,/orientations", {"point"}),
              HasSubstr("unknown detector ''"));
  EXPECT_THAT(MessageOf("lines//relations", {"point"}),
              HasSubstr("unknown detector ''"));
}

TEST_F(HierarchyTest, MisplacedDetectorsListWhatFitsWhere) {
  EXPECT_THAT(MessageOf("lines/orientations", {"segment"}),
              HasSubstr("detector 'lines' has nothing to read at level 0: "
                        "expected level 0 (segment): orientations"));
  EXPECT_THAT(
      MessageOf("lines/centres", {"point"}),
      HasSubstr("detector 'centres' has nothing to read at level 1: expected "
                "level 0 (point): circles, lines; level 1 (line): "
                "orientations"));
  EXPECT_THAT(MessageOf("orientations/relations/relations", {"segment"}),
              HasSubstr("level 2 (nothing): none"));
}

}  // namespace
}  // namespace plumbline
