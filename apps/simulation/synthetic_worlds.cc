#include <plumbline/apps/simulation/synthetic_worlds.h>
#include <plumbline/apps/simulation/world.h>
#include <plumbline/core/error.h>
#include <plumbline/core/transaction.h>
#include <plumbline/factors/angle.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <map>
#include <tuple>
#include <utility>

namespace plumbline {
namespace {

// Between the two walls of a corridor and the two circles of an ambulatory, m:
// wide enough for stiff triangles, narrow enough for the nearest points to be
// neighbours along the wall and across the corridor.
constexpr double kCorridorWidth = 1.5;
// Between the parts of the building where they meet, m.
constexpr double kGap = 0.85;
// Distances between the parts of the building, m: longest and how many.
constexpr double kLongestTie = 2.6;
constexpr int kTies = 70;
// S4: how near to a line (as if it went on for ever), circle or other point a
// random point may be, m, and the links that it gets.
constexpr double kOutlierClearance = 0.5;
constexpr int kOutlierLinks = 3;
// S5, m: between the centre lines of walls; of trees from their row's line,
// varied so that those on one side are on no line either.
constexpr int kWalls = 3;
constexpr int kTrees = 30;
constexpr double kStreetWidth = 9.5;
constexpr double kTreeDeviation = 0.1;
constexpr double kTreeVariation = 0.05;
// S6.
constexpr int kConcentricCircles = 6;
constexpr double kOutlierNearest = 0.2;
constexpr double kOutlierFarthest = 0.5;

constexpr double kSmallestSigma = 1e-3;

// Every kind of noise draws from a stream of its own, so that S1 and S4 with
// the same seed differ in the outliers only.
constexpr std::uint64_t kPositionStream = 1;
constexpr std::uint64_t kDistanceStream = 2;
constexpr std::uint64_t kOutlierStream = 3;

SimulationRandom Stream(std::uint64_t seed, std::uint64_t stream) {
  return SimulationRandom(seed + (stream << 56));
}

Eigen::Vector2d Noise(double width, SimulationRandom* random) {
  // One draw a statement: the order of arguments is not specified.
  const double x = random->Uniform(-width, width);
  const double y = random->Uniform(-width, width);
  return {x, y};
}

// Positions, distances between them and structure, without noise.
class Layout {
 public:
  int AddPoint(const Eigen::Vector2d& position) {
    truth_.positions.push_back(position);
    part_.push_back(parts_);
    return static_cast<int>(truth_.positions.size()) - 1;
  }

  void AddDistance(int i, int j) {
    distances_.emplace_back(std::min(i, j), std::max(i, j));
  }

  // Two straight rows of points on either side of the line from `begin` to
  // `end`, half a step shifted against each other and triangulated. Returns
  // the rows.
  std::array<std::vector<int>, 2> AddCorridor(const Eigen::Vector2d& begin,
                                              const Eigen::Vector2d& end,
                                              int orientation) {
    const double length = (end - begin).norm();
    const Eigen::Vector2d along = (end - begin) / length;
    const Eigen::Vector2d across =
        Eigen::Vector2d(-along.y(), along.x()) * (kCorridorWidth / 2);
    const int steps = static_cast<int>(std::lround(length));
    std::array<std::vector<int>, 2> rows;
    for (const int row : {0, 1}) {
      for (int i = 0; i <= steps - row; ++i) {
        const double s = length * (i + 0.5 * row) / steps;
        rows[row].push_back(
            AddPoint(begin + s * along + (row == 0 ? -1.0 : 1.0) * across));
      }
      AddLine(rows[row], orientation);
      for (std::size_t i = 1; i < rows[row].size(); ++i) {
        AddDistance(rows[row][i - 1], rows[row][i]);
      }
    }
    for (int i = 0; i < steps; ++i) {
      AddDistance(rows[0][i], rows[1][i]);
      AddDistance(rows[0][i + 1], rows[1][i]);
    }
    ++parts_;
    return rows;
  }

  // Two concentric circles of points, triangulated.
  void AddAmbulatory(const Eigen::Vector2d& center, double outer_radius,
                     int outer_points, int inner_points) {
    truth_.centers.push_back(center);
    const std::array<double, 2> radii = {outer_radius,
                                         outer_radius - kCorridorWidth};
    const std::array<int, 2> counts = {outer_points, inner_points};
    std::array<std::vector<int>, 2> rings;
    const auto angle = [&counts](int ring, int i) {
      return 2 * kPi * (i + 0.5 * ring) / counts[ring];
    };
    for (const int ring : {0, 1}) {
      SyntheticCircle circle;
      circle.center = center;
      circle.radius = radii[ring];
      circle.common_center = static_cast<int>(truth_.centers.size()) - 1;
      for (int i = 0; i < counts[ring]; ++i) {
        const double a = angle(ring, i);
        rings[ring].push_back(AddPoint(
            center + radii[ring] * Eigen::Vector2d(std::cos(a), std::sin(a))));
        circle.points.push_back(rings[ring].back());
      }
      truth_.circles.push_back(std::move(circle));
      for (int i = 0; i < counts[ring]; ++i) {
        AddDistance(rings[ring][i], rings[ring][(i + 1) % counts[ring]]);
      }
    }
    // Once around, always forward on the ring that is behind.
    int outer = 0;
    int inner = 0;
    while (outer < outer_points || inner < inner_points) {
      AddDistance(rings[0][outer % outer_points],
                  rings[1][inner % inner_points]);
      if (inner == inner_points ||
          (outer < outer_points &&
           angle(0, outer + 1) <= angle(1, inner + 1))) {
        ++outer;
      } else {
        ++inner;
      }
    }
    ++parts_;
  }

  void AddLine(const std::vector<int>& points, int orientation) {
    SyntheticLine line;
    line.begin = truth_.positions[points.front()];
    line.end = truth_.positions[points.back()];
    line.orientation = orientation;
    line.points.assign(points.begin(), points.end());
    truth_.lines.push_back(std::move(line));
  }

  // Adds `count` distances between different parts: of every two parts that
  // come near each other the shortest one, shortest first, then of each the
  // second shortest, and so on.
  void TieParts(int count) {
    using Tie = std::tuple<double, int, int>;
    std::map<std::pair<int, int>, std::vector<Tie>> ties;
    const int n = static_cast<int>(truth_.positions.size());
    for (int i = 0; i < n; ++i) {
      for (int j = i + 1; j < n; ++j) {
        if (part_[i] == part_[j]) continue;
        const double length =
            (truth_.positions[i] - truth_.positions[j]).norm();
        if (length < kLongestTie) {
          ties[{part_[i], part_[j]}].emplace_back(length, i, j);
        }
      }
    }
    for (auto& [parts, list] : ties) std::sort(list.begin(), list.end());
    for (std::size_t round = 0; count > 0; ++round) {
      std::vector<Tie> next;
      for (const auto& [parts, list] : ties) {
        if (round < list.size()) next.push_back(list[round]);
      }
      if (next.empty()) return;
      std::sort(next.begin(), next.end());
      for (const auto& [length, i, j] : next) {
        if (count-- == 0) return;
        AddDistance(i, j);
      }
    }
  }

  SyntheticTruth& truth() { return truth_; }
  const std::vector<std::pair<int, int>>& distances() const {
    return distances_;
  }

 private:
  SyntheticTruth truth_;
  std::vector<std::pair<int, int>> distances_;
  std::vector<int> part_;
  int parts_ = 0;
};

// S1: two columns of two rooms, corridors around and between them, and in each
// room an ambulatory that nearly touches the corridors.
void AddBuilding(Layout* layout) {
  constexpr double kWidth = 30.0;
  constexpr double kMiddle = 15.0;
  constexpr double kHeight = 28.0;
  constexpr double kHalf = kCorridorWidth / 2;
  constexpr double kInset = kHalf + kGap;
  // Heights of the corridors between the rooms on the left and on the right.
  constexpr double kLeft = 15.0;
  constexpr double kRight = 13.0;

  layout->truth().orientations = {0.0, kPi / 2};
  layout->AddCorridor({-kHalf, 0.0}, {kWidth + kHalf, 0.0}, 0);
  layout->AddCorridor({-kHalf, kHeight}, {kWidth + kHalf, kHeight}, 0);
  for (const double x : {0.0, kMiddle, kWidth}) {
    layout->AddCorridor({x, kInset}, {x, kHeight - kInset}, 1);
  }
  layout->AddCorridor({kInset, kLeft}, {kMiddle - kInset, kLeft}, 0);
  layout->AddCorridor({kMiddle + kInset, kRight}, {kWidth - kInset, kRight}, 0);

  struct Room {
    double x1, x2, y1, y2;
    int outer_points, inner_points;
  };
  for (const Room& room : {Room{0.0, kMiddle, 0.0, kLeft, 37, 28},
                           Room{0.0, kMiddle, kLeft, kHeight, 33, 22},
                           Room{kMiddle, kWidth, 0.0, kRight, 32, 22},
                           Room{kMiddle, kWidth, kRight, kHeight, 37, 28}}) {
    const double radius =
        std::min(room.x2 - room.x1, room.y2 - room.y1) / 2 - kInset;
    layout->AddAmbulatory({(room.x1 + room.x2) / 2, (room.y1 + room.y2) / 2},
                          radius, room.outer_points, room.inner_points);
  }
  layout->TieParts(kTies);
}

double DistanceToLine(const Eigen::Vector2d& p, const SyntheticLine& line) {
  const Eigen::Vector2d along = (line.end - line.begin).normalized();
  const Eigen::Vector2d q = p - line.begin;
  return std::abs(along.x() * q.y() - along.y() * q.x());
}

// True when a random point there is clearly no part of the structure.
bool IsApart(const Eigen::Vector2d& p, const SyntheticTruth& truth) {
  for (const SyntheticLine& line : truth.lines) {
    if (DistanceToLine(p, line) < kOutlierClearance) return false;
  }
  for (const SyntheticCircle& circle : truth.circles) {
    if (std::abs((p - circle.center).norm() - circle.radius) <
        kOutlierClearance) {
      return false;
    }
  }
  return std::all_of(truth.positions.begin(), truth.positions.end(),
                     [&p](const Eigen::Vector2d& q) {
                       return (p - q).norm() >= kOutlierClearance;
                     });
}

// Random points within the bounds of the layout.
void AddOutliers(int count, std::uint64_t seed, Layout* layout) {
  SimulationRandom random = Stream(seed, kOutlierStream);
  SyntheticTruth& truth = layout->truth();
  Eigen::Array2d low = truth.positions.front();
  Eigen::Array2d high = low;
  for (const Eigen::Vector2d& p : truth.positions) {
    low = low.min(p.array());
    high = high.max(p.array());
  }
  for (int k = 0; k < count; ++k) {
    Eigen::Vector2d p;
    int tries = 0;
    do {
      if (++tries > 100000) {
        throw PLUMBLINE_ERROR("no space for " + std::to_string(count) +
                                  " outliers between the structures",
                              "fewer");
      }
      p.x() = random.Uniform(low.x(), high.x());
      p.y() = random.Uniform(low.y(), high.y());
    } while (!IsApart(p, truth));
    std::vector<std::pair<double, int>> nearest;
    for (std::size_t i = 0; i < truth.positions.size(); ++i) {
      nearest.emplace_back((truth.positions[i] - p).norm(),
                           static_cast<int>(i));
    }
    std::partial_sort(nearest.begin(), nearest.begin() + kOutlierLinks,
                      nearest.end());
    const int id = layout->AddPoint(p);
    truth.outliers.push_back(id);
    for (int i = 0; i < kOutlierLinks; ++i) {
      layout->AddDistance(nearest[i].second, id);
    }
  }
}

// S5: double walls along x with a row of trees between one and the next.
void AddStreets(std::uint64_t seed, Layout* layout) {
  SimulationRandom random = Stream(seed, kOutlierStream);
  SyntheticTruth& truth = layout->truth();
  truth.orientations = {0.0};
  const auto add_wall = [layout](double y) {
    return layout->AddCorridor({0.0, y}, {kTrees, y}, 0);
  };
  std::vector<int> wall = add_wall(0.0)[1];
  for (int k = 1; k < kWalls; ++k) {
    const double y = k * kStreetWidth;
    const std::array<std::vector<int>, 2> next = add_wall(y);
    std::vector<int> trees;
    for (int i = 0; i < kTrees; ++i) {
      const double deviation = random.Uniform(kTreeDeviation - kTreeVariation,
                                              kTreeDeviation + kTreeVariation);
      trees.push_back(layout->AddPoint(
          {i + 0.5,
           y - kStreetWidth / 2 + (i % 2 == 0 ? -deviation : deviation)}));
      truth.outliers.push_back(trees.back());
    }
    for (const int step : {1, 2}) {
      for (int i = step; i < kTrees; ++i) {
        layout->AddDistance(trees[i - step], trees[i]);
      }
    }
    // Tree i stands beside point i of the first wall and between the points i
    // and i + 1 of the next. The second of its distances to a wall leans
    // forwards and backwards in turn.
    for (int i = 0; i < kTrees; ++i) {
      const int ahead = i % 2 == 0 ? i + 1 : i - 1;
      layout->AddDistance(trees[i], wall[i]);
      layout->AddDistance(trees[i], wall[ahead]);
      layout->AddDistance(trees[i], next[0][i]);
      layout->AddDistance(trees[i], next[0][ahead]);
    }
    wall = next[1];
  }
}

double Sigma(double noise) {
  return std::max(noise / std::sqrt(3.0), kSmallestSigma);
}

SyntheticWorld WorldFromLayout(Layout layout, const SyntheticOptions& options,
                               std::uint64_t seed, const Registry& registry) {
  SyntheticWorld world;
  world.truth = std::move(layout.truth());
  SimulationRandom position_noise = Stream(seed, kPositionStream);
  Transaction transaction;
  for (const Eigen::Vector2d& p : world.truth.positions) {
    Feature point;
    point.type = &registry.GetFeature("point");
    point.source = "simulation";
    const Eigen::Vector2d start =
        p + Noise(options.position_noise, &position_noise);
    point.parameters = {start.x(), start.y()};
    transaction.AddFeature(std::move(point));
  }
  SimulationRandom distance_noise = Stream(seed, kDistanceStream);
  const double sigma = Sigma(options.distance_noise);
  for (const auto& [i, j] : layout.distances()) {
    Constraint constraint;
    constraint.type = &registry.GetRelation("point_point_distance");
    constraint.features = {Transaction::ProvisionalId(i),
                           Transaction::ProvisionalId(j)};
    const double length =
        (world.truth.positions[i] - world.truth.positions[j]).norm();
    constraint.expected = Eigen::VectorXd::Constant(
        1, length + distance_noise.Uniform(-options.distance_noise,
                                           options.distance_noise));
    constraint.information =
        Eigen::MatrixXd::Constant(1, 1, 1.0 / (sigma * sigma));
    constraint.source = "simulation";
    transaction.AddConstraint(std::move(constraint));
  }
  world.graph = std::make_unique<Graph>();
  world.graph->Apply(std::move(transaction));
  return world;
}

SyntheticWorld MakeConcentricCircles(const SyntheticOptions& options,
                                     std::uint64_t seed,
                                     const Registry& registry) {
  SimulationRandom random = Stream(seed, kOutlierStream);
  SimulationRandom position_noise = Stream(seed, kPositionStream);
  SyntheticWorld world;
  SyntheticTruth& truth = world.truth;
  truth.centers = {Eigen::Vector2d::Zero()};
  Transaction transaction;
  Feature origin;
  origin.type = &registry.GetFeature("point");
  origin.fixed = true;
  origin.source = "simulation";
  const FeatureId origin_id = transaction.AddFeature(origin);
  truth.positions = {Eigen::Vector2d::Zero()};

  const int outlier = static_cast<int>(
      random.Uniform(0.0, static_cast<double>(kConcentricCircles + 1)));
  const double sigma = Sigma(options.position_noise);
  for (int k = 0; k <= kConcentricCircles; ++k) {
    SyntheticCircle circle;
    circle.radius = 1.0 + 0.5 * k;
    if (k == outlier) {
      circle.center.x() = random.Uniform(kOutlierNearest, kOutlierFarthest);
      circle.center.y() = random.Uniform(kOutlierNearest, kOutlierFarthest);
      truth.outliers.push_back(k + 1);
    } else {
      circle.common_center = 0;
    }
    Feature feature;
    feature.type = &registry.GetFeature("circle");
    feature.source = "simulation";
    const Eigen::Vector2d measured =
        circle.center + Noise(options.position_noise, &position_noise);
    feature.parameters = {measured.x(), measured.y(), circle.radius};
    Constraint constraint;
    constraint.type = &registry.GetRelation("point_point_coincidence");
    constraint.features = {origin_id, transaction.AddFeature(feature)};
    constraint.expected = measured;
    constraint.information = Eigen::Matrix2d::Identity() / (sigma * sigma);
    constraint.source = "simulation";
    transaction.AddConstraint(std::move(constraint));
    truth.positions.push_back(circle.center);
    truth.circles.push_back(std::move(circle));
  }
  world.graph = std::make_unique<Graph>();
  world.graph->Apply(std::move(transaction));
  return world;
}

void CheckRange(const char* name, double value, double high) {
  if (!(value >= 0.0 && value <= high)) {
    char text[64];
    std::snprintf(text, sizeof(text), "%s is %g", name, value);
    throw PLUMBLINE_ERROR(text, "0 to " + std::to_string(high));
  }
}

// Six digits after the point, without a sign on zero.
std::string Fixed(double value) {
  char text[64];
  std::snprintf(text, sizeof(text), "%.6f", value);
  return std::string(text) == "-0.000000" ? "0.000000" : text;
}

std::string Fixed(const Eigen::Vector2d& p) {
  return Fixed(p.x()) + ',' + Fixed(p.y());
}

// "[a,b,c]" of what `write` writes for each entry.
template <typename Container, typename Write>
void WriteList(const Container& entries, const char* separator,
               std::ostream& output, const Write& write) {
  output << '[';
  bool first = true;
  for (const auto& entry : entries) {
    if (!first) output << separator;
    first = false;
    write(entry);
  }
  output << ']';
}

}  // namespace

const std::vector<std::string>& SyntheticWorldNames() {
  static const std::vector<std::string> names = {"S1", "S2", "S3",
                                                 "S4", "S5", "S6"};
  return names;
}

SyntheticOptions DefaultSyntheticOptions(const std::string& name) {
  SyntheticOptions options;
  if (name == "S2") options.position_noise = 0.3;
  if (name == "S3") options.distance_noise = 0.1;
  if (name == "S4") options.outliers = 20;
  if (name == "S5") {
    // Less than the trees' deviation: a start with trees on the wrong side of
    // their neighbours stays so, with or without structure.
    options.position_noise = 0.05;
    options.distance_noise = 0.01;
  }
  if (name == "S6") options.position_noise = 0.1;
  return options;
}

SyntheticWorld MakeSyntheticWorld(const std::string& name,
                                  const SyntheticOptions& options,
                                  std::uint64_t seed,
                                  const Registry& registry) {
  CheckRange("position_noise", options.position_noise, 10.0);
  CheckRange("distance_noise", options.distance_noise, 0.4);
  CheckRange("outliers", options.outliers, 1000.0);
  if (name == "S6") return MakeConcentricCircles(options, seed, registry);
  Layout layout;
  if (name == "S5") {
    AddStreets(seed, &layout);
  } else if (name == "S1" || name == "S2" || name == "S3" || name == "S4") {
    AddBuilding(&layout);
  } else {
    throw PLUMBLINE_ERROR("no synthetic world is called '" + name + "'",
                          "S1, S2, S3, S4, S5 or S6");
  }
  AddOutliers(options.outliers, seed, &layout);
  return WorldFromLayout(std::move(layout), options, seed, registry);
}

void WriteSyntheticTruth(const SyntheticTruth& truth, std::ostream& output) {
  const auto write_id = [&output](FeatureId id) { output << id; };
  output << "{\"format\":\"plumbline-synthetic-truth\",\"version\":1,\n"
            "\"positions\":";
  std::size_t id = 0;
  WriteList(truth.positions, ",\n", output, [&](const Eigen::Vector2d& p) {
    output << '[' << id++ << ',' << Fixed(p) << ']';
  });
  output << ",\n\"lines\":";
  WriteList(truth.lines, ",\n", output, [&](const SyntheticLine& line) {
    output << "{\"x1\":" << Fixed(line.begin.x())
           << ",\"y1\":" << Fixed(line.begin.y())
           << ",\"x2\":" << Fixed(line.end.x())
           << ",\"y2\":" << Fixed(line.end.y())
           << ",\"orientation\":" << line.orientation << ",\"points\":";
    WriteList(line.points, ",", output, write_id);
    output << '}';
  });
  output << ",\n\"circles\":";
  WriteList(truth.circles, ",\n", output, [&](const SyntheticCircle& circle) {
    output << "{\"x\":" << Fixed(circle.center.x())
           << ",\"y\":" << Fixed(circle.center.y())
           << ",\"r\":" << Fixed(circle.radius)
           << ",\"common_center\":" << circle.common_center << ",\"points\":";
    WriteList(circle.points, ",", output, write_id);
    output << '}';
  });
  output << ",\n\"orientations_deg\":";
  WriteList(truth.orientations, ",", output,
            [&](double angle) { output << Fixed(RadToDeg(angle)); });
  output << ",\n\"centers\":";
  WriteList(truth.centers, ",", output, [&](const Eigen::Vector2d& p) {
    output << '[' << Fixed(p) << ']';
  });
  output << ",\n\"outliers\":";
  WriteList(truth.outliers, ",", output, write_id);
  output << "}\n";
}

RigidTransform AlignToTruth(const Graph& graph, const SyntheticTruth& truth) {
  RigidTransform transform;
  std::vector<std::pair<Eigen::Vector2d, Eigen::Vector2d>> pairs;
  Eigen::Vector2d from = Eigen::Vector2d::Zero();
  Eigen::Vector2d to = Eigen::Vector2d::Zero();
  for (const Feature* feature : graph.Features()) {
    if (feature->fixed) return transform;
    if (feature->level != 0 ||
        feature->id >= static_cast<FeatureId>(truth.positions.size())) {
      continue;
    }
    pairs.emplace_back(
        Eigen::Vector2d(feature->parameters[0], feature->parameters[1]),
        truth.positions[feature->id]);
    from += pairs.back().first;
    to += pairs.back().second;
  }
  if (pairs.size() < 2) return transform;
  from /= static_cast<double>(pairs.size());
  to /= static_cast<double>(pairs.size());
  double cosine = 0.0;
  double sine = 0.0;
  for (const auto& [p, q] : pairs) {
    const Eigen::Vector2d a = p - from;
    const Eigen::Vector2d b = q - to;
    cosine += a.dot(b);
    sine += a.x() * b.y() - a.y() * b.x();
  }
  const double length = std::hypot(cosine, sine);
  if (length > 0.0) {
    transform.rotation << cosine, -sine, sine, cosine;
    transform.rotation /= length;
  }
  transform.translation = to - transform.rotation * from;
  return transform;
}

double MeanPositionError(const Graph& graph, const SyntheticTruth& truth,
                         bool with_outliers) {
  const RigidTransform transform = AlignToTruth(graph, truth);
  double sum = 0.0;
  int count = 0;
  for (const Feature* feature : graph.Features()) {
    if (feature->level != 0 || feature->fixed ||
        feature->id >= static_cast<FeatureId>(truth.positions.size()) ||
        (!with_outliers &&
         std::binary_search(truth.outliers.begin(), truth.outliers.end(),
                            feature->id))) {
      continue;
    }
    const Eigen::Vector2d p(feature->parameters[0], feature->parameters[1]);
    sum += (transform * p - truth.positions[feature->id]).norm();
    ++count;
  }
  return count > 0 ? sum / count : 0.0;
}

}  // namespace plumbline
