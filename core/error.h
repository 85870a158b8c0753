#ifndef PLUMBLINE_CORE_ERROR_H_
#define PLUMBLINE_CORE_ERROR_H_

#include <stdexcept>
#include <string>

namespace plumbline {

/// The exception of the libraries for wrong input or use. The message reads
/// `file:line: what is wrong: what was expected`.
class Error : public std::runtime_error {
 public:
  /// `file` and `line` name the place in the user's input, or the place in the
  /// source when there is no input to name (see PLUMBLINE_ERROR). A `line` of
  /// 0 is left out of the message, as is an empty `expected`.
  Error(const std::string& file, int line, const std::string& what_is_wrong,
        const std::string& expected)
      : Error(line > 0 ? file + ":" + std::to_string(line) : file,
              expected.empty() ? what_is_wrong
                               : what_is_wrong + ": expected " + expected) {}

  /// This error at another place: at the flag whose value a library found
  /// wrong.
  Error WithPlace(const std::string& place) const {
    return Error(place, what_and_expected_);
  }

 private:
  Error(const std::string& place, const std::string& what_and_expected)
      : std::runtime_error(place + ": " + what_and_expected),
        what_and_expected_(what_and_expected) {}

  std::string what_and_expected_;
};

/// An Error that names the line of source that found it.
#define PLUMBLINE_ERROR(what_is_wrong, expected) \
  ::plumbline::Error(__FILE__, __LINE__, (what_is_wrong), (expected))

}  // namespace plumbline

#endif  // PLUMBLINE_CORE_ERROR_H_
