#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <plumbline/apps/experiments/experiments.h>
#include <plumbline/core/error.h>
#include <plumbline/core/session.h>
#include <plumbline/detectors/builtins.h>

#include <cmath>
#include <filesystem>
#include <fstream>
#include <sstream>
#include <string>
#include <utility>
#include <vector>

namespace plumbline {
namespace {

using ::testing::HasSubstr;
using ::testing::Not;

class ExperimentsTest : public ::testing::Test {
 protected:
  ExperimentsTest() { RegisterBuiltins(&registry_); }

  static std::string Csv(const ExperimentResult& result) {
    std::ostringstream output;
    WriteTrials(result, output);
    return output.str();
  }

  static std::string Text(const ExperimentResult& result) {
    std::ostringstream output;
    WriteExperimentSummary(result, output);
    return output.str();
  }

  Registry registry_;
};

int CountStructure(const Graph& graph) {
  int count = 0;
  for (const Constraint* constraint : graph.Constraints()) {
    if (constraint->kind == ConstraintClass::kStructure) ++count;
  }
  return count;
}

TEST_F(ExperimentsTest, FourWaysToSayConcentric) {
  const std::vector<std::pair<Concentricity, int>> counts = {
      {Concentricity::kChain, 6},
      {Concentricity::kStar, 6},
      {Concentricity::kAllPairs, 21},
      {Concentricity::kCommonCenter, 7}};
  for (const auto& [method, count] : counts) {
    SyntheticWorld world =
        MakeSyntheticWorld("S6", DefaultSyntheticOptions("S6"), 1, registry_);
    AddConcentricity(method, 0.1, registry_, world.graph.get());
    EXPECT_EQ(CountStructure(*world.graph), count);
    EXPECT_EQ(world.graph->num_features(),
              method == Concentricity::kCommonCenter ? 9u : 8u);
    const ConcentricityResult before =
        CheckConcentricity(*world.graph, world.truth);
    EXPECT_FALSE(before.is_isolated);
    // The outlier may be what holds a chain or star together.
    if (method == Concentricity::kAllPairs ||
        method == Concentricity::kCommonCenter) {
      EXPECT_TRUE(before.is_intact);
    }
    // Without what is on the outlier it is isolated.
    Transaction transaction;
    for (const Constraint* constraint :
         std::as_const(*world.graph).Constraints()) {
      if (constraint->kind != ConstraintClass::kStructure) continue;
      for (const FeatureId id : constraint->features) {
        if (id == world.truth.outliers[0]) {
          transaction.BreakConstraint(constraint->id);
        }
      }
    }
    world.graph->Apply(std::move(transaction));
    EXPECT_TRUE(CheckConcentricity(*world.graph, world.truth).is_isolated);
  }
}

TEST_F(ExperimentsTest, NoStructureIsIsolatedButNotIntact) {
  const SyntheticWorld world =
      MakeSyntheticWorld("S6", DefaultSyntheticOptions("S6"), 1, registry_);
  const ConcentricityResult result =
      CheckConcentricity(*world.graph, world.truth);
  EXPECT_TRUE(result.is_isolated);
  EXPECT_FALSE(result.is_intact);
}

TEST_F(ExperimentsTest, CommonCentreIsolatesTheOutlierInAllTrials) {
  ExperimentOptions options;
  const ExperimentResult result = RunExperiment("S6", options, &registry_);
  ASSERT_EQ(result.trials.size(), 180u);
  ASSERT_EQ(result.claims.size(), 1u);
  EXPECT_TRUE(result.claims[0].holds);
  EXPECT_EQ(result.claims[0].measured.value, 1.0);
  int chain = 0;
  for (const TrialRow& row : result.trials) {
    EXPECT_EQ(row.Get("right"),
              row.Get("outlier_isolated") * row.Get("others_connected"));
    if (row.condition == "1: each and the next, 0.1 m") {
      chain += static_cast<int>(row.Get("right"));
    }
  }
  EXPECT_LT(chain, 20);
}

TEST_F(ExperimentsTest, OracleOnPerfectDistances) {
  SyntheticOptions world_options;
  world_options.position_noise = 0.05;
  world_options.distance_noise = 0.0;
  SyntheticWorld world = MakeSyntheticWorld("S1", world_options, 1, registry_);
  EXPECT_GT(MeanPositionError(*world.graph, world.truth), 0.03);
  const OracleErrors errors =
      RunOracle(registry_, SyntheticRunOptions(), &world);
  EXPECT_LT(errors.full, 1e-6);
  EXPECT_LT(errors.weighted, 1e-6);
}

TEST_F(ExperimentsTest, StructureAndTheOracleBeatDistances) {
  SyntheticRunOptions options;
  const SyntheticOptions world_options = DefaultSyntheticOptions("S1");
  SyntheticWorld world = MakeSyntheticWorld("S1", world_options, 3, registry_);
  const SyntheticRun run = RunOnWorld(registry_, options, &world);
  world = MakeSyntheticWorld("S1", world_options, 3, registry_);
  const OracleErrors oracle = RunOracle(registry_, options, &world);
  EXPECT_LT(oracle.full, 0.6 * run.distances_error);
  EXPECT_LT(oracle.weighted, 0.6 * run.distances_error);
  EXPECT_NE(oracle.weighted, oracle.full);
  EXPECT_LT(run.final_error, run.distances_error);
  EXPECT_GT(run.match.all().found, 14);
  ASSERT_GE(run.phases.size(), 3u);
  EXPECT_EQ(run.phases[0].name, "start");
  EXPECT_EQ(run.phases[0].error, run.start_error);
  EXPECT_EQ(run.phases[1].name, "measurements");
  // EM's own first solve ends a little earlier.
  EXPECT_NEAR(run.phases[1].error, run.distances_error,
              0.01 * run.distances_error);
  EXPECT_EQ(run.phases.back().error, run.final_error);
}

// Walls of two corridors in a row, 0.5 m out of line, that the distances of
// these worlds bring near to one line (the first two most of all).
TEST_F(ExperimentsTest, WallsALittleOutOfLineAreTwo) {
  int exact = 0;
  for (const std::uint64_t seed :
       {216, 292, 201, 202, 203, 204, 205, 206, 207, 208}) {
    SyntheticWorld world = MakeSyntheticWorld(
        "S1", DefaultSyntheticOptions("S1"), seed, registry_);
    if (RunOnWorld(registry_, {}, &world).match.is_exact()) ++exact;
  }
  EXPECT_GE(exact, 9);
}

// Worlds whose maps were 1.4 to 2.4 times as far off as with the true
// structure: out of square by more than 0.7 degrees (414), the end of a wall
// tied to the wall across (1014, 2410), both (2816).
TEST_F(ExperimentsTest, FoundStructureIsAsGoodAsTheTrueOne) {
  for (const std::uint64_t seed : {414u, 1014u, 2410u, 2816u}) {
    SCOPED_TRACE(seed);
    const auto make = [&] {
      return MakeSyntheticWorld("S1", DefaultSyntheticOptions("S1"), seed,
                                registry_);
    };
    SyntheticRunOptions options;
    options.seed = seed;
    SyntheticWorld world = make();
    const SyntheticRun run = RunOnWorld(registry_, options, &world);
    SyntheticWorld other = make();
    EXPECT_LT(run.final_error,
              1.2 * RunOracle(registry_, options, &other).full);
    EXPECT_TRUE(run.match.is_exact());
  }
}

TEST_F(ExperimentsTest, WithoutDetectorsNothingIsFound) {
  SyntheticRunOptions options;
  options.hierarchy = "";
  SyntheticWorld world =
      MakeSyntheticWorld("S1", DefaultSyntheticOptions("S1"), 1, registry_);
  const SyntheticRun run = RunOnWorld(registry_, options, &world);
  EXPECT_EQ(run.match.all().found, 0);
  EXPECT_NEAR(run.final_error, run.distances_error, 1e-4);
}

TEST_F(ExperimentsTest, SameBytesWithAnyNumberOfThreads) {
  for (const std::string id : {"S1", "S6"}) {
    ExperimentOptions options;
    options.trials = 2;
    const ExperimentResult one = RunExperiment(id, options, &registry_);
    options.num_threads = 2;
    const ExperimentResult two = RunExperiment(id, options, &registry_);
    EXPECT_EQ(Csv(one), Csv(two));
    EXPECT_EQ(Text(one), Text(two));
    EXPECT_EQ(PlotSvg(one.plots), PlotSvg(two.plots));
    EXPECT_THAT(Csv(one), Not(HasSubstr("nan")));
  }
}

TEST_F(ExperimentsTest, TrialsHaveTheSeedsFromTheFirstOn) {
  ExperimentOptions options;
  options.trials = 2;
  options.seed = 7;
  const ExperimentResult result = RunExperiment("S6", options, &registry_);
  ASSERT_EQ(result.trials.size(), 18u);
  EXPECT_EQ(result.trials[0].seed, 7u);
  EXPECT_EQ(result.trials[1].seed, 8u);
  EXPECT_EQ(result.trials[2].seed, 7u);
  EXPECT_EQ(result.trials[2].condition, "2: all to one, 0.1 m");
}

TEST_F(ExperimentsTest, EndsWhenAsked) {
  ExperimentOptions options;
  options.trials = 3;
  int asked = 0;
  options.stop = [&asked] { return ++asked > 40; };
  const ExperimentResult result = RunExperiment("S6", options, &registry_);
  EXPECT_TRUE(result.interrupted);
  EXPECT_LT(result.trials.size(), 27u);
  EXPECT_THAT(Text(result), HasSubstr("Cut short"));
  options.stop = [] { return true; };
  EXPECT_TRUE(RunExperiment("S2", options, &registry_).trials.empty());
  // What no trial speaks of neither holds nor fails.
  const ExperimentResult nothing = RunExperiment("S6", options, &registry_);
  ASSERT_FALSE(nothing.claims.empty());
  for (const Claim& claim : nothing.claims) {
    EXPECT_FALSE(IsKnown(claim)) << claim.text;
    EXPECT_STREQ(Verdict(claim), "not known") << claim.text;
  }
  EXPECT_THAT(Text(nothing), Not(HasSubstr("FAILS")));
}

TEST_F(ExperimentsTest, SkipsLogsThatAreNotThere) {
  ExperimentOptions options;
  const ExperimentResult unset = RunExperiment("R1", options, &registry_);
  EXPECT_THAT(unset.skipped, HasSubstr("PLUMBLINE_DATASETS"));
  options.datasets = "/no/such/folder";
  const ExperimentResult missing = RunExperiment("R2", options, &registry_);
  EXPECT_THAT(missing.skipped, HasSubstr("intel.clf.bz2"));
  EXPECT_THAT(Text(missing), HasSubstr("Skipped"));
}

TEST_F(ExperimentsTest, WritesItsFiles) {
  const std::string folder = ::testing::TempDir() + "/plumbline_experiments";
  std::filesystem::remove_all(folder);
  std::filesystem::create_directories(folder);
  ExperimentOptions options;
  options.trials = 2;
  WriteExperiment(RunExperiment("S6", options, &registry_), folder);
  WriteExperiment(RunExperiment("R1", options, &registry_), folder);
  for (const char* name : {"S6.csv", "S6_summary.csv", "S6_summary.txt",
                           "S6.svg", "R1_summary.txt"}) {
    EXPECT_TRUE(std::filesystem::exists(folder + "/" + name)) << name;
  }
  EXPECT_FALSE(std::filesystem::exists(folder + "/R1.csv"));
  std::ifstream csv(folder + "/S6.csv");
  std::string header;
  std::getline(csv, header);
  EXPECT_EQ(header,
            "experiment,condition,seed,error_start,error_structure,"
            "outlier_isolated,others_connected,right,live,broken,iterations,"
            "converged");
  int rows = 0;
  for (std::string line; std::getline(csv, line);) ++rows;
  EXPECT_EQ(rows, 18);
  std::filesystem::remove_all(folder);
}

TEST_F(ExperimentsTest, SummaryHasTheMeanOfEveryValue) {
  ExperimentResult result;
  result.id = "X";
  result.trials = {
      {"a", 1, {{"v", 1.0}}}, {"a", 2, {{"v", 3.0}}}, {"b", 1, {{"v", 7.0}}}};
  const std::vector<SummaryRow> rows = Summarize(result);
  ASSERT_EQ(rows.size(), 2u);
  EXPECT_EQ(rows[0].condition, "a");
  EXPECT_EQ(rows[0].trials, 2);
  EXPECT_DOUBLE_EQ(rows[0].mean.value, 2.0);
  EXPECT_DOUBLE_EQ(rows[1].mean.value, 7.0);
  EXPECT_EQ(Csv(result),
            "experiment,condition,seed,v\nX,\"a\",1,1\nX,\"a\",2,3\n"
            "X,\"b\",1,7\n");
  EXPECT_THROW(result.trials[0].Get("w"), Error);
}

TEST_F(ExperimentsTest, RefusesWhatItCannotRun) {
  ExperimentOptions options;
  EXPECT_THROW(RunExperiment("S7", options, &registry_), Error);
  options.trials = 0;
  EXPECT_THROW(RunExperiment("S1", options, &registry_), Error);
  options = {};
  options.delta_mode = "no_such_mode";
  EXPECT_THROW(RunExperiment("S6", options, &registry_), Error);
  options = {};
  options.hierarchy = "no_such_detector";
  EXPECT_THROW(RunExperiment("S1", options, &registry_), Error);
}

}  // namespace
}  // namespace plumbline
