#include <plumbline/frontend/joint_adjustment.h>
#include <plumbline/frontend/relocalization.h>
#include <plumbline/pipeline/log_run.h>

namespace plumbline {

void LogRun::Begin(const char* step) const {
  if (control.step) control.step(step);
}

bool LogRun::IsStopped() {
  if (!result.interrupted && control.stop && control.stop()) {
    result.interrupted = true;
  }
  return result.interrupted;
}

void LogRun::TakeTrajectory(const Graph& graph, int place_stride) {
  result.trajectory = InterpolateScans(
      result.refined, result.records,
      KeyPosesOfPlaces(graph, places, result.records, place_stride));
}

}  // namespace plumbline
