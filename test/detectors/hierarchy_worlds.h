#ifndef PLUMBLINE_TEST_DETECTORS_HIERARCHY_WORLDS_H_
#define PLUMBLINE_TEST_DETECTORS_HIERARCHY_WORLDS_H_

#include <plumbline/core/graph.h>
#include <plumbline/core/registry.h>
#include <plumbline/factors/angle.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <ostream>
#include <random>
#include <string>
#include <tuple>
#include <utility>
#include <vector>

namespace plumbline {

// A virtual feature that is to be found.
struct TrueFeature {
  std::string type;
  int level;
  // point: x, y; circle: x, y, R; line: both ends, x1, y1, x2, y2; m.
  // orientation: degrees. rectangle: x, y, degrees, half its sides, m.
  std::vector<double> at;
};

// Small worlds of which the structure is known (core/method.md, Table 1). Three
// robot poses that are known measure everything, so the map has its place and
// is rigid; structure is what the detectors have to find.
class HierarchyWorld {
 public:
  HierarchyWorld(const Registry& registry, std::uint64_t seed)
      : registry_(registry), engine_(seed) {
    for (const auto& [x, y] : {std::pair(-40.0, -30.0), std::pair(60.0, -35.0),
                               std::pair(10.0, 70.0)}) {
      Feature pose = Raw("pose", {x, y, 0.0});
      pose.fixed = true;
      stations_.push_back(transaction_.AddFeature(std::move(pose)));
      station_positions_.emplace_back(x, y);
    }
  }

  // -- Raw features -----------------------------------------------------------

  // Points from (x1, y1) to (x2, y2), ends included.
  void AddPointWall(double x1, double y1, double x2, double y2,
                    double spacing = 0.5) {
    const int steps = std::max(
        1,
        static_cast<int>(std::lround(std::hypot(x2 - x1, y2 - y1) / spacing)));
    std::vector<std::size_t> chain;
    for (int i = 0; i <= steps; ++i) {
      const double t = static_cast<double>(i) / steps;
      chain.push_back(AddPoint(x1 + t * (x2 - x1), y1 + t * (y2 - y1)));
    }
    LinkChain(chain);
  }

  // Points around a circle.
  void AddPointCircle(double x, double y, double radius, int count) {
    std::vector<std::size_t> chain;
    for (int i = 0; i < count; ++i) {
      const double angle = 2.0 * kPi * i / count;
      chain.push_back(
          AddPoint(x + radius * std::cos(angle), y + radius * std::sin(angle)));
    }
    LinkChain(chain);
    Link(chain.back(), chain.front());
  }

  void AddCircle(double x, double y, double radius) {
    const FeatureId id = transaction_.AddFeature(
        Raw("circle", {x + Noise(0.1), y + Noise(0.1), radius + Noise(0.05)}));
    for (std::size_t s = 0; s < stations_.size(); ++s) {
      const double distance = std::hypot(x - station_positions_[s].first,
                                         y - station_positions_[s].second);
      Measure("point_point_distance", {stations_[s], id},
              {distance + Noise(kRangeNoise)}, {kRangeNoise});
      Measure("point_circle_distance", {stations_[s], id},
              {distance - radius + Noise(kRangeNoise)}, {kRangeNoise});
    }
  }

  void AddSegment(double x1, double y1, double x2, double y2) {
    const double length = std::hypot(x2 - x1, y2 - y1);
    const double angle = std::atan2(y2 - y1, x2 - x1);
    const double x = 0.5 * (x1 + x2), y = 0.5 * (y1 + y2);
    // Many points make a direction.
    const double turn = 0.3 * kRangeNoise / length;
    Feature segment = Raw(
        "segment", {x + Noise(0.1), y + Noise(0.1), angle + Noise(3.0 * turn)});
    segment.extent_begin = -0.5 * length;
    segment.extent_end = 0.5 * length;
    const FeatureId id = transaction_.AddFeature(std::move(segment));
    for (std::size_t s = 0; s < stations_.size(); ++s) {
      Measure("pose_pose", {stations_[s], id},
              {x - station_positions_[s].first + Noise(kRangeNoise),
               y - station_positions_[s].second + Noise(kRangeNoise),
               angle + Noise(turn)},
              {kRangeNoise, kRangeNoise, turn});
    }
  }

  // -- What is to be found ----------------------------------------------------

  void Expect(const std::string& type, int level, std::vector<double> at) {
    truth_.push_back({type, level, std::move(at)});
  }

  // Live orientation_orientation constraints, whatever their angle.
  void ExpectRelations(int count) { num_relations_ = count; }

  const std::vector<TrueFeature>& truth() const { return truth_; }
  int num_relations() const { return num_relations_; }

  void Build(Graph* graph) { graph->Apply(std::move(transaction_)); }

 private:
  // Half width of the uniform noise of measurements, m.
  static constexpr double kRangeNoise = 0.03;

  double Noise(double half_width) {
    return half_width * (2.0 * (static_cast<double>(engine_() >> 11) + 0.5) /
                             9007199254740992.0 -
                         1.0);
  }

  Feature Raw(const std::string& type, const std::vector<double>& parameters) {
    Feature feature;
    feature.type = &registry_.GetFeature(type);
    std::copy(parameters.begin(), parameters.end(), feature.parameters.begin());
    feature.source = "test";
    return feature;
  }

  void Measure(const std::string& relation, std::vector<FeatureId> features,
               const std::vector<double>& expected,
               const std::vector<double>& half_widths) {
    Constraint constraint;
    constraint.type = &registry_.GetRelation(relation);
    constraint.features = std::move(features);
    const auto size = static_cast<Eigen::Index>(expected.size());
    constraint.expected =
        Eigen::Map<const Eigen::VectorXd>(expected.data(), size);
    constraint.information = Eigen::MatrixXd::Zero(size, size);
    for (Eigen::Index i = 0; i < size; ++i) {
      // Of the uniform distribution.
      const double half_width = half_widths[static_cast<std::size_t>(i)];
      constraint.information(i, i) = 3.0 / (half_width * half_width);
    }
    constraint.source = "test";
    transaction_.AddConstraint(std::move(constraint));
  }

  std::size_t AddPoint(double x, double y) {
    points_.push_back(transaction_.AddFeature(
        Raw("point", {x + Noise(0.1), y + Noise(0.1)})));
    positions_.emplace_back(x, y);
    for (std::size_t s = 0; s < stations_.size(); ++s) {
      const double distance = std::hypot(x - station_positions_[s].first,
                                         y - station_positions_[s].second);
      Measure("point_point_distance", {stations_[s], points_.back()},
              {distance + Noise(kRangeNoise)}, {kRangeNoise});
    }
    return points_.size() - 1;
  }

  void Link(std::size_t i, std::size_t j) {
    const double distance =
        std::hypot(positions_[i].first - positions_[j].first,
                   positions_[i].second - positions_[j].second);
    Measure("point_point_distance", {points_[i], points_[j]},
            {distance + Noise(kRangeNoise)}, {kRangeNoise});
  }

  void LinkChain(const std::vector<std::size_t>& chain) {
    for (std::size_t i = 1; i < chain.size(); ++i) Link(chain[i - 1], chain[i]);
  }

  const Registry& registry_;
  std::mt19937_64 engine_;
  Transaction transaction_;
  std::vector<FeatureId> stations_;
  std::vector<std::pair<double, double>> station_positions_;
  std::vector<FeatureId> points_;
  std::vector<std::pair<double, double>> positions_;
  std::vector<TrueFeature> truth_;
  int num_relations_ = 0;
};

// How far a virtual feature is from a true one of its type, in tolerances: 1 is
// just right. 0.3 m, 2 degrees.
inline double Mismatch(const Feature& feature, const TrueFeature& truth) {
  constexpr double kLength = 0.3;
  const double kAngle = DegToRad(2.0);
  const auto& p = feature.parameters;
  const auto& at = truth.at;
  if (truth.type == "point")
    return std::hypot(p[0] - at[0], p[1] - at[1]) / kLength;
  if (truth.type == "circle") {
    return std::max(std::hypot(p[0] - at[0], p[1] - at[1]),
                    std::abs(p[2] - at[2])) /
           kLength;
  }
  if (truth.type == "orientation") {
    return std::abs(NormalizeAxial(p[0] - DegToRad(at[0]))) / kAngle;
  }
  if (truth.type == "rectangle") {
    // Turned by 90 degrees with its sides exchanged it is the same.
    double smallest = 1e9;
    for (const int turned : {0, 1}) {
      const double size = std::max(std::abs(p[3 + turned] - at[3]),
                                   std::abs(p[4 - turned] - at[4]));
      const double angle =
          NormalizeAxial(p[2] + 0.5 * kPi * turned - DegToRad(at[2]));
      smallest = std::min(
          smallest,
          std::max(
              std::max(std::hypot(p[0] - at[0], p[1] - at[1]), size) / kLength,
              std::abs(angle) / kAngle));
    }
    return smallest;
  }
  // A line: both ends of the true one lie on it, it does not reach beyond them
  // by more than 1 m, and at least three quarters of it are seen (a corner may
  // belong to the other wall).
  double off = 0.0;
  std::vector<double> along;
  for (std::size_t i = 0; i < 4; i += 2) {
    const double x = at[i] - feature.anchor[0];
    const double y = at[i + 1] - feature.anchor[1];
    off =
        std::max(off, std::abs(y * std::cos(p[1]) - x * std::sin(p[1]) - p[0]));
    along.push_back(x * std::cos(p[1]) + y * std::sin(p[1]));
  }
  const auto [begin, end] = std::minmax(along[0], along[1]);
  const double beyond =
      std::max(begin - feature.extent_begin, feature.extent_end - end);
  const double seen =
      std::min(end, feature.extent_end) - std::max(begin, feature.extent_begin);
  if (beyond > 1.0 || seen < 0.75 * (end - begin)) return 2.0;
  return off / kLength;
}

// Everything that was missed, and everything that is there and should not be,
// as text: empty when precision and recall are 1. Each true feature is matched
// by one.
inline std::vector<std::string> CompareWithTruth(
    const Graph& graph, const std::vector<TrueFeature>& truth) {
  const auto describe = [](const std::string& type, int level,
                           const auto& numbers, std::size_t count) {
    std::string text = type + " at level " + std::to_string(level) + ":";
    for (std::size_t i = 0; i < count; ++i) {
      text += " " + std::to_string(numbers[i]);
    }
    return text;
  };
  std::vector<std::string> differences;
  std::vector<bool> is_found(truth.size(), false);
  for (const Feature* feature : graph.Features()) {
    if (!feature->is_virtual) continue;
    std::size_t best = truth.size();
    double smallest = 1.0;
    for (std::size_t i = 0; i < truth.size(); ++i) {
      if (is_found[i] || truth[i].type != feature->type->name ||
          truth[i].level != feature->level) {
        continue;
      }
      const double mismatch = Mismatch(*feature, truth[i]);
      if (mismatch < smallest) {
        smallest = mismatch;
        best = i;
      }
    }
    if (best < truth.size()) {
      is_found[best] = true;
    } else {
      differences.push_back(
          "false " +
          describe(feature->type->name, feature->level, feature->parameters,
                   static_cast<std::size_t>(feature->type->size)) +
          " anchor " + std::to_string(feature->anchor[0]) + " " +
          std::to_string(feature->anchor[1]) + " extent " +
          std::to_string(feature->extent_begin) + " " +
          std::to_string(feature->extent_end));
    }
  }
  for (std::size_t i = 0; i < truth.size(); ++i) {
    if (is_found[i]) continue;
    differences.push_back("missed " + describe(truth[i].type, truth[i].level,
                                               truth[i].at,
                                               truth[i].at.size()));
  }
  return differences;
}

// A row of Table 1 or a combination.
struct HierarchyCase {
  std::string name;
  // As in --hierarchy.
  std::string hierarchy;
  // Types of the raw features that carry the structure.
  std::vector<std::string> raw;
  std::function<void(HierarchyWorld*)> make;
};

inline void PrintTo(const HierarchyCase& the_case, std::ostream* output) {
  *output << the_case.hierarchy;
}

// Four corridors of two walls each around a court: 8 walls in 2 directions.
inline void AddPointCourt(
    HierarchyWorld* world, int line_level,
    const std::function<void(double, double, double, double)>& add) {
  const auto wall = [&](double x1, double y1, double x2, double y2) {
    add(x1, y1, x2, y2);
    if (line_level > 0) world->Expect("line", line_level, {x1, y1, x2, y2});
  };
  wall(0.0, 0.0, 16.0, 0.0);
  wall(2.5, 2.0, 13.5, 2.0);
  wall(0.0, 12.0, 16.0, 12.0);
  wall(2.5, 10.0, 13.5, 10.0);
  wall(-0.5, 0.5, -0.5, 11.5);
  wall(2.0, 2.5, 2.0, 9.5);
  wall(16.5, 0.5, 16.5, 11.5);
  wall(14.0, 2.5, 14.0, 9.5);
}

// Two colonnades, one in the other: 8 rows of columns in 2 directions; the
// corner columns stand in two rows.
inline void AddColonnades(
    HierarchyWorld* world, int center_level,
    const std::function<void(double, double, double)>& add) {
  constexpr double kRadius = 0.5;
  const auto column = [&](double x, double y) {
    add(x, y, kRadius);
    world->Expect("point", center_level, {x, y});
  };
  for (const auto& [x1, y1, x2, y2, dx, dy] :
       {std::tuple(0.0, 0.0, 28.0, 20.0, 4.0, 4.0),
        std::tuple(-7.0, -7.0, 35.0, 27.0, 5.25, 5.0)}) {
    for (double x = x1; x < x2 + 0.1; x += dx) {
      column(x, y1);
      column(x, y2);
    }
    for (double y = y1 + dy; y < y2 - 0.1; y += dy) {
      column(x1, y);
      column(x2, y);
    }
    world->Expect("line", center_level + 1, {x1, y1, x2, y1});
    world->Expect("line", center_level + 1, {x1, y2, x2, y2});
    world->Expect("line", center_level + 1, {x1, y1, x1, y2});
    world->Expect("line", center_level + 1, {x2, y1, x2, y2});
  }
}

// A row of columns in each direction, beside the court.
inline void AddRowsOfColumns(
    HierarchyWorld* world, int center_level,
    const std::function<void(double, double, double)>& add) {
  for (int i = 0; i < 7; ++i) {
    for (const auto& [x, y] :
         {std::pair(-1.0 + 3.0 * i, 18.0), std::pair(23.0, -2.0 + 3.0 * i)}) {
      add(x, y, 0.6);
      world->Expect("point", center_level, {x, y});
    }
  }
  world->Expect("line", center_level + 1, {-1.0, 18.0, 17.0, 18.0});
  world->Expect("line", center_level + 1, {23.0, -2.0, 23.0, 16.0});
}

// Five rooms along a corridor, one of them with a door in a side wall; the
// corridor, open at its ends, and a niche are no rectangles, nor is what
// several rooms make together.
inline void AddRooms(
    HierarchyWorld* world, int rectangle_level,
    const std::function<void(double, double, double, double)>& add) {
  const auto room = [&](double x1, double y1, double x2, double y2) {
    constexpr double kGap = 0.3;  // to the corners
    add(x1 + kGap, y1, x2 - kGap, y1);
    add(x2, y1 + kGap, x2, y2 - kGap);
    add(x1 + kGap, y2, x2 - kGap, y2);
    if (x1 == 0.0) {
      // With a door.
      add(x1, y1 + kGap, x1, 0.5 * (y1 + y2) - 0.5);
      add(x1, 0.5 * (y1 + y2) + 0.5, x1, y2 - kGap);
    } else {
      add(x1, y1 + kGap, x1, y2 - kGap);
    }
    world->Expect("rectangle", rectangle_level,
                  {0.5 * (x1 + x2), 0.5 * (y1 + y2), 0.0, 0.5 * (x2 - x1),
                   0.5 * (y2 - y1)});
  };
  room(0.0, 0.0, 7.0, 6.0);
  room(8.0, 0.0, 13.0, 6.0);
  room(14.0, 0.0, 22.0, 6.0);
  room(1.0, 10.0, 10.0, 15.0);
  room(11.0, 10.0, 21.0, 15.0);
  // The corridor, and a niche beyond its end.
  add(-3.0, 7.0, 24.0, 7.0);
  add(-3.0, 9.0, 24.0, 9.0);
  add(28.0, 5.0, 34.0, 5.0);
  add(28.0, 11.0, 34.0, 11.0);
  add(34.3, 5.3, 34.3, 10.7);
}

// Table 1 of the paper, by row, and combinations of its rows.
inline std::vector<HierarchyCase> HierarchyCases() {
  std::vector<HierarchyCase> cases;
  cases.push_back({"Row1PointsLinesOrientations",
                   "line_ransac/orientation_mixture/orientation_relation",
                   {"point"},
                   [](HierarchyWorld* world) {
                     AddPointCourt(
                         world, 1,
                         [&](double x1, double y1, double x2, double y2) {
                           world->AddPointWall(x1, y1, x2, y2);
                         });
                     world->Expect("orientation", 2, {0.0});
                     world->Expect("orientation", 2, {90.0});
                     world->ExpectRelations(1);
                   }});
  cases.push_back(
      {"Row2PointsCirclesCentresLinesOrientations",
       "circle_ransac/circle_center/line_ransac/orientation_mixture/"
       "orientation_relation",
       {"point"},
       [](HierarchyWorld* world) {
         AddColonnades(world, 2, [&](double x, double y, double radius) {
           world->AddPointCircle(x, y, radius, 10);
           world->Expect("circle", 1, {x, y, radius});
         });
         world->Expect("orientation", 4, {0.0});
         world->Expect("orientation", 4, {90.0});
         world->ExpectRelations(1);
       }});
  cases.push_back({"Row3SegmentsOrientations",
                   "orientation_mixture/orientation_relation",
                   {"segment"},
                   [](HierarchyWorld* world) {
                     AddPointCourt(
                         world, 0,
                         [&](double x1, double y1, double x2, double y2) {
                           world->AddSegment(x1, y1, x2, y2);
                         });
                     // A wing.
                     for (int i = 0; i < 4; ++i) {
                       world->AddSegment(20.0, 2.0 * i, 26.0, 2.0 * i + 6.0);
                     }
                     world->Expect("orientation", 1, {0.0});
                     world->Expect("orientation", 1, {90.0});
                     world->Expect("orientation", 1, {45.0});
                     world->ExpectRelations(3);
                   }});
  cases.push_back({"Row4SegmentsRectanglesOrientations",
                   "rectangle/orientation_mixture/orientation_relation",
                   {"segment"},
                   [](HierarchyWorld* world) {
                     AddRooms(world, 1,
                              [&](double x1, double y1, double x2, double y2) {
                                world->AddSegment(x1, y1, x2, y2);
                              });
                     world->Expect("orientation", 2, {0.0});
                     world->Expect("orientation", 2, {90.0});
                     world->ExpectRelations(1);
                   }});
  cases.push_back(
      {"PointsLinesRectanglesOrientations",
       "line_ransac/rectangle/orientation_mixture/orientation_relation",
       {"point"},
       [](HierarchyWorld* world) {
         AddRooms(world, 2, [&](double x1, double y1, double x2, double y2) {
           world->AddPointWall(x1, y1, x2, y2, 0.25);
           world->Expect("line", 1, {x1, y1, x2, y2});
         });
         world->Expect("orientation", 3, {0.0});
         world->Expect("orientation", 3, {90.0});
         world->ExpectRelations(1);
       }});
  cases.push_back({"Row5CirclesCentresLinesOrientations",
                   "circle_center/line_ransac/orientation_mixture/"
                   "orientation_relation",
                   {"circle"},
                   [](HierarchyWorld* world) {
                     AddColonnades(world, 1,
                                   [&](double x, double y, double radius) {
                                     world->AddCircle(x, y, radius);
                                   });
                     world->Expect("orientation", 3, {0.0});
                     world->Expect("orientation", 3, {90.0});
                     world->ExpectRelations(1);
                   }});
  cases.push_back(
      {"PointsOnLinesAndCircles",
       "line_ransac,circle_ransac/center_cluster,orientation_mixture/"
       "orientation_relation",
       {"point"},
       [](HierarchyWorld* world) {
         AddPointCourt(world, 1,
                       [&](double x1, double y1, double x2, double y2) {
                         world->AddPointWall(x1, y1, x2, y2);
                       });
         // Fountains in round basins; a column alone.
         for (const double x : {5.0, 11.0}) {
           for (const double radius : {0.8, 1.6}) {
             world->AddPointCircle(x, 6.0, radius, 16);
             world->Expect("circle", 1, {x, 6.0, radius});
           }
           world->Expect("point", 2, {x, 6.0});
         }
         world->AddPointCircle(8.0, 6.0, 0.6, 12);
         world->Expect("circle", 1, {8.0, 6.0, 0.6});
         world->Expect("orientation", 2, {0.0});
         world->Expect("orientation", 2, {90.0});
         world->ExpectRelations(1);
       }});
  // Two rows would not make an orientation: they share those of the walls.
  cases.push_back(
      {"WallsAndRowsOfColumnsShareOrientations",
       "line_ransac,circle_ransac/circle_center/line_ransac/"
       "orientation_mixture/orientation_relation",
       {"point"},
       [](HierarchyWorld* world) {
         AddPointCourt(world, 1,
                       [&](double x1, double y1, double x2, double y2) {
                         world->AddPointWall(x1, y1, x2, y2);
                       });
         AddRowsOfColumns(world, 2, [&](double x, double y, double radius) {
           world->AddPointCircle(x, y, radius, 12);
           world->Expect("circle", 1, {x, y, radius});
         });
         world->Expect("orientation", 4, {0.0});
         world->Expect("orientation", 4, {90.0});
         world->ExpectRelations(1);
       }});
  cases.push_back(
      {"SegmentsAndRowsOfCirclesShareOrientations",
       "circle_center/line_ransac/orientation_mixture/orientation_relation",
       {"circle", "segment"},
       [](HierarchyWorld* world) {
         AddPointCourt(world, 0,
                       [&](double x1, double y1, double x2, double y2) {
                         world->AddSegment(x1, y1, x2, y2);
                       });
         AddRowsOfColumns(world, 1, [&](double x, double y, double radius) {
           world->AddCircle(x, y, radius);
         });
         world->Expect("orientation", 3, {0.0});
         world->Expect("orientation", 3, {90.0});
         world->ExpectRelations(1);
       }});
  return cases;
}

}  // namespace plumbline

#endif  // PLUMBLINE_TEST_DETECTORS_HIERARCHY_WORLDS_H_
