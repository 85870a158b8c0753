#include <plumbline/frontend/track_reference.h>

#include <algorithm>
#include <cstddef>
#include <exception>
#include <system_error>
#include <utility>

namespace plumbline {

TrackReference::~TrackReference() {
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    has_ended_ = true;
  }
  changed_.notify_all();
  if (thread_.joinable()) thread_.join();
}

void TrackReference::Base::Gather() {
  std::vector<ReferencePoint> all;
  std::size_t count = 0;
  for (const Seen& key : keys) count += key.points->size();
  all.reserve(count);
  for (const Seen& key : keys) {
    all.insert(all.end(), key.points->begin(), key.points->end());
  }
  points.Add(std::move(all));
}

bool TrackReference::Base::IsOf(const std::vector<Seen>& others,
                                double merge_distance) const {
  return points.merge_distance() == merge_distance &&
         std::equal(
             keys.begin(), keys.end(), others.begin(), others.end(),
             [](const Seen& a, const Seen& b) { return a.points == b.points; });
}

// What was seen at the same pose before is shared.
TrackReference::Seen TrackReference::See(const TrackKey& key) const {
  for (const Seen& seen : seen_) {
    if (seen.scan == key.scan && seen.pose == key.pose &&
        seen.points->size() == key.points.size()) {
      return seen;
    }
  }
  const PoseTransform transform(key.pose);
  std::vector<ReferencePoint> points;
  points.reserve(key.points.size());
  for (const ScanPoint& point : key.points) {
    points.push_back(
        {transform.Point(point.position), transform.Direction(point.normal)});
  }
  return {
      key.scan, key.pose, transform.Point(key.laser),
      std::make_shared<const std::vector<ReferencePoint>>(std::move(points))};
}

void TrackReference::Set(const std::deque<TrackKey>& keys, double reach,
                         int window, double merge_distance,
                         ScanMatcher* matcher) {
  std::vector<Seen> now;
  for (const TrackKey& key : keys) {
    if ((key.pose - keys.back().pose).head<2>().norm() > reach) continue;
    now.push_back(See(key));
  }
  const Seen last = now.back();
  now.pop_back();
  ReferencePoints points = PointsOf(now, merge_distance);
  points.Add(*last.points);
  now.push_back(last);
  std::vector<Viewpoint> viewpoints;
  std::size_t begin = 0;
  for (const Seen& key : now) {
    viewpoints.push_back({key.laser, begin});
    begin += key.points->size();
  }
  matcher->SetReference(std::move(points), std::move(viewpoints));
  seen_ = now;
  if (static_cast<int>(keys.size()) >= window) now.erase(now.begin());
  Prepare(std::move(now), merge_distance);
}

// What the thread has made of these keys, or is making; what it has not begun
// is made here.
ReferencePoints TrackReference::PointsOf(const std::vector<Seen>& keys,
                                         double merge_distance) {
  if (thread_.joinable()) {
    std::unique_lock<std::mutex> lock(mutex_);
    wanted_.reset();
    changed_.wait(lock, [this] { return !is_at_work_; });
    std::optional<Base> made;
    made.swap(made_);
    if (made && made->IsOf(keys, merge_distance)) {
      return std::move(made->points);
    }
  }
  Base base{keys, ReferencePoints(merge_distance)};
  base.Gather();
  return std::move(base.points);
}

void TrackReference::Prepare(std::vector<Seen> keys, double merge_distance) {
  if (!prepares_ahead_) return;
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    wanted_ = Base{std::move(keys), ReferencePoints(merge_distance)};
  }
  if (thread_.joinable()) {
    changed_.notify_all();
    return;
  }
  try {
    thread_ = std::thread([this] { Work(); });
  } catch (const std::system_error&) {
    // No thread is granted: all is made when it is needed.
  }
}

void TrackReference::Work() {
  std::unique_lock<std::mutex> lock(mutex_);
  while (true) {
    changed_.wait(lock, [this] { return has_ended_ || wanted_.has_value(); });
    if (has_ended_) return;
    Base base = std::move(*wanted_);
    wanted_.reset();
    is_at_work_ = true;
    lock.unlock();
    bool is_made = true;
    try {
      base.Gather();
    } catch (const std::exception&) {
      // Without memory: who needs it meets that himself, and can say so.
      is_made = false;
    }
    lock.lock();
    is_at_work_ = false;
    if (is_made) made_ = std::move(base);
    changed_.notify_all();
  }
}

}  // namespace plumbline
