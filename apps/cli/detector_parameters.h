#ifndef PLUMBLINE_APPS_CLI_DETECTOR_PARAMETERS_H_
#define PLUMBLINE_APPS_CLI_DETECTOR_PARAMETERS_H_

#include <plumbline/core/registry.h>

#include <map>
#include <string>

namespace plumbline {

/// Parameters by detector from "detector.name=value,...", as
/// --detector_parameters has them. Throws Error for text that does not read so.
std::map<std::string, DetectorParameters> ParseDetectorParameters(
    const std::string& text);

}  // namespace plumbline

#endif  // PLUMBLINE_APPS_CLI_DETECTOR_PARAMETERS_H_
