#ifndef PLUMBLINE_CORE_ERROR_H_
#define PLUMBLINE_CORE_ERROR_H_

#include <stdexcept>
#include <string>

namespace plumbline {

/// What the libraries throw when input or use is wrong. The message reads
/// `file:line: what is wrong: what was expected`.
class Error : public std::runtime_error {
 public:
  /// `file` and `line` name the place in the user's input, or the place in the
  /// source when there is no input to name (see PLUMBLINE_ERROR). A `line` of
  /// 0 is left out of the message, as is an empty `expected`.
  Error(const std::string& file, int line, const std::string& what_is_wrong,
        const std::string& expected)
      : std::runtime_error(Format(file, line, what_is_wrong, expected)) {}

 private:
  static std::string Format(const std::string& file, int line,
                            const std::string& what_is_wrong,
                            const std::string& expected) {
    std::string message = file;
    if (line > 0) message += ":" + std::to_string(line);
    message += ": " + what_is_wrong;
    if (!expected.empty()) message += ": expected " + expected;
    return message;
  }
};

/// An Error that names the line of source that found it.
#define PLUMBLINE_ERROR(what_is_wrong, expected) \
  ::plumbline::Error(__FILE__, __LINE__, (what_is_wrong), (expected))

}  // namespace plumbline

#endif  // PLUMBLINE_CORE_ERROR_H_
