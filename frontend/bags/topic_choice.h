#ifndef PLUMBLINE_FRONTEND_BAGS_TOPIC_CHOICE_H_
#define PLUMBLINE_FRONTEND_BAGS_TOPIC_CHOICE_H_

#include <plumbline/frontend/bags/bag_messages.h>

#include <cstddef>
#include <string>
#include <vector>

namespace plumbline {

/// Of several topics with scans those that could be meant, indices into
/// BagMessages::streams. Left out, and told why in LogTopic::why_not, are
/// lasers that do not look level (by tf, or by their name where tf does not
/// tell), where others may, and topics that have scans of one laser once more:
/// the one with the most messages is kept, of as many that with the most
/// returns.
std::vector<std::size_t> ScanTopicsThatMayBeMeant(BagMessages* messages);

/// The same of topics with odometry. Left out are poses in a frame called map,
/// which jump where a localization finds its error, if there is anything else;
/// those of other namespaces than `scan_topic`, if there is one of its own; and
/// of several topics all but the one whose poses are those of tf, which is what
/// the robot itself goes by.
///
/// `transform`: the poses of the robot in a frame called odom by tf; empty
/// where there are none.
std::vector<std::size_t> OdometryTopicsThatMayBeMeant(
    const std::vector<std::size_t>& topics, const std::string& scan_topic,
    const std::vector<BagPose>& transform, BagMessages* messages);

/// The topic whose turn rates are taken: of an IMU that lies level by tf, or of
/// which tf does not tell, rather than of one that does not, as those of
/// cameras do; of several the one with the most messages. Null where there is
/// none.
BagStream* ChooseImu(BagMessages* messages);

}  // namespace plumbline

#endif  // PLUMBLINE_FRONTEND_BAGS_TOPIC_CHOICE_H_
