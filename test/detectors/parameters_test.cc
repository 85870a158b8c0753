#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <plumbline/core/detector.h>
#include <plumbline/core/error.h>
#include <plumbline/detectors/builtins.h>
#include <plumbline/detectors/parameters.h>
#include <plumbline/factors/angle.h>

#include <cmath>
#include <limits>
#include <map>
#include <memory>
#include <string>

namespace plumbline {
namespace {

using ::testing::HasSubstr;

struct Options {
  double reach = 2.0;
  double turn = DegToRad(30.0);
  double share = 0.5;
  int count = 3;
  std::map<std::string, double> angles;
};

void Bind(ParameterBinder* parameters, Options* options) {
  parameters->Length("reach", &options->reach, 0.0, ParameterBinder::kNoLimit,
                     "how far it looks");
  parameters->Angle("turn_deg", &options->turn, 0.0, 90.0, "how far it turns");
  parameters->Number("share", &options->share, 0.0, 1.0, "", "how much");
  parameters->Count("count", &options->count, 1, "how many");
  parameters->AngleList("angle_", &options->angles, -360.0, 360.0, "which");
}

class NoDetector : public StructureDetector {
 public:
  const std::string& name() const override {
    static const std::string name = "none";
    return name;
  }
  Transaction Detect(const Graph&, const Registry&,
                     const DetectionScope&) const override {
    return {};
  }
};

class ParametersTest : public ::testing::Test {
 protected:
  ParametersTest() {
    type_.name = "mine";
    SetParameters<Options>(
        Bind,
        [this](const Options& options) {
          made_ = options;
          return std::make_unique<NoDetector>();
        },
        &type_);
  }

  std::string Refusal(const DetectorParameters& given) {
    try {
      type_.make(given);
    } catch (const Error& error) {
      return error.what();
    }
    return "no error";
  }

  DetectorType type_;
  Options made_;
};

TEST_F(ParametersTest, AreListedWithDefaultsUnitsAndMeanings) {
  ASSERT_EQ(type_.parameters.size(), 5u);
  EXPECT_EQ(type_.parameters[0].name, "reach");
  EXPECT_EQ(type_.parameters[0].default_value, 2.0);
  EXPECT_EQ(type_.parameters[0].unit, "m");
  EXPECT_EQ(type_.parameters[0].description, "how far it looks");
  EXPECT_NEAR(type_.parameters[1].default_value, 30.0, 1e-12);
  EXPECT_EQ(type_.parameters[1].unit, "deg");
  EXPECT_EQ(type_.parameters[3].default_value, 3.0);
  EXPECT_TRUE(type_.parameters[4].is_list);
  EXPECT_EQ(type_.defaults().size(), 4u);
  EXPECT_EQ(type_.defaults().count("angle_"), 0u);
}

TEST_F(ParametersTest, AreSetByName) {
  type_.make({{"turn_deg", 90.0}, {"count", 7.0}, {"angle_1", 180.0}});
  EXPECT_EQ(made_.reach, 2.0);
  EXPECT_EQ(made_.turn, DegToRad(90.0));
  EXPECT_EQ(made_.share, 0.5);
  EXPECT_EQ(made_.count, 7);
  EXPECT_EQ(made_.angles,
            (std::map<std::string, double>{{"1", DegToRad(180.0)}}));
}

TEST_F(ParametersTest, WhatDoesNotFitIsRefused) {
  EXPECT_THAT(Refusal({{"raech", 1.0}}),
              HasSubstr("mine has no parameter \"raech\": expected one of "
                        "reach, turn_deg, share, count, angle_0 ..."));
  EXPECT_THAT(Refusal({{"reach", -1.0}}),
              HasSubstr("mine: reach is -1: expected a finite number of at "
                        "least 0"));
  EXPECT_THAT(Refusal({{"turn_deg", 91.0}}),
              HasSubstr("expected a finite number of at least 0 and at most "
                        "90"));
  EXPECT_THAT(Refusal({{"count", 2.5}}), HasSubstr("expected a whole number"));
  EXPECT_THAT(Refusal({{"count", 0.0}}), HasSubstr("count is 0"));
  EXPECT_THAT(Refusal({{"angle_0", 361.0}}), HasSubstr("angle_0 is 361"));
  EXPECT_THAT(Refusal({{"angle_x", 1.0}}), HasSubstr("no parameter"));
  EXPECT_THAT(Refusal({{"share", std::nan("")}}), HasSubstr("share is nan"));
  EXPECT_THAT(Refusal({{"reach", std::numeric_limits<double>::infinity()}}),
              HasSubstr("reach is inf"));
}

// Every parameter of every detector says what it is, and its default is one
// that the detector takes.
TEST(BuiltinParametersTest, SayWhatTheyAre) {
  Registry registry;
  RegisterBuiltins(&registry);
  for (const DetectorType* type : registry.detectors()) {
    EXPECT_FALSE(type->parameters.empty()) << type->name;
    for (const DetectorParameter& parameter : type->parameters) {
      SCOPED_TRACE(type->name + "." + parameter.name);
      EXPECT_FALSE(parameter.description.empty());
      EXPECT_EQ(
          parameter.name.find("_deg") != std::string::npos || parameter.is_list,
          parameter.unit == "deg");
      if (parameter.is_list) continue;
      EXPECT_NO_THROW(type->make({{parameter.name, parameter.default_value}}));
    }
  }
}

}  // namespace
}  // namespace plumbline
