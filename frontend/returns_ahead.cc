#include <plumbline/frontend/returns_ahead.h>

#include <utility>

namespace plumbline {

ReturnsAhead::ReturnsAhead(const std::vector<Scan>& scans, std::size_t first,
                           const ScanPointsOptions& options, std::size_t most)
    : scans_(scans),
      options_(options),
      next_(first),
      taken_(first),
      ahead_(most) {}

void ReturnsAhead::Extract(std::size_t scan, double noise_scale,
                           std::vector<ScanPoint>* points) const {
  ScanPointsOptions options = options_;
  options.ScaleToNoise(noise_scale);
  ExtractScanPoints(scans_[scan], options, points);
}

void ReturnsAhead::Take(double noise_scale, std::vector<ScanPoint>* points) {
  std::size_t scan = 0;
  {
    std::unique_lock<std::mutex> lock(mutex_);
    noise_scale_ = noise_scale;
    scan = taken_;
    if (next_ == scan) {
      ++next_;
      ++taken_;
    } else {
      Made& made = ahead_[scan % ahead_.size()];
      made_.wait(lock, [&made] { return made.is_made; });
      std::swap(*points, made.points);
      ++taken_;
      // The laser has proved noisier, or less so, since.
      if (made.noise_scale == noise_scale) return;
    }
  }
  Extract(scan, noise_scale, points);
}

bool ReturnsAhead::MakeNext() {
  std::unique_lock<std::mutex> lock(mutex_);
  if (next_ == scans_.size() || next_ >= taken_ + ahead_.size()) return false;
  const std::size_t scan = next_++;
  Made& made = ahead_[scan % ahead_.size()];
  made.is_made = false;
  made.noise_scale = noise_scale_;
  lock.unlock();
  Extract(scan, made.noise_scale, &made.points);
  lock.lock();
  made.is_made = true;
  lock.unlock();
  made_.notify_one();
  return true;
}

}  // namespace plumbline
