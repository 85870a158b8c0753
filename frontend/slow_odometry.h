#ifndef PLUMBLINE_FRONTEND_SLOW_ODOMETRY_H_
#define PLUMBLINE_FRONTEND_SLOW_ODOMETRY_H_

#include <plumbline/frontend/scan.h>

#include <vector>

namespace plumbline {

/// Interpolates odometry that comes more seldom than scans. A log that notes
/// with each scan the last pose that odometry gave has the same pose for
/// several scans and then the way of all of them at once; taken as it stands,
/// the robot stops and leaps many times a metre, and each scan lies up to a
/// whole step behind. Where most of the readings of a moving robot are those of
/// two scans or more, the scans between two readings are put on the straight
/// way from the one to the other by their time stamps. A reading that holds
/// longer than usual is that of a robot that stands: it goes on in the usual
/// time before the next one. Faster ways than robots go are leaps, and stay.
/// Returns how many scans a reading has, at the median of those of a moving
/// robot, and 1 where nothing is changed: readings of one scan now and then, or
/// fewer than 20 of them, say nothing. Cost: linear in the scans.
int SpreadSlowOdometry(std::vector<Scan>* scans);

/// The same for the scans of a log, with a note for people.
void SpreadSlowOdometry(Log* log);

}  // namespace plumbline

#endif  // PLUMBLINE_FRONTEND_SLOW_ODOMETRY_H_
