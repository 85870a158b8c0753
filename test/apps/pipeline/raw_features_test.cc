#include <gtest/gtest.h>
#include <plumbline/detectors/builtins.h>
#include <plumbline/pipeline/log_solver.h>
#include <plumbline/pipeline/raw_features.h>

#include <vector>

namespace plumbline {
namespace {

TEST(RawFeaturesTest, ProfilesNameTheirOwnKind) {
  Registry registry;
  RegisterBuiltins(&registry);
  for (const RawFeatures kind :
       {RawFeatures::kSegments, RawFeatures::kPoints}) {
    const RawFeatureProfile& profile = ProfileOf(kind);
    EXPECT_EQ(profile.kind, kind);
    Graph graph;
    const LogSolverOptions options;
    EXPECT_EQ(profile.make_builder(options, &graph, registry)->feature_type(),
              profile.feature_type);
    // Parameters that the detectors have.
    for (const auto& [detector, parameters] : profile.detector_parameters) {
      DetectorParameters values = registry.GetDetector(detector).defaults();
      for (const auto& [name, value] : parameters) {
        EXPECT_EQ(values.count(name), 1u) << detector << "." << name;
        values[name] = value;
      }
      EXPECT_NE(registry.GetDetector(detector).make(values), nullptr);
    }
  }
}

TEST(RawFeaturesTest, OfAGraph) {
  Registry registry;
  RegisterBuiltins(&registry);
  const auto kind = [&](const std::vector<const char*>& names) {
    std::vector<const FeatureType*> types;
    for (const char* name : names) types.push_back(&registry.GetFeature(name));
    return ProfileOf(types).kind;
  };
  EXPECT_EQ(kind({}), RawFeatures::kSegments);
  EXPECT_EQ(kind({"segment", "pose"}), RawFeatures::kSegments);
  EXPECT_EQ(kind({"point", "segment"}), RawFeatures::kPoints);
}

TEST(RawFeaturesTest, WhatAKindCannotDoIsOff) {
  LogSolverOptions options;
  options.em_depth = 7;
  options.detector_parameters["line_ransac"]["gate"] = 0.5;
  const LogSolverOptions segments =
      WithProfile(ProfileOf(RawFeatures::kSegments), options);
  EXPECT_TRUE(segments.global_association);
  EXPECT_TRUE(segments.complete_walls);
  EXPECT_EQ(segments.refine, Refinement::kFull);
  EXPECT_EQ(segments.em_depth, 7);
  EXPECT_EQ(segments.detector_parameters, options.detector_parameters);

  LogSolverOptions points =
      WithProfile(ProfileOf(RawFeatures::kPoints), options);
  EXPECT_FALSE(points.global_association);
  EXPECT_FALSE(points.complete_walls);
  EXPECT_EQ(points.refine, Refinement::kMap);
  EXPECT_EQ(points.em_depth, 1);
  // What was given stays, the rest is filled in.
  EXPECT_EQ(points.detector_parameters["line_ransac"]["gate"], 0.5);
  EXPECT_EQ(points.detector_parameters["line_ransac"]["tolerance"], 0.1);
  options.refine = Refinement::kNone;
  EXPECT_EQ(WithProfile(ProfileOf(RawFeatures::kPoints), options).refine,
            Refinement::kNone);
}

}  // namespace
}  // namespace plumbline
