#ifndef PLUMBLINE_FRONTEND_RETURNS_AHEAD_H_
#define PLUMBLINE_FRONTEND_RETURNS_AHEAD_H_

#include <plumbline/frontend/scan.h>
#include <plumbline/frontend/scan_points.h>

#include <condition_variable>
#include <cstddef>
#include <mutex>
#include <vector>

namespace plumbline {

/// The returns of scans (ExtractScanPoints) for a thread that takes them scan
/// by scan. Another one that has nothing else to do may make them ahead; what
/// is taken is the same whether it does or not.
class ReturnsAhead {
 public:
  /// From the scan with this index on; `scans` must outlive this. `options` as
  /// they are for a laser of usual noise. At most so many scans (1 or more) are
  /// ahead of the one that is taken.
  ReturnsAhead(const std::vector<Scan>& scans, std::size_t first,
               const ScanPointsOptions& options, std::size_t most);

  /// Those of the next scan, which there must be, for a laser noisier by this
  /// factor (ScanPointsOptions::ScaleToNoise). By one thread.
  void Take(double noise_scale, std::vector<ScanPoint>* points);

  /// Makes those of one more scan ahead; false when there is none left, or
  /// enough are ahead. By one other thread.
  bool MakeNext();

 private:
  struct Made {
    std::vector<ScanPoint> points;
    double noise_scale = 1.0;
    bool is_made = false;
  };

  void Extract(std::size_t scan, double noise_scale,
               std::vector<ScanPoint>* points) const;

  const std::vector<Scan>& scans_;
  const ScanPointsOptions options_;
  std::mutex mutex_;
  std::condition_variable made_;
  // The next scan that is begun, and the next that is taken.
  std::size_t next_;
  std::size_t taken_;
  // Of the scan that was taken last.
  double noise_scale_ = 1.0;
  // Those ahead: scan i at i modulo their number.
  std::vector<Made> ahead_;
};

}  // namespace plumbline

#endif  // PLUMBLINE_FRONTEND_RETURNS_AHEAD_H_
