#include <plumbline/core/error.h>
#include <plumbline/core/number_text.h>
#include <plumbline/pipeline/usable_input.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <string>
#include <type_traits>
#include <utility>

namespace plumbline {
namespace {

// Coordinates beyond are no building's, m and rad.
constexpr double kLargestCoordinate = 1e7;

template <typename Value>
std::string Text(Value value) {
  std::string text;
  if constexpr (std::is_floating_point_v<Value>) {
    if (!std::isfinite(value)) return std::isnan(value) ? "nan" : "infinite";
    AppendNumber(static_cast<double>(value), &text);
  } else {
    AppendNumber(static_cast<std::int64_t>(value), &text);
  }
  return text;
}

bool IsUsable(const Pose2& pose) {
  return pose.allFinite() && pose.cwiseAbs().maxCoeff() <= kLargestCoordinate;
}

bool IsFinite(float value) { return std::isfinite(value); }

void RequireNumbers(
    const std::vector<std::pair<const char*, double>>& options) {
  for (const auto& [name, value] : options) {
    if (!std::isnan(value)) continue;
    throw PLUMBLINE_ERROR(std::string(name) + " is nan", "a number");
  }
}

void RequireCounts(
    const std::vector<std::pair<const char*, std::int64_t>>& options) {
  for (const auto& [name, value] : options) {
    if (value >= 0) continue;
    throw PLUMBLINE_ERROR(std::string(name) + " is " + Text(value),
                          "0 or more");
  }
}

}  // namespace

void RequireUsable(const Scan& scan, std::size_t index) {
  const auto refuse = [index](const std::string& what,
                              const std::string& expected) {
    throw PLUMBLINE_ERROR("scan " + std::to_string(index) + ": " + what,
                          expected);
  };
  if (!IsUsable(scan.odometry)) {
    refuse("its odometry is not finite or absurd", "m and rad within 1e7");
  }
  if (!IsUsable(scan.laser_offset)) {
    refuse("its laser_offset is not finite or absurd", "m and rad within 1e7");
  }
  if (!std::isfinite(scan.timestamp)) {
    refuse("its timestamp is " + Text(scan.timestamp), "seconds");
  }
  if (!std::isfinite(scan.start_angle) || !std::isfinite(scan.angle_step)) {
    refuse("start_angle or angle_step is not finite", "rad");
  }
  const std::size_t beams = scan.ranges.size();
  if (beams > 1 && scan.angle_step == 0.0) {
    refuse("its angle_step is 0 with " + std::to_string(beams) + " beams",
           "the angle between them, rad");
  }
  const auto range =
      std::find_if_not(scan.ranges.begin(), scan.ranges.end(), IsFinite);
  if (range != scan.ranges.end()) {
    refuse("range " + std::to_string(range - scan.ranges.begin()) + " is " +
               Text(*range),
           "m, or 0 where nothing came back");
  }
  if (!scan.bearings.empty() && scan.bearings.size() != beams) {
    refuse(std::to_string(scan.bearings.size()) + " bearings for " +
               std::to_string(beams) + " beams",
           "one per beam, or none");
  }
  if (!std::all_of(scan.bearings.begin(), scan.bearings.end(), IsFinite)) {
    refuse("a bearing is not finite", "rad");
  }
}

void RequireUsable(const std::vector<Scan>& scans) {
  for (std::size_t i = 0; i < scans.size(); ++i) RequireUsable(scans[i], i);
}

void RequireUsable(const LogSolverOptions& options) {
  RequireCounts({
      {"scans_per_stage", options.scans_per_stage},
      {"em_every", options.em_every},
      {"em_depth", options.em_depth},
      {"small_map", options.small_map},
      {"em.max_iterations", options.em.max_iterations},
      {"em.max_breaks", options.em.max_breaks},
      {"em.max_breaks_per_feature", options.em.max_breaks_per_feature},
      {"session.max_iterations", options.session.max_iterations},
      {"odometry.window", options.odometry.window},
  });
  const SessionOptions& session = options.session;
  const EmOptions& em = options.em;
  const OdometryRefinementOptions& odometry = options.odometry;
  const OdometryNoise& noise = odometry.noise;
  const KnownStructure& known = options.known;
  RequireNumbers({
      {"max_gap_of_final_map", options.max_gap_of_final_map},
      {"closing_position_scale", options.closing_position_scale},
      {"closing_break_share", options.closing_break_share},
      {"session.function_tolerance", session.function_tolerance},
      {"session.initial_trust_region_radius",
       session.initial_trust_region_radius},
      {"em.delta_threshold", em.delta_threshold},
      {"em.break_share", em.break_share},
      {"em.loop_tolerance", em.loop_tolerance},
      {"em.loop_trust_region_radius", em.loop_trust_region_radius},
      {"em.cost_tolerance", em.cost_tolerance},
      {"em.reproposal_sigmas", em.reproposal_sigmas},
      {"odometry.key_distance", odometry.key_distance},
      {"odometry.key_rotation", odometry.key_rotation},
      {"odometry.clutter_innovation", odometry.clutter_innovation},
      {"odometry.max_clutter", odometry.max_clutter},
      {"odometry.clutter_distance", odometry.clutter_distance},
      {"odometry.clutter_rotation", odometry.clutter_rotation},
      {"odometry.good_inlier_ratio", odometry.good_inlier_ratio},
      {"odometry.minimum_inlier_ratio", odometry.minimum_inlier_ratio},
      {"odometry.search_translation", odometry.search_translation},
      {"odometry.search_rotation", odometry.search_rotation},
      {"odometry.max_search_translation", odometry.max_search_translation},
      {"odometry.search_turn", odometry.search_turn},
      {"odometry.range_sigma", odometry.range_sigma},
      {"odometry.noise.translation", noise.translation},
      {"odometry.noise.translation_per_metre", noise.translation_per_metre},
      {"odometry.noise.rotation", noise.rotation},
      {"odometry.noise.rotation_per_metre", noise.rotation_per_metre},
      {"odometry.noise.rotation_per_radian", noise.rotation_per_radian},
      {"odometry.noise.translation_per_radian", noise.translation_per_radian},
      {"known.plan_sigma_offset", known.plan_sigma_offset},
      {"known.plan_sigma_angle", known.plan_sigma_angle},
      {"known.break_below", known.break_below},
      {"known.max_offset", known.max_offset},
      {"known.max_angle", known.max_angle},
  });
}

}  // namespace plumbline
