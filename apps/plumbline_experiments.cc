// Runs the paper's experiments and writes their tables and figures.

#include <gflags/gflags.h>
#include <plumbline/apps/cli/app.h>
#include <plumbline/apps/cli/detector_parameters.h>
#include <plumbline/apps/cli/progress.h>
#include <plumbline/apps/experiments/experiments.h>
#include <plumbline/core/atomic_file.h>
#include <plumbline/core/error.h>
#include <plumbline/core/registry.h>
#include <plumbline/core/version.h>
#include <plumbline/detectors/builtins.h>

#include <algorithm>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <iostream>
#include <memory>
#include <nlohmann/json.hpp>
#include <string>
#include <system_error>
#include <thread>
#include <vector>

DEFINE_string(experiment, "",
              "S1, S2, S3, S4, S5, S6, R1, R2, B1, B2, N1 or all.");
DEFINE_int32(trials, 20, "Trials of each condition (R1, R2: one).");
PLUMBLINE_FLAG_RANGE(trials, 1, 100000);
DEFINE_uint64(seed, 1, "Seed of the first trial; the next have the next ones.");
DEFINE_int32(num_threads, 0,
             "Trials at a time; 0: all cores. Results do not depend on it.");
PLUMBLINE_FLAG_RANGE(num_threads, 0, 1024);
DEFINE_string(output_dir, "", "Folder for the results; made when missing.");
DEFINE_string(delta_mode, "frozen",
              "Weighting of structure: frozen (the paper), continuous, huber, "
              "cauchy, tukey, geman_mcclure or dcs.");
PLUMBLINE_FLAG_CHOICES(delta_mode, "frozen", "continuous", "huber", "cauchy",
                       "tukey", "geman_mcclure", "dcs");
DEFINE_double(delta_threshold, 0.3,
              "Structure constraints with a smaller delta are broken.");
PLUMBLINE_FLAG_RANGE(delta_threshold, 0, 1);
DEFINE_bool(full_weight_test, true,
            "S1 to S6: judge structure by a solve in which all of it has its "
            "full weight.");
DEFINE_string(hierarchy, plumbline::kSyntheticHierarchy,
              "Detectors by level in the synthetic experiments.");
DEFINE_string(detector_parameters, "",
              "Parameters of detectors other than their defaults, as "
              "detector.name=value, separated by commas.");

namespace plumbline {
namespace {

std::vector<std::string> SelectedExperiments() {
  const std::vector<std::string>& names = ExperimentNames();
  if (FLAGS_experiment == "all") return names;
  const char* const expected =
      "S1, S2, S3, S4, S5, S6, R1, R2, B1, B2, N1 or all";
  if (FLAGS_experiment.empty()) {
    throw FlagError("experiment", "it is missing", expected);
  }
  if (std::find(names.begin(), names.end(), FLAGS_experiment) == names.end()) {
    throw Error("--experiment", 0,
                "there is no experiment '" + FLAGS_experiment + "'", expected);
  }
  return {FLAGS_experiment};
}

using Json = nlohmann::ordered_json;

// The claims and the means of an experiment, for programs.
Json ToJson(const ExperimentResult& result) {
  if (!result.skipped.empty()) return {{"skipped", result.skipped}};
  Json claims = Json::object();
  for (const Claim& claim : result.claims) {
    // "(19 of 20)" at the end differs from run to run.
    const std::size_t end = claim.text.rfind(" (");
    const bool has_count = end != std::string::npos &&
                           claim.text.find(" of ", end) != std::string::npos;
    claims[has_count ? claim.text.substr(0, end) : claim.text] = {
        {"value", claim.measured.value},
        {"low", claim.measured.low},
        {"high", claim.measured.high},
        {"holds", IsKnown(claim) ? Json(claim.holds) : Json(nullptr)},
        {"open", IsKnown(claim) ? Json(claim.is_open) : Json(nullptr)}};
  }
  Json means = Json::object();
  for (const SummaryRow& row : Summarize(result)) {
    means[row.condition][row.quantity] = row.mean.value;
  }
  return {{"interrupted", result.interrupted},
          {"claims", std::move(claims)},
          {"means", std::move(means)}};
}

// Throws Error when the summary.json of a folder is of another program, which
// it may need to know its own files by.
void CheckFolder(const std::string& folder) {
  const std::string path = folder + "/summary.json";
  std::ifstream file(path);
  if (!file) return;
  const Json json = Json::parse(file, nullptr, false);
  const std::vector<std::string>& names = ExperimentNames();
  bool is_ours = json.is_object() && json.contains("seed");
  if (is_ours) {
    for (const auto& item : json.items()) {
      is_ours =
          is_ours && (item.key() == "version" || item.key() == "seed" ||
                      std::count(names.begin(), names.end(), item.key()) > 0);
    }
  }
  if (!is_ours) {
    throw Error(path, 0, "is of no experiments, and would be replaced",
                "another --output_dir");
  }
}

int Run() {
  const std::vector<std::string> selected = SelectedExperiments();
  if (FLAGS_output_dir.empty()) {
    throw FlagError("output_dir", "it is missing", "a folder");
  }
  std::error_code error;
  std::filesystem::create_directories(FLAGS_output_dir, error);
  if (!std::filesystem::is_directory(FLAGS_output_dir)) {
    throw Error("--output_dir", 0, "cannot make '" + FLAGS_output_dir + "'",
                "a folder that can be written to");
  }
  CheckFolder(FLAGS_output_dir);
  Registry registry;
  RegisterBuiltins(&registry);
  ExperimentOptions options;
  options.trials = FLAGS_trials;
  options.seed = FLAGS_seed;
  options.num_threads =
      FLAGS_num_threads > 0
          ? FLAGS_num_threads
          : std::max(1, static_cast<int>(std::thread::hardware_concurrency()));
  options.delta_mode = FLAGS_delta_mode;
  options.delta_threshold = FLAGS_delta_threshold;
  options.full_weight_test = FLAGS_full_weight_test;
  options.hierarchy = FLAGS_hierarchy;
  options.detector_parameters =
      ParseDetectorParameters(FLAGS_detector_parameters);
  if (const char* datasets = std::getenv("PLUMBLINE_DATASETS")) {
    options.datasets = datasets;
  }
  options.stop = [] { return InterruptRequested(); };
  Json summary = {{"version", kVersion}, {"seed", FLAGS_seed}};
  for (const std::string& id : selected) {
    std::unique_ptr<Progress> progress;
    options.progress = [&](int done, int total) {
      if (progress == nullptr) {
        progress = std::make_unique<Progress>(id, "runs", total);
      }
      progress->Update(done);
    };
    const ExperimentResult result = RunExperiment(id, options, &registry);
    progress.reset();
    WriteExperiment(result, FLAGS_output_dir);
    summary[id] = ToJson(result);
    WriteFileAtomically(
        FLAGS_output_dir + "/summary.json", [&](std::ostream& output) {
          output << summary.dump(2, ' ', false, Json::error_handler_t::replace)
                 << '\n';
        });
    Detail("%s: written to %s", id.c_str(), FLAGS_output_dir.c_str());
    std::cout << id << ": " << result.title << '\n';
    if (!result.skipped.empty()) {
      std::cout << "  skipped: " << result.skipped << '\n';
    }
    for (const Claim& claim : result.claims) {
      std::cout << "  " << Verdict(claim) << "  " << claim.text << ": ";
      if (!IsKnown(claim)) {
        std::cout << "no trial is whole, required " << claim.required << '\n';
        continue;
      }
      std::cout << claim.measured.value << " [" << claim.measured.low << ", "
                << claim.measured.high << "], required " << claim.required
                << '\n';
    }
    std::cout.flush();
    if (InterruptRequested()) break;
  }
  return kExitSuccess;
}

}  // namespace
}  // namespace plumbline

int main(int argc, char** argv) {
  plumbline::AppInfo info;
  info.name = "plumbline_experiments";
  info.summary =
      "Runs the experiments of the paper and writes, for each, a CSV of every "
      "trial, a summary against the paper's claim with confidence intervals, "
      "and the figures as SVG, and summary.json with the claims and means of "
      "all. R1 and R2 need the public logs: the environment "
      "variable PLUMBLINE_DATASETS names their folder.";
  info.usage = {
      "--experiment=S1|...|S6|R1|R2|B1|B2|N1|all --output_dir=DIR [flags]"};
  info.example =
      "plumbline_experiments --experiment=S1 --trials=20 --output_dir=results";
  info.groups = {
      {"Experiment", {"experiment", "trials", "seed", "num_threads"}},
      {"Method",
       {"delta_mode", "delta_threshold", "full_weight_test", "hierarchy",
        "detector_parameters"}},
      {"Output", {"output_dir", "quiet", "verbose"}}};
  plumbline::ParseFlags(info, argc, argv);
  return plumbline::RunMain(plumbline::Run);
}
