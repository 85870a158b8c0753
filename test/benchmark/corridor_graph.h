#ifndef PLUMBLINE_TEST_BENCHMARK_CORRIDOR_GRAPH_H_
#define PLUMBLINE_TEST_BENCHMARK_CORRIDOR_GRAPH_H_

#include <plumbline/core/graph.h>
#include <plumbline/core/registry.h>
#include <plumbline/factors/angle.h>
#include <plumbline/factors/pose2.h>

#include <Eigen/Core>
#include <array>
#include <cmath>
#include <cstdint>
#include <random>
#include <vector>

namespace plumbline {

// A graph of wall segments as a log of long corridors gives it: corridors of
// two walls in pieces, one beside the other and walked through to and fro. Each
// piece is measured from pieces seen before it, doors let through to the
// corridor before (loops), and every piece is tied to one of two orientations
// at right angles.
class CorridorGraph {
 public:
  // About `num_segments` segments, in whole corridors. They start where their
  // measurements, one after the other, lead: with the drift of a robot.
  CorridorGraph(const Registry& registry, int num_segments)
      : registry_(registry) {
    Transaction transaction;
    std::vector<Pose2> truth;
    std::vector<Pose2> start;
    const int corridors =
        (num_segments + kSegmentsPerCorridor - 1) / kSegmentsPerCorridor;
    for (int corridor = 0; corridor < corridors; ++corridor) {
      for (int index = 0; index < kSegmentsPerCorridor; ++index) {
        const int segment = corridor * kSegmentsPerCorridor + index;
        truth.push_back(TruePose(corridor, index));
        start.push_back(truth.back());
        bool is_first = true;
        for (const int other : SeenBefore(corridor, index)) {
          const Pose2 measured = Measure(truth[other], truth[segment]);
          if (is_first) start[segment] = Compose(start[other], measured);
          is_first = false;
          transaction.AddConstraint(
              PosePose(Transaction::ProvisionalId(other),
                       Transaction::ProvisionalId(segment), measured));
        }
        Feature feature;
        feature.type = &registry.GetFeature("segment");
        feature.fixed = segment == 0;
        for (int i = 0; i < 3; ++i) feature.parameters[i] = start[segment][i];
        feature.extent_begin = -0.5 * kPieceLength;
        feature.extent_end = 0.5 * kPieceLength;
        transaction.AddFeature(feature);
      }
    }
    num_segments_ = static_cast<int>(truth.size());
    std::array<FeatureId, 2> orientations;
    for (int i = 0; i < 2; ++i) {
      Feature feature;
      feature.type = &registry.GetFeature("orientation");
      feature.level = 1;
      feature.is_virtual = true;
      feature.parameters[0] = i * 0.5 * kPi;
      orientations[i] = transaction.AddFeature(feature);
    }
    for (int segment = 0; segment < num_segments_; ++segment) {
      const bool across = segment % kSegmentsPerCorridor == 2 * kPieces;
      transaction.AddConstraint(Direction("segment_orientation",
                                          Transaction::ProvisionalId(segment),
                                          orientations[across ? 1 : 0], 0.0));
    }
    transaction.AddConstraint(Direction("orientation_orientation",
                                        orientations[0], orientations[1],
                                        0.5 * kPi));
    graph_.Apply(std::move(transaction));
    start_ = State();
  }

  Graph& graph() { return graph_; }
  int num_segments() const { return num_segments_; }
  // Segments of a corridor in the middle of the graph, ascending.
  std::vector<FeatureId> MiddleCorridor() const {
    const int corridors = num_segments_ / kSegmentsPerCorridor;
    std::vector<FeatureId> ids;
    for (int i = 0; i < kSegmentsPerCorridor; ++i) {
      ids.push_back(corridors / 2 * kSegmentsPerCorridor + i);
    }
    return ids;
  }

  // Parameters of all features, in the order of ids.
  std::vector<std::array<double, kMaxFeatureSize>> State() const {
    std::vector<std::array<double, kMaxFeatureSize>> state;
    for (const Feature* feature : graph_.Features()) {
      state.push_back(feature->parameters);
    }
    return state;
  }
  void SetState(const std::vector<std::array<double, kMaxFeatureSize>>& state) {
    std::size_t i = 0;
    for (Feature* feature : graph_.MutableFeatures()) {
      feature->parameters = state[i++];
    }
  }
  const std::vector<std::array<double, kMaxFeatureSize>>& start() const {
    return start_;
  }

  // Moves segments by about a centimetre and a tenth of a degree.
  void Disturb(const std::vector<FeatureId>& features) {
    for (const FeatureId id : features) {
      Feature& feature = graph_.GetFeature(id);
      if (feature.fixed) continue;
      for (int i = 0; i < 2; ++i) feature.parameters[i] += 0.01 * Gaussian();
      feature.parameters[2] += DegToRad(0.1) * Gaussian();
    }
  }

 private:
  static constexpr int kPieces = 20;
  static constexpr int kSegmentsPerCorridor = 2 * kPieces + 1;
  static constexpr double kPieceLength = 5.0;
  static constexpr double kWidth = 2.4;
  static constexpr double kPitch = 2.6;
  static constexpr int kDoorEvery = 5;
  static constexpr double kPositionSigma = 0.005;
  static constexpr double kAngleSigma = DegToRad(0.1);

  // Pieces are numbered along the corridor as it is walked, the right and the
  // left one of each pair; the last segment closes the far end.
  static Pose2 TruePose(int corridor, int index) {
    const bool forth = corridor % 2 == 0;
    if (index == 2 * kPieces) {
      return Pose2(forth ? kPieces * kPieceLength : 0.0,
                   corridor * kPitch + 0.5 * kWidth, 0.5 * kPi);
    }
    const double along = (index / 2 + 0.5) * kPieceLength;
    const bool upper = (index % 2 == 1) == forth;
    return Pose2(forth ? along : kPieces * kPieceLength - along,
                 corridor * kPitch + (upper ? kWidth : 0.0), upper ? kPi : 0.0);
  }

  static std::vector<int> SeenBefore(int corridor, int index) {
    const int first = corridor * kSegmentsPerCorridor;
    const int last_of_before = first - 1;
    std::vector<int> seen;
    // The two pairs before, and the other wall of the pair.
    for (int other = index - 1; other >= index - 4 - index % 2; --other) {
      if (other >= 0) seen.push_back(first + other);
    }
    if (corridor > 0 && index < 2) seen.push_back(last_of_before);
    if (corridor > 0 && index < 2 * kPieces &&
        index / 2 % kDoorEvery == kDoorEvery / 2) {
      // The same place in the corridor before, which was walked the other way.
      const int across = kPieces - 1 - index / 2;
      seen.push_back(first - kSegmentsPerCorridor + 2 * across + index % 2);
    }
    return seen;
  }

  double Uniform() {
    return (static_cast<double>(engine_() >> 11) + 0.5) / 9007199254740992.0;
  }
  double Gaussian() {
    const double radius = std::sqrt(-2.0 * std::log(Uniform()));
    return radius * std::cos(2.0 * kPi * Uniform());
  }

  Pose2 Measure(const Pose2& from, const Pose2& to) {
    Pose2 measured = Between(from, to);
    for (int i = 0; i < 2; ++i) measured[i] += kPositionSigma * Gaussian();
    measured[2] += kAngleSigma * Gaussian();
    return measured;
  }

  Constraint PosePose(FeatureId from, FeatureId to, const Pose2& measured) {
    Constraint constraint;
    constraint.type = &registry_.GetRelation("pose_pose");
    constraint.features = {from, to};
    constraint.expected = measured;
    constraint.information =
        Eigen::Vector3d(1.0 / (kPositionSigma * kPositionSigma),
                        1.0 / (kPositionSigma * kPositionSigma),
                        1.0 / (kAngleSigma * kAngleSigma))
            .asDiagonal();
    return constraint;
  }

  Constraint Direction(const char* relation, FeatureId first, FeatureId second,
                       double expected) {
    Constraint constraint;
    constraint.type = &registry_.GetRelation(relation);
    constraint.features = {first, second};
    constraint.expected = Eigen::VectorXd::Constant(1, expected);
    constraint.information =
        Eigen::MatrixXd::Constant(1, 1, 1.0 / (kAngleSigma * kAngleSigma));
    constraint.kind = ConstraintClass::kStructure;
    return constraint;
  }

  const Registry& registry_;
  Graph graph_;
  int num_segments_ = 0;
  std::vector<std::array<double, kMaxFeatureSize>> start_;
  std::mt19937_64 engine_{1};
};

}  // namespace plumbline

#endif  // PLUMBLINE_TEST_BENCHMARK_CORRIDOR_GRAPH_H_
