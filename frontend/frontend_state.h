#ifndef PLUMBLINE_FRONTEND_FRONTEND_STATE_H_
#define PLUMBLINE_FRONTEND_FRONTEND_STATE_H_

#include <plumbline/core/state_archive.h>
#include <plumbline/factors/pose2.h>
#include <plumbline/frontend/graph_builder.h>
#include <plumbline/frontend/odometry_refinement.h>
#include <plumbline/frontend/scan_points.h>
#include <plumbline/frontend/scan_relations.h>

// What the front-end makes of scans, for a StateWriter or StateReader
// (core/state_archive.h).

namespace plumbline {

/// Each of these writes or sets all members of its type.
template <typename Archive>
void Exchange(Archive& archive, UncertainPose2& pose) {
  auto& [mean, covariance] = pose;
  ExchangeAll(archive, mean, covariance);
}

template <typename Archive>
void Exchange(Archive& archive, RefinedScan& scan) {
  auto& [pose, since_key, since, is_key, odometry_only, tie, missed,
         missed_since] = scan;
  ExchangeAll(archive, pose, since_key, since, is_key, odometry_only, tie,
              missed, missed_since);
}

template <typename Archive>
void Exchange(Archive& archive, SegmentObservation& observation) {
  auto& [pose, length, points, covariance] = observation;
  ExchangeAll(archive, pose, length, points, covariance);
}

template <typename Archive>
void Exchange(Archive& archive, PointObservation& observation) {
  auto& [position, covariance, share] = observation;
  ExchangeAll(archive, position, covariance, share);
}

template <typename Archive>
void Exchange(Archive& archive, FeatureMatch& match) {
  auto& [feature, observation] = match;
  ExchangeAll(archive, feature, observation);
}

template <typename Archive>
void Exchange(Archive& archive, PointMatch& match) {
  auto& [feature, observation] = match;
  ExchangeAll(archive, feature, observation);
}

template <typename Archive>
void Exchange(Archive& archive, KeyScanRecord& record) {
  auto& [scan, motion, from, is_loose, pose, matches, points] = record;
  ExchangeAll(archive, scan, motion, from, is_loose, pose, matches, points);
}

template <typename Archive>
void Exchange(Archive& archive, LooseTrack& track) {
  auto& [begin, end, why, found, is_ambiguous] = track;
  ExchangeAll(archive, begin, end, why, found, is_ambiguous);
}

template <typename Archive>
void Exchange(Archive& archive, ScanPoint& point) {
  auto& [position, normal, range, beam, is_between] = point;
  ExchangeAll(archive, position, normal, range, beam, is_between);
}

template <typename Archive>
void Exchange(Archive& archive, ScanRelation& relation) {
  auto& [from, to, mean, information] = relation;
  ExchangeAll(archive, from, to, mean, information);
}

}  // namespace plumbline

#endif  // PLUMBLINE_FRONTEND_FRONTEND_STATE_H_
