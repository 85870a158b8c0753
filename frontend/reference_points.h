#ifndef PLUMBLINE_FRONTEND_REFERENCE_POINTS_H_
#define PLUMBLINE_FRONTEND_REFERENCE_POINTS_H_

#include <Eigen/Core>
#include <utility>
#include <vector>

namespace plumbline {

/// What matching needs of a return of a reference: the search runs through
/// many.
struct ReferencePoint {
  /// In the reference's frame, m.
  Eigen::Vector2d position;
  /// Unit normal towards the laser; zero where the surface is not straight.
  Eigen::Vector2d normal;
};

/// The points of a reference by the buckets of a raster, those that say the
/// same made one. More may be added, as if all had come at once.
class ReferencePoints {
 public:
  /// Side of the buckets, m; they begin at the frame's origin.
  static constexpr double kBucketSize = 0.1;

  /// A bucket with points.
  struct Bucket {
    int row;
    int column;
    /// The first of its points among all; they end where the next bucket's
    /// begin.
    int begin;
    /// That which the last point was made one with, or has become, of its own.
    int last;
  };

  /// Points nearer than this to each other, m, that look the same way are one.
  explicit ReferencePoints(double merge_distance)
      : merge_distance_(merge_distance) {}

  /// Adds points, in any order. Those whose bucket has no number that fits an
  /// integer are left out. Cost: linear in all points.
  void Add(std::vector<ReferencePoint> points);

  /// As it was given, m.
  double merge_distance() const { return merge_distance_; }
  /// All that were added, in their order.
  const std::vector<ReferencePoint>& given() const { return given_; }
  /// Those that are left, by rows of buckets and in each by columns.
  const std::vector<ReferencePoint>& points() const { return points_; }
  /// The buckets that have some, in that order.
  const std::vector<Bucket>& buckets() const { return buckets_; }

  /// Gives them away.
  std::vector<ReferencePoint> TakeGiven() { return std::move(given_); }
  std::vector<ReferencePoint> TakePoints() { return std::move(points_); }

 private:
  struct Entry {
    int row;
    int column;
    int point;
  };

  static std::vector<Entry> Sorted(const std::vector<ReferencePoint>& points);
  void Merge(const ReferencePoint& point, Bucket* bucket);

  double merge_distance_;
  std::vector<ReferencePoint> given_;
  std::vector<ReferencePoint> points_;
  // By point: how many it was made of.
  std::vector<int> shares_;
  std::vector<Bucket> buckets_;
};

}  // namespace plumbline

#endif  // PLUMBLINE_FRONTEND_REFERENCE_POINTS_H_
