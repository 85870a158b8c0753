#ifndef PLUMBLINE_APPS_SIMULATION_STRESS_H_
#define PLUMBLINE_APPS_SIMULATION_STRESS_H_

#include <plumbline/apps/simulation/simulator.h>

#include <cstdint>
#include <string>
#include <vector>

namespace plumbline {

/// What robots do to their logs:
///
///     turns    scans of turns of 45 to 80 degrees are missing; odometry goes
///     on stale    as turns, and the first one or two scans after each gap
///     carry
///              the odometry of before it, which then catches up at once
///     dead     odometry stands still for 40 scans and goes on from there
///     scale    all odometry: ways times 1.15, turns times 0.8
///     jump     odometry jumps by 1 m and 40 degrees between two scans
///     blind    for 60 scans two thirds of the beams return nothing
///     people   for 150 scans the legs of three people who walk within 2 m of
///              the robot are in front of what stands
///     carried  150 scans are missing, and odometry does not know that the
///     robot
///              moved
std::vector<std::string> StressKinds();

/// Does one of them to a simulated drive, `count` times where there is room
/// (scale: all along), drawn from `seed`. Only scans are left of the states;
/// those that remain keep their time and their true pose. `maximum_range`: what
/// a beam without a return reads, m. Returns the scans, counted before any was
/// left out, at which something begins. Throws Error for an unknown kind or a
/// count below 1.
std::vector<int> Stress(const std::string& kind, int count, std::uint64_t seed,
                        double maximum_range, Simulation* simulation);

}  // namespace plumbline

#endif  // PLUMBLINE_APPS_SIMULATION_STRESS_H_
