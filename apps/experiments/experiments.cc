#include <plumbline/apps/experiments/building_experiments.h>
#include <plumbline/apps/experiments/experiments.h>
#include <plumbline/apps/experiments/log_experiments.h>
#include <plumbline/apps/experiments/synthetic_experiments.h>
#include <plumbline/core/error.h>

#include <memory>
#include <utility>

namespace plumbline {
namespace {

using Runner = void (*)(const ExperimentOptions&, const Registry&,
                        ExperimentResult*);

const std::vector<std::pair<std::string, Runner>>& Runners() {
  static const std::vector<std::pair<std::string, Runner>> runners = {
      {"S1", RunS1}, {"S2", RunS2}, {"S3", RunS3}, {"S4", RunS4},
      {"S5", RunS5}, {"S6", RunS6}, {"R1", RunR1}, {"R2", RunR2},
      {"B1", RunB1}, {"B2", RunB2}, {"N1", RunN1}};
  return runners;
}

}  // namespace

const std::vector<std::string>& ExperimentNames() {
  static const std::vector<std::string> names = [] {
    std::vector<std::string> list;
    for (const auto& runner : Runners()) list.push_back(runner.first);
    return list;
  }();
  return names;
}

ExperimentResult RunExperiment(const std::string& id,
                               const ExperimentOptions& options,
                               Registry* registry) {
  if (options.trials < 1 || options.num_threads < 1) {
    throw PLUMBLINE_ERROR("trials or threads are less than 1", "at least 1");
  }
  if (registry->FindLoss(kUnweightedLoss) == nullptr) {
    LossType type;
    type.name = kUnweightedLoss;
    type.description = "full weight whatever the residual (for comparison)";
    type.make_loss = [](const double*, int) {
      return std::unique_ptr<ceres::LossFunction>();
    };
    registry->Register(std::move(type));
  }
  for (const auto& [name, run] : Runners()) {
    if (name != id) continue;
    ExperimentResult result;
    result.id = id;
    run(options, *registry, &result);
    return result;
  }
  std::string known;
  for (const std::string& name : ExperimentNames()) {
    known += (known.empty() ? "" : ", ") + name;
  }
  throw PLUMBLINE_ERROR("no experiment is called '" + id + "'", known);
}

}  // namespace plumbline
