#include <plumbline/apps/cli/app.h>
#include <plumbline/apps/cli/progress.h>
#include <plumbline/apps/solve/solving_progress.h>

#include <cstdint>

namespace plumbline {

void SolvingProgress::BeginLog(const std::string& title) {
  clock_.Begin("scans");
  clock_.bar().SetTitle(title);
  title_ = title;
  is_finishing_ = false;
}

RunControl SolvingProgress::Control() {
  RunControl control;
  control.progress = [this](std::size_t done, std::size_t total) {
    TakeScan(done, total);
  };
  control.stop = [this] {
    if (is_finishing_) clock_.bar().Update();
    return InterruptRequested();
  };
  control.step = [this](const char* step) {
    clock_.Begin(step);
    Detail("%s, after %.1f s", step, watch_.Seconds());
  };
  if (live_.is_on()) {
    control.look = [this](const MapSoFar& map) {
      live_.Show(map, [this] { return Stage(); });
    };
  }
  return control;
}

std::string SolvingProgress::Stage() const {
  if (is_finishing_) return clock_.step();
  return title_ + ", " + std::to_string(done_) + " of " +
         std::to_string(total_);
}

void SolvingProgress::TakeScan(std::size_t done, std::size_t total) {
  done_ = done;
  total_ = total;
  clock_.bar().Update(ShareOf(static_cast<std::int64_t>(done),
                              static_cast<std::int64_t>(total)));
  if (done % 500 == 0 || done == total) {
    Detail("%zu of %zu scans in %.1f s", done, total, watch_.Seconds());
  }
  is_finishing_ = done == total;
}

}  // namespace plumbline
