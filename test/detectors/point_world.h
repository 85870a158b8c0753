#ifndef PLUMBLINE_TEST_DETECTORS_POINT_WORLD_H_
#define PLUMBLINE_TEST_DETECTORS_POINT_WORLD_H_

#include <plumbline/core/graph.h>
#include <plumbline/core/registry.h>
#include <plumbline/factors/angle.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <numeric>
#include <random>
#include <utility>
#include <vector>

namespace plumbline {

// Points on walls and columns, with distances between near ones: a world of
// the kind of the main experiment with points (core/method.md, section 8, S1).
class PointWorld {
 public:
  using Position = std::array<double, 2>;

  explicit PointWorld(std::uint64_t seed) : engine_(seed) {}

  // Uniform in (-half_width, half_width).
  double Noise(double half_width) {
    return half_width * (2.0 * (static_cast<double>(engine_() >> 11) + 0.5) /
                             9007199254740992.0 -
                         1.0);
  }

  // A point that belongs to no curve.
  void AddPoint(double x, double y) { Add(x, y, -1); }

  // Points from (x1, y1) to (x2, y2), ends included, about `spacing` apart.
  void AddWall(double x1, double y1, double x2, double y2, double spacing) {
    const int steps = std::max(
        1,
        static_cast<int>(std::lround(std::hypot(x2 - x1, y2 - y1) / spacing)));
    for (int i = 0; i <= steps; ++i) {
      const double t = static_cast<double>(i) / steps;
      Add(x1 + t * (x2 - x1), y1 + t * (y2 - y1), num_curves());
    }
    is_circle_.push_back(false);
  }

  // Points on a circle, or on an arc of `sweep_deg` from `begin_deg`.
  void AddCircle(double x, double y, double radius, double spacing,
                 double begin_deg = 0.0, double sweep_deg = 360.0) {
    const double sweep = DegToRad(sweep_deg);
    const int steps =
        std::max(3, static_cast<int>(std::lround(radius * sweep / spacing)));
    for (int i = 0; i < steps; ++i) {
      const double angle = DegToRad(begin_deg) + sweep * i / steps;
      Add(x + radius * std::cos(angle), y + radius * std::sin(angle),
          num_curves());
    }
    is_circle_.push_back(true);
  }

  // 14 walls in two directions, 4 pairs of concentric circles: with a spacing
  // of 0.34 m 572 points.
  void AddBuilding(double spacing) {
    // Outer walls.
    AddWall(0.0, 0.0, 17.0, 0.0, spacing);
    AddWall(17.0, 0.4, 17.0, 12.0, spacing);
    AddWall(16.6, 12.0, 0.0, 12.0, spacing);
    AddWall(0.0, 11.6, 0.0, 0.4, spacing);
    // Rooms.
    AddWall(5.8, 0.4, 5.8, 4.8, spacing);
    AddWall(11.4, 0.4, 11.4, 4.8, spacing);
    AddWall(0.4, 5.2, 4.8, 5.2, spacing);
    AddWall(6.4, 5.2, 10.6, 5.2, spacing);
    AddWall(12.0, 4.0, 16.6, 4.0, spacing);
    AddWall(0.4, 7.0, 5.8, 7.0, spacing);
    AddWall(7.6, 8.0, 16.6, 8.0, spacing);
    AddWall(6.2, 7.4, 6.2, 11.6, spacing);
    AddWall(11.2, 8.4, 11.2, 11.6, spacing);
    AddWall(17.4, 6.1, 24.0, 6.1, spacing);
    // Columns and the round rooms around them.
    AddCircle(2.9, 2.6, 0.9, spacing);
    AddCircle(2.9, 2.6, 1.9, spacing);
    AddCircle(8.6, 2.6, 1.0, spacing);
    AddCircle(8.6, 2.6, 2.0, spacing);
    AddCircle(21.0, 10.0, 1.4, spacing);
    AddCircle(21.0, 10.0, 2.8, spacing);
    AddCircle(21.0, 2.5, 1.2, spacing);
    AddCircle(21.0, 2.5, 2.4, spacing);
  }

  // Seven corridors of two walls each, 1.5 m apart, around four round halls of
  // two concentric circles each, with a point about every metre: 14 lines in 2
  // directions, 8 circles, 4 centres. With links of up to 1.8 m and five links
  // a point, walls are triangulated and the whole is nearly rigid.
  void AddCorridors() {
    max_link_length_ = 1.8;
    constexpr double kInset = 1.65;
    const auto add_corridor = [this](double x1, double y1, double x2,
                                     double y2) {
      const double length = std::hypot(x2 - x1, y2 - y1);
      const double ux = (x2 - x1) / length, uy = (y2 - y1) / length;
      // One wall starts half a spacing later, so that triangles result.
      AddWall(x1 - 0.75 * uy, y1 + 0.75 * ux, x2 - 0.75 * uy, y2 + 0.75 * ux,
              1.0);
      AddWall(x1 + 0.75 * uy + 0.5 * ux, y1 - 0.75 * ux + 0.5 * uy,
              x2 + 0.75 * uy - 0.5 * ux, y2 - 0.75 * ux - 0.5 * uy, 1.0);
    };
    add_corridor(-0.75, 0.0, 30.75, 0.0);
    add_corridor(-0.75, 28.0, 30.75, 28.0);
    for (const double x : {0.0, 15.0, 30.0}) {
      add_corridor(x, kInset, x, 28.0 - kInset);
    }
    add_corridor(kInset, 15.0, 15.0 - kInset, 15.0);
    add_corridor(15.0 + kInset, 13.0, 30.0 - kInset, 13.0);
    const auto add_hall = [this](double x, double y, double radius) {
      AddCircle(x, y, radius, 1.0);
      AddCircle(x, y, radius - 1.5, 1.0, 5.0);
    };
    add_hall(7.5, 7.5, 5.85);
    add_hall(7.5, 21.5, 4.85);
    add_hall(22.5, 6.5, 4.85);
    add_hall(22.5, 20.5, 5.85);
  }

  // Adds the points, each with noise on x and y, and distances with noise
  // between the nearest pairs, no point with more than `max_links` of them;
  // parts that stay apart are joined by their nearest pair. Returns the ids.
  std::vector<FeatureId> Build(const Registry& registry, double point_noise,
                               double distance_noise, int max_links,
                               Graph* graph) {
    Transaction transaction;
    for (const Position& position : truth_) {
      Feature feature;
      feature.type = &registry.GetFeature("point");
      feature.parameters = {position[0] + Noise(point_noise),
                            position[1] + Noise(point_noise)};
      transaction.AddFeature(std::move(feature));
    }
    for (const auto& [i, j] : Links(max_links)) {
      Constraint constraint;
      constraint.type = &registry.GetRelation("point_point_distance");
      constraint.features = {Transaction::ProvisionalId(i),
                             Transaction::ProvisionalId(j)};
      constraint.expected =
          Eigen::VectorXd::Constant(1, Distance(i, j) + Noise(distance_noise));
      // Standard deviation of the uniform distribution.
      const double sigma = std::max(distance_noise / std::sqrt(3.0), 1e-3);
      constraint.information =
          Eigen::MatrixXd::Constant(1, 1, 1.0 / (sigma * sigma));
      transaction.AddConstraint(std::move(constraint));
    }
    return graph->Apply(std::move(transaction)).features;
  }

  const std::vector<Position>& truth() const { return truth_; }
  // Index of the wall or circle that each point is on, in the order in which
  // they were added; -1 for none.
  const std::vector<int>& curve_of() const { return curve_of_; }
  int num_curves() const { return static_cast<int>(is_circle_.size()); }
  bool is_circle(int curve) const {
    return is_circle_[static_cast<std::size_t>(curve)];
  }

 private:
  void Add(double x, double y, int curve) {
    truth_.push_back({x, y});
    curve_of_.push_back(curve);
  }

  double Distance(std::size_t i, std::size_t j) const {
    return std::hypot(truth_[i][0] - truth_[j][0], truth_[i][1] - truth_[j][1]);
  }

  std::vector<std::pair<std::size_t, std::size_t>> Links(int max_links) const {
    struct Pair {
      double distance;
      std::size_t i, j;
    };
    std::vector<Pair> pairs;
    for (std::size_t i = 0; i < truth_.size(); ++i) {
      for (std::size_t j = i + 1; j < truth_.size(); ++j) {
        pairs.push_back({Distance(i, j), i, j});
      }
    }
    std::stable_sort(
        pairs.begin(), pairs.end(),
        [](const Pair& a, const Pair& b) { return a.distance < b.distance; });
    std::vector<std::pair<std::size_t, std::size_t>> links;
    std::vector<int> degree(truth_.size(), 0);
    std::vector<std::size_t> part(truth_.size());
    std::iota(part.begin(), part.end(), std::size_t{0});
    const auto find = [&part](std::size_t i) {
      while (part[i] != i) i = part[i] = part[part[i]];
      return i;
    };
    for (const Pair& pair : pairs) {
      if (degree[pair.i] >= max_links || degree[pair.j] >= max_links ||
          pair.distance > max_link_length_) {
        continue;
      }
      ++degree[pair.i];
      ++degree[pair.j];
      part[find(pair.i)] = find(pair.j);
      links.emplace_back(pair.i, pair.j);
    }
    for (const Pair& pair : pairs) {
      if (find(pair.i) == find(pair.j)) continue;
      part[find(pair.i)] = find(pair.j);
      links.emplace_back(pair.i, pair.j);
    }
    return links;
  }

  std::mt19937_64 engine_;
  double max_link_length_ = 1.5;
  std::vector<Position> truth_;
  std::vector<int> curve_of_;
  std::vector<bool> is_circle_;
};

}  // namespace plumbline

#endif  // PLUMBLINE_TEST_DETECTORS_POINT_WORLD_H_
