#include <plumbline/apps/relations.h>
#include <plumbline/core/error.h>

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <cstdio>
#include <numeric>
#include <string_view>

namespace plumbline {
namespace {

constexpr char kBlanks[] = " \t\r";

// Allowance for decimal stamps of a few 1e9 s, which doubles hold to 2e-7 s.
constexpr double kStampRounding = 1e-6;

// The eight numbers of a line of either format. Empty and comment lines give
// false.
bool ParseRow(const InputStream& input, std::string_view line,
              const std::string& expected, std::array<double, 8>* numbers,
              std::string* first_text) {
  std::size_t count = 0;
  while (true) {
    const std::size_t begin = line.find_first_not_of(kBlanks);
    if (begin == std::string_view::npos) break;
    line.remove_prefix(begin);
    if (count == 0 && line.front() == '#') return false;
    const std::string_view token = line.substr(0, line.find_first_of(kBlanks));
    line.remove_prefix(token.size());
    if (count == 0) *first_text = std::string(token);
    if (count < numbers->size()) {
      const char* const end = token.data() + token.size();
      const auto result = std::from_chars(token.data(), end, (*numbers)[count]);
      if (result.ec != std::errc() || result.ptr != end ||
          !std::isfinite((*numbers)[count])) {
        throw Error(
            input.name(), input.line_number(),
            "'" + std::string(token.substr(0, 40)) + "' is no finite number",
            expected);
      }
    }
    ++count;
  }
  if (count == 0) return false;
  if (count != numbers->size()) {
    throw Error(input.name(), input.line_number(),
                std::to_string(count) + " fields", expected);
  }
  return true;
}

void RequireUndamaged(const InputStream& input) {
  if (!input.damage().empty())
    throw Error(input.name(), input.line_number(), input.damage(),
                "a whole file");
}

}  // namespace

void WriteTum(const std::vector<TimedPose>& trajectory, std::ostream& output) {
  char text[256];
  for (const TimedPose& timed : trajectory) {
    if (!timed.pose.allFinite() || !std::isfinite(timed.timestamp)) {
      throw PLUMBLINE_ERROR("pose of the trajectory is not finite",
                            "finite poses and time stamps");
    }
    if (timed.timestamp_text.empty()) {
      std::snprintf(text, sizeof(text), "%.6f", timed.timestamp);
      output << text;
    } else {
      output << timed.timestamp_text;
    }
    const double half = 0.5 * NormalizeAngle(timed.pose[2]);
    std::snprintf(text, sizeof(text), " %.9f %.9f 0 0 0 %.12f %.12f\n",
                  timed.pose[0], timed.pose[1], std::sin(half), std::cos(half));
    output << text;
  }
}

std::vector<TimedPose> ReadTum(const std::string& path) {
  InputStream input(path);
  return ReadTum(&input);
}

std::vector<TimedPose> ReadTum(InputStream* input) {
  const std::string expected = "eight numbers, timestamp x y z qx qy qz qw";
  std::vector<TimedPose> trajectory;
  std::string_view line;
  std::array<double, 8> row;
  TimedPose timed;
  while (input->ReadLine(&line)) {
    if (!ParseRow(*input, line, expected, &row, &timed.timestamp_text)) {
      continue;
    }
    const double x = row[4], y = row[5], z = row[6], w = row[7];
    const double norm2 = x * x + y * y + z * z + w * w;
    if (std::abs(norm2 - 1.0) > 0.02) {
      throw Error(input->name(), input->line_number(),
                  "quaternion is not of unit length", expected);
    }
    timed.timestamp = row[0];
    timed.pose =
        Pose2(row[1], row[2],
              std::atan2(2.0 * (w * z + x * y), w * w + x * x - y * y - z * z));
    trajectory.push_back(timed);
  }
  RequireUndamaged(*input);
  if (trajectory.empty())
    throw Error(input->name(), 0, "holds no pose", expected + " a line");
  return trajectory;
}

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
    if (!ParseRow(*input, line, expected, &row, &text)) continue;
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
