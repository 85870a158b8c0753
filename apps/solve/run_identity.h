#ifndef PLUMBLINE_APPS_SOLVE_RUN_IDENTITY_H_
#define PLUMBLINE_APPS_SOLVE_RUN_IDENTITY_H_

#include <plumbline/frontend/log_reader.h>
#include <plumbline/outputs/checkpoint_file.h>

namespace plumbline {

/// What the state between the stages of a run on this log depends on: not on
/// what is made of the map in the end, nor on the number of threads.
CheckpointFile::Identity IdentityOfRun(const Log& log);

}  // namespace plumbline

#endif  // PLUMBLINE_APPS_SOLVE_RUN_IDENTITY_H_
