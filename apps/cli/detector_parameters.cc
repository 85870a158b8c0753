#include <plumbline/apps/cli/detector_parameters.h>
#include <plumbline/core/error.h>

#include <algorithm>
#include <charconv>
#include <system_error>

namespace plumbline {

std::map<std::string, DetectorParameters> ParseDetectorParameters(
    const std::string& text) {
  std::map<std::string, DetectorParameters> parameters;
  std::size_t begin = 0;
  while (begin < text.size()) {
    const std::size_t end = std::min(text.find(',', begin), text.size());
    const std::string entry = text.substr(begin, end - begin);
    const std::size_t dot = entry.find('.');
    const std::size_t equals = entry.find('=');
    double value = 0.0;
    const char* const last = entry.data() + entry.size();
    if (dot != std::string::npos && equals != std::string::npos &&
        dot < equals) {
      const auto parsed =
          std::from_chars(entry.data() + equals + 1, last, value);
      if (parsed.ec == std::errc() && parsed.ptr == last) {
        parameters[entry.substr(0, dot)]
                  [entry.substr(dot + 1, equals - dot - 1)] = value;
        begin = end + 1;
        continue;
      }
    }
    throw Error("--detector_parameters", 0, "cannot read '" + entry + "'",
                "detector.name=value, as in line_ransac.sigma=0.02");
  }
  return parameters;
}

}  // namespace plumbline
