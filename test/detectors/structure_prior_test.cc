#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <plumbline/core/error.h>
#include <plumbline/core/graph.h>
#include <plumbline/core/session.h>
#include <plumbline/detectors/builtins.h>
#include <plumbline/detectors/structure_prior.h>
#include <plumbline/factors/angle.h>

#include <cmath>
#include <map>
#include <sstream>
#include <string>
#include <utility>
#include <vector>

namespace plumbline {
namespace {

using ::testing::HasSubstr;
using ::testing::StartsWith;

class StructurePriorTest : public ::testing::Test {
 protected:
  StructurePriorTest() { RegisterBuiltins(&registry_); }

  StructurePrior Read(const std::string& text) const {
    std::istringstream input(text);
    return ReadStructurePrior(input, "wings.prior", registry_);
  }

  std::string Refusal(const std::string& text) const {
    try {
      Read(text);
    } catch (const Error& error) {
      return error.what();
    }
    return "no error";
  }

  Registry registry_;
};

TEST_F(StructurePriorTest, ReadsWhatItSays) {
  const StructurePrior prior = Read(
      "# Three wings.\n"
      "angle 0\n"
      "angle -60 0.05   # built well\r\n"
      "\n"
      "\trelation segment_rectangle 0.05 m 0.3 deg\n"
      "relation orientation_orientation 0.02 deg\n"
      "relation line_orientation no");
  ASSERT_EQ(prior.angles.size(), 2u);
  EXPECT_EQ(prior.angles[0].angle_deg, 0.0);
  EXPECT_EQ(prior.angles[0].sigma_deg, 0.0);
  EXPECT_EQ(prior.angles[1].angle_deg, -60.0);
  EXPECT_EQ(prior.angles[1].sigma_deg, 0.05);
  ASSERT_EQ(prior.relations.size(), 3u);
  EXPECT_FALSE(prior.relations.at("line_orientation").is_expected);
  EXPECT_TRUE(prior.relations.at("line_orientation").tolerances.empty());
  const PriorRelation& side = prior.relations.at("segment_rectangle");
  ASSERT_EQ(side.tolerances.size(), 2u);
  EXPECT_EQ(side.tolerances[0].sigma, 0.05);
  EXPECT_FALSE(side.tolerances[0].is_angle);
  EXPECT_EQ(side.tolerances[1].sigma, 0.3);
  EXPECT_TRUE(side.tolerances[1].is_angle);
}

TEST_F(StructurePriorTest, RoundTrip) {
  const std::string text =
      "angle 0\n"
      "angle 22.5 0.1\n"
      "angle -60.000001 1e-06\n"
      "relation line_orientation no\n"
      "relation orientation_orientation 0.02 deg\n"
      "relation point_line_distance 0.1 m\n"
      "relation segment_rectangle 0.3333333333333333 m 45 deg\n";
  std::ostringstream written;
  WriteStructurePrior(Read(text), written);
  EXPECT_EQ(written.str(), text);
}

TEST_F(StructurePriorTest, BrokenOnesAreRefusedByLine) {
  // Each behind a line that is right.
  const std::vector<std::pair<const char*, const char*>> cases = {
      {"angel 90", "'angel' is no statement: expected angle or relation"},
      {"angle", "expected angle DEGREES [TOLERANCE]"},
      {"angle 90 1 2", "an angle with 3 numbers"},
      {"angle ninety", "cannot read 'ninety': expected a number"},
      {"angle nan", "cannot read 'nan'"},
      {"angle 90deg", "cannot read '90deg'"},
      {"angle 400", "an angle of 400 degrees: expected -360 to 360"},
      {"angle 90 0", "a tolerance of 0: expected 1e-6 to 45"},
      {"angle 90 -1", "a tolerance of -1"},
      {"angle 90 46", "a tolerance of 46"},
      {"angle -30",
       "an angle of -30 degrees again: expected each angle once; "
       "it is in line 1"},
      {"angle 150", "again"},
      {"relation", "a relation without a tolerance"},
      {"relation segment_orientation", "a relation without a tolerance"},
      {"relation wall_wall 1 m",
       "there is no relation 'wall_wall': expected "
       "one of "},
      {"relation segment_orientation 1", "1 tolerance with its unit"},
      {"relation segment_orientation 1 deg 1 deg", "1 tolerance with its unit"},
      {"relation segment_rectangle 0.1 m", "2 tolerances, each with its unit"},
      {"relation segment_rectangle 0.1 deg 0.1 deg",
       "the unit deg in row 0 of segment_rectangle: expected m"},
      {"relation segment_orientation 0.1 m",
       "the unit m in row 0 of segment_orientation: expected deg"},
      {"relation segment_orientation 0.1 rad",
       "the unit rad in row 0 of segment_orientation: expected deg"},
      {"relation segment_orientation inf deg", "cannot read 'inf'"},
      {"relation segment_orientation 0 deg", "a tolerance of 0"},
      {"relation segment_orientation maybe", "1 tolerance with its unit"},
      {"relation segment_orientation no deg", "cannot read 'no'"}};
  for (const auto& [line, what] : cases) {
    const std::string refusal = Refusal(std::string("angle 30\n") + line);
    EXPECT_THAT(refusal, StartsWith("wings.prior:2: ")) << line;
    EXPECT_THAT(refusal, HasSubstr(what)) << line;
  }
  EXPECT_THAT(Refusal("relation segment_orientation no\n# so\n\n"
                      "relation segment_orientation 1 deg\n"),
              StartsWith("wings.prior:4: the relation segment_orientation "
                         "again: expected each relation once; it is in line "
                         "1"));
  for (const char* const text : {"", "# nothing\n\n"}) {
    EXPECT_THAT(Refusal(text), StartsWith("wings.prior: says nothing"));
  }
}

TEST_F(StructurePriorTest, TakesThePlaceOfWhatIsThere) {
  EmOptions options;
  std::map<std::string, DetectorParameters> parameters = {
      {"orientation_relation",
       {{"sigma_deg", 0.5}, {"angle_0", 45.0}, {"resolution_deg", 10.0}}},
      {"line_ransac", {{"sigma", 1.0}}}};
  ApplyStructurePrior(Read("angle 0\nangle 60 0.05\n"
                           "relation segment_orientation 0.3 deg\n"
                           "relation orientation_orientation 0.2 deg\n"
                           "relation line_orientation no\n"),
                      &options, &parameters);
  EXPECT_EQ(parameters["orientation_relation"],
            (DetectorParameters{{"sigma_deg", 0.2},
                                {"angle_0", 0.0},
                                {"angle_1", 60.0},
                                {"angle_sigma_deg_1", 0.05}}));
  EXPECT_EQ(parameters["line_ransac"], (DetectorParameters{{"sigma", 1.0}}));
  ASSERT_EQ(options.relation_priors.size(), 3u);
  EXPECT_EQ(options.relation_priors["segment_orientation"].sigmas,
            std::vector<double>{DegToRad(0.3)});
  EXPECT_FALSE(options.relation_priors["line_orientation"].is_expected);
  EXPECT_TRUE(
      options.relation_priors["orientation_orientation"].sigmas.empty());
}

// In the whole loop: three wings at 60 degrees.
TEST_F(StructurePriorTest, IsWhatTheLoopWorksWith) {
  const auto run = [&](const std::string& text, Graph* graph) {
    Transaction transaction;
    for (int i = 0; i < 12; ++i) {
      Feature segment;
      segment.type = &registry_.GetFeature("segment");
      segment.parameters = {1.0 * i, 2.0 * i, DegToRad(60.0 * (i % 3))};
      segment.extent_end = 5.0;
      transaction.AddFeature(segment);
    }
    graph->Apply(std::move(transaction));
    EmOptions options;
    std::map<std::string, DetectorParameters> parameters;
    if (!text.empty()) ApplyStructurePrior(Read(text), &options, &parameters);
    SolverSession session(graph, registry_, {});
    EmOrchestrator em(
        graph, &session, registry_,
        MakeHierarchy(
            ParseHierarchy("orientation_mixture/orientation_relation"),
            registry_, {"segment"}, parameters),
        options);
    em.Run();
    std::map<std::string, std::vector<double>> sigmas;
    for (const Constraint* constraint : graph->Constraints()) {
      sigmas[constraint->type->name].push_back(
          RadToDeg(1.0 / std::sqrt(constraint->information(0, 0))));
    }
    return sigmas;
  };
  Graph without;
  auto sigmas = run("", &without);
  EXPECT_EQ(sigmas["segment_orientation"].size(), 12u);
  EXPECT_NEAR(sigmas["segment_orientation"][0], 0.1, 1e-9);
  EXPECT_EQ(sigmas.count("orientation_orientation"), 0u);
  Graph with;
  sigmas = run("angle 60 0.07\nangle 90\nrelation segment_orientation 0.4 deg",
               &with);
  ASSERT_EQ(sigmas["segment_orientation"].size(), 12u);
  for (const double sigma : sigmas["segment_orientation"]) {
    EXPECT_NEAR(sigma, 0.4, 1e-9);
  }
  ASSERT_EQ(sigmas["orientation_orientation"].size(), 3u);
  for (const double sigma : sigmas["orientation_orientation"]) {
    EXPECT_NEAR(sigma, 0.07, 1e-9);
  }
  Graph not_expected;
  sigmas = run("relation segment_orientation no", &not_expected);
  EXPECT_TRUE(sigmas.empty());
  EXPECT_EQ(not_expected.num_features(), 12u);

  // By hand: a wrong number of sigmas.
  Graph wrong;
  Transaction transaction;
  for (int i = 0; i < 4; ++i) {
    Feature segment;
    segment.type = &registry_.GetFeature("segment");
    segment.extent_end = 5.0;
    transaction.AddFeature(segment);
  }
  wrong.Apply(std::move(transaction));
  EmOptions options;
  options.relation_priors["segment_orientation"].sigmas = {0.1, 0.1};
  SolverSession session(&wrong, registry_, {});
  EmOrchestrator em(&wrong, &session, registry_,
                    MakeHierarchy(ParseHierarchy("orientation_mixture"),
                                  registry_, {"segment"}, {}),
                    options);
  EXPECT_THROW(em.Run(), Error);
}

}  // namespace
}  // namespace plumbline
