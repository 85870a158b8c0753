#include <plumbline/apps/evaluation/relations.h>
#include <plumbline/core/error.h>
#include <plumbline/frontend/eight_numbers.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <numeric>
#include <string_view>

namespace plumbline {
namespace {

// Allowance for decimal stamps of a few 1e9 s, which doubles hold to 2e-7 s.
constexpr double kStampRounding = 1e-6;

}  // namespace

std::vector<Relation> ReadRelations(const std::string& path) {
  InputStream input(path);
  return ReadRelations(&input);
}

std::vector<Relation> ReadRelations(InputStream* input) {
  const std::string expected = "eight numbers, t1 t2 x y z roll pitch yaw";
  std::vector<Relation> relations;
  std::string_view line;
  std::array<double, 8> row;
  std::string text;
  while (input->ReadLine(&line)) {
    if (!ParseEightNumbers(*input, line, expected, &row, &text)) continue;
    Relation relation;
    relation.time1 = row[0];
    relation.time2 = row[1];
    relation.displacement = Pose2(row[2], row[3], row[7]);
    relation.line = input->line_number();
    relations.push_back(relation);
  }
  RequireUndamaged(*input);
  if (relations.empty())
    throw Error(input->name(), 0, "holds no relation", expected + " a line");
  return relations;
}

TrajectoryIndex::TrajectoryIndex(const std::vector<TimedPose>& trajectory)
    : trajectory_(trajectory), order_(trajectory.size()) {
  std::iota(order_.begin(), order_.end(), 0);
  std::stable_sort(order_.begin(), order_.end(), [&](int a, int b) {
    return trajectory_[a].timestamp < trajectory_[b].timestamp;
  });
}

int TrajectoryIndex::Find(double timestamp, double tolerance) const {
  const auto first_not_before = [&](double time) {
    return std::lower_bound(order_.begin(), order_.end(), time,
                            [&](int index, double value) {
                              return trajectory_[index].timestamp < value;
                            });
  };
  int best = -1;
  double best_distance = tolerance + kStampRounding;
  const auto consider = [&](int index) {
    const double distance = std::abs(trajectory_[index].timestamp - timestamp);
    if (distance < best_distance || (distance == best_distance && best < 0) ||
        (distance == best_distance && index < best)) {
      best = index;
      best_distance = distance;
    }
  };
  const auto after = first_not_before(timestamp);
  if (after != order_.end()) consider(*after);
  if (after != order_.begin()) {
    // Of the equal stamps right before, the first in the file.
    consider(*first_not_before(trajectory_[*(after - 1)].timestamp));
  }
  return best;
}

ErrorStatistics ComputeStatistics(const std::vector<double>& values) {
  ErrorStatistics statistics;
  statistics.count = values.size();
  if (values.empty()) return statistics;
  const double n = static_cast<double>(values.size());
  statistics.mean = std::accumulate(values.begin(), values.end(), 0.0) / n;
  statistics.maximum = *std::max_element(values.begin(), values.end());
  if (values.size() > 1) {
    double sum = 0.0;
    for (const double value : values)
      sum += (value - statistics.mean) * (value - statistics.mean);
    statistics.standard_deviation = std::sqrt(sum / (n - 1.0));
  }
  return statistics;
}

RelationEvaluation EvaluateRelations(const std::vector<TimedPose>& trajectory,
                                     const std::vector<Relation>& relations,
                                     double time_tolerance) {
  const TrajectoryIndex index(trajectory);
  RelationEvaluation evaluation;
  std::array<std::vector<double>, 4> values;
  for (const Relation& relation : relations) {
    const int first = index.Find(relation.time1, time_tolerance);
    const int second = index.Find(relation.time2, time_tolerance);
    if (first < 0 || second < 0) {
      evaluation.unmatched.push_back(relation);
      continue;
    }
    const Pose2 displacement =
        Between(trajectory[first].pose, trajectory[second].pose);
    RelationError error;
    error.relation = relation;
    error.error = Between(relation.displacement, displacement);
    error.translation = std::hypot(error.error[0], error.error[1]);
    error.rotation_deg = std::abs(RadToDeg(error.error[2]));
    values[0].push_back(error.translation);
    values[1].push_back(error.translation * error.translation);
    values[2].push_back(error.rotation_deg);
    values[3].push_back(error.rotation_deg * error.rotation_deg);
    evaluation.errors.push_back(error);
  }
  evaluation.translation = ComputeStatistics(values[0]);
  evaluation.squared_translation = ComputeStatistics(values[1]);
  evaluation.rotation_deg = ComputeStatistics(values[2]);
  evaluation.squared_rotation_deg = ComputeStatistics(values[3]);
  return evaluation;
}

void WriteRelationErrors(const RelationEvaluation& evaluation,
                         std::ostream& output) {
  output << "line,t1,t2,error_x_m,error_y_m,error_theta_deg,translation_m,"
            "rotation_deg\n";
  char text[256];
  for (const RelationError& error : evaluation.errors) {
    std::snprintf(text, sizeof(text), "%d,%.6f,%.6f,%.9g,%.9g,%.9g,%.9g,%.9g\n",
                  error.relation.line, error.relation.time1,
                  error.relation.time2, error.error[0], error.error[1],
                  RadToDeg(error.error[2]), error.translation,
                  error.rotation_deg);
    output << text;
  }
}

}  // namespace plumbline
