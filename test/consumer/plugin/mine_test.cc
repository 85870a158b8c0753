#include <gtest/gtest.h>
#include <plumbline/core/add_types.h>
#include <plumbline/core/error.h>
#include <plumbline/core/graph.h>
#include <plumbline/core/graph_json.h>
#include <plumbline/core/plugin.h>
#include <plumbline/core/registry.h>
#include <plumbline/detectors/builtins.h>
#include <plumbline/factors/angle.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "equal_radius.h"
#include "equal_radius_detector.h"

namespace mine {
namespace {

using plumbline::Constraint;
using plumbline::ConstraintState;
using plumbline::Feature;
using plumbline::Graph;
using plumbline::Registry;
using plumbline::Transaction;

TEST(EqualRadiusTest, ResidualAndJacobianByHand) {
  Registry registry;
  plumbline::RegisterBuiltins(&registry);
  Feature circle;
  circle.type = &registry.GetFeature("circle");
  plumbline::RelationArguments arguments;
  arguments.expected = Eigen::VectorXd::Constant(1, 0.1);
  arguments.sqrt_information = Eigen::MatrixXd::Constant(1, 1, 4.0);
  arguments.features = {&circle, &circle};
  const auto cost =
      plumbline::AddRelation<EqualRadius>(&registry).make_cost(arguments);
  const double first[] = {1.0, 2.0, 0.5};
  const double second[] = {-3.0, 7.0, 0.85};
  const double* blocks[] = {first, second};
  double residual = 0.0;
  double by_first[3];
  double by_second[3];
  double* jacobians[] = {by_first, by_second};
  ASSERT_TRUE(cost->Evaluate(blocks, &residual, jacobians));
  EXPECT_NEAR(residual, 1.0, 1e-12);  // 4 (0.85 - 0.5 - 0.1)
  EXPECT_EQ(std::vector<double>(by_first, by_first + 3),
            (std::vector<double>{0.0, 0.0, -4.0}));
  EXPECT_EQ(std::vector<double>(by_second, by_second + 3),
            (std::vector<double>{0.0, 0.0, 4.0}));
}

TEST(EqualRadiusDetectorTest, ProposesWhatIsNotThereYet) {
  Registry registry;
  plumbline::RegisterBuiltins(&registry);
  plumbline::AddRelation<EqualRadius>(&registry);
  Graph graph;
  Transaction circles;
  for (const double radius : {0.30, 0.38, 0.80, 0.35}) {
    Feature circle;
    circle.type = &registry.GetFeature("circle");
    circle.parameters[2] = radius;
    circles.AddFeature(circle);
  }
  graph.Apply(std::move(circles));

  const EqualRadiusDetector detector(EqualRadiusOptions{});
  Transaction proposal = detector.Detect(graph, registry, {});
  ASSERT_EQ(proposal.added_constraints().size(), 2u);
  EXPECT_EQ(proposal.added_constraints()[0].features,
            (std::vector<plumbline::FeatureId>{0, 1}));
  EXPECT_EQ(proposal.added_constraints()[1].features,
            (std::vector<plumbline::FeatureId>{1, 3}));
  graph.Apply(std::move(proposal));
  EXPECT_TRUE(detector.Detect(graph, registry, {}).empty());
}

// The radii of the circles of columns.g2o after plumbline_solve, and how many
// relations of ours are live.
struct Solved {
  std::vector<double> radii;
  int relations = 0;
  // Lines of columns.csv.
  int lines = 0;
};

Solved Solve(const std::string& flags) {
  std::string name =
      (std::filesystem::temp_directory_path() / "columnsXXXXXX").string();
  const std::filesystem::path folder = mkdtemp(name.data());
  const std::string command = std::string(PLUMBLINE_SOLVE) +
                              " --input=" COLUMNS " --plugins=" PLUGIN
                              " --output_dir=" +
                              folder.string() + " " + flags;
  EXPECT_EQ(std::system(command.c_str()), 0) << command;

  Registry registry;
  plumbline::RegisterBuiltins(&registry);
  plumbline::LoadPlugin(PLUGIN, &registry);
  Graph graph;
  std::ifstream map(folder / "map.json");
  plumbline::ReadGraphJson(map, "map.json", registry, &graph);
  Solved solved;
  for (const Feature* feature : graph.Features()) {
    if (feature->type->Is(plumbline::FeatureRole::kCircle)) {
      solved.radii.push_back(feature->parameters[2]);
    }
  }
  for (const Constraint* constraint : graph.Constraints()) {
    if (constraint->type == registry.FindRelation(EqualRadius::kName) &&
        constraint->state == ConstraintState::kLive) {
      ++solved.relations;
    }
  }
  std::ifstream columns(folder / "columns.csv");
  std::string line;
  while (std::getline(columns, line)) ++solved.lines;
  std::filesystem::remove_all(folder);
  return solved;
}

// Four columns of 0.3 m and a tank of 0.8 m, each seen over an arc that leaves
// its radius open to a few centimetres.
TEST(PluginTest, SolvesByName) {
  const Solved without = Solve("--structure=false");
  const Solved with = Solve("--hierarchy=equal_radius");
  ASSERT_EQ(without.radii.size(), 5u);
  ASSERT_EQ(with.radii.size(), 5u);
  EXPECT_EQ(without.relations, 0);
  EXPECT_EQ(with.relations, 3);
  EXPECT_EQ(with.lines, 6);
  double squares_without = 0.0;
  double squares_with = 0.0;
  for (int i = 0; i < 4; ++i) {
    squares_without += std::pow(without.radii[i] - 0.3, 2);
    squares_with += std::pow(with.radii[i] - 0.3, 2);
    EXPECT_NEAR(with.radii[i], with.radii[0], 0.004);
  }
  EXPECT_LT(squares_with, 0.5 * squares_without);
  // Nothing ties the tank.
  EXPECT_NEAR(with.radii[4], without.radii[4], 1e-6);
}

// The parameters of the detector by name, in units and limits of its own.
TEST(EqualRadiusDetectorTest, ParametersByName) {
  const plumbline::DetectorType type = EqualRadiusDetectorType();
  ASSERT_EQ(type.parameters.size(), 2u);
  EXPECT_EQ(type.parameters[0].name, "gate");
  EXPECT_EQ(type.parameters[1].default_value, EqualRadiusOptions().sigma);
  EXPECT_EQ(type.parameters[1].unit, "m");
  EXPECT_NO_THROW(type.make({{"gate", 0.2}}));
  EXPECT_THROW(type.make({{"gate", -1.0}}), plumbline::Error);
  EXPECT_THROW(type.make({{"gaet", 0.2}}), plumbline::Error);
  // A gate that no two columns fit in.
  EXPECT_EQ(Solve("--hierarchy=equal_radius "
                  "--detector_parameters=equal_radius.gate=0")
                .relations,
            0);
}

// A robot that drives along a corridor of 8 m x 4 m.
TEST(PluginTest, ReadsALogByItself) {
  std::string name =
      (std::filesystem::temp_directory_path() / "rangesXXXXXX").string();
  const std::filesystem::path folder = mkdtemp(name.data());
  std::ofstream log(folder / "drive.txt");
  log << "#ranges\n";
  for (int scan = 0; scan < 5; ++scan) {
    const double x = 0.2 * scan;
    log << 10 + scan << ".25 " << x << " 0 0";
    for (int beam = 0; beam < 180; ++beam) {
      const double angle = (beam - 90) * plumbline::kPi / 180.0;
      const double to_front = (8.0 - x) / std::max(1e-9, std::cos(angle));
      const double to_side = 2.0 / std::max(1e-9, std::abs(std::sin(angle)));
      log << ' ' << std::min(to_front, to_side);
    }
    log << '\n';
  }
  log.close();
  const std::string command =
      std::string(PLUMBLINE_SOLVE) +
      " --input=" + (folder / "drive.txt").string() +
      " --plugins=" PLUGIN " --output_dir=" + (folder / "out").string();
  ASSERT_EQ(std::system(command.c_str()), 0) << command;
  std::ifstream trajectory(folder / "out" / "trajectory.tum");
  std::string line;
  std::string last;
  int poses = 0;
  while (std::getline(trajectory, line)) {
    if (line.empty() || line[0] == '#') continue;
    ++poses;
    last = line;
  }
  EXPECT_EQ(poses, 5);
  EXPECT_EQ(last.substr(0, 5), "14.25") << last;
  std::filesystem::remove_all(folder);
}

TEST(PluginTest, IsListed) {
  std::string name =
      (std::filesystem::temp_directory_path() / "columnsXXXXXX").string();
  const std::filesystem::path folder = mkdtemp(name.data());
  const std::string list = folder / "list";
  const std::string command = std::string(PLUMBLINE_SOLVE) +
                              " --plugins=" PLUGIN " --list_plugins > " + list;
  ASSERT_EQ(std::system(command.c_str()), 0);
  std::ifstream file(list);
  const std::string text((std::istreambuf_iterator<char>(file)), {});
  EXPECT_NE(text.find("columns cast in one mould"), std::string::npos) << text;
  EXPECT_NE(text.find("R2 - R1 - u; m"), std::string::npos) << text;
  EXPECT_NE(text.find("\n  columns.csv "), std::string::npos) << text;
  EXPECT_NE(text.find("\n  ranges "), std::string::npos) << text;
  std::filesystem::remove_all(folder);
}

}  // namespace
}  // namespace mine
