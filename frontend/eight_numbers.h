#ifndef PLUMBLINE_FRONTEND_EIGHT_NUMBERS_H_
#define PLUMBLINE_FRONTEND_EIGHT_NUMBERS_H_

#include <plumbline/frontend/input_stream.h>

#include <array>
#include <string>
#include <string_view>

namespace plumbline {

/// Whose squares and products are numbers still.
constexpr double kAbsurdNumber = 1e20;

/// Reads a line of eight finite numbers between blanks, as TUM trajectories and
/// relations files have them. False for an empty line and a comment (#).
/// `first_text` gets the text of the first number. Throws Error with file and
/// line for anything else, also for numbers behind the first that are beyond
/// kAbsurdNumber; `expected` says what the numbers are.
bool ParseEightNumbers(const InputStream& input, std::string_view line,
                       const std::string& expected,
                       std::array<double, 8>* numbers, std::string* first_text);

/// Throws Error when the input's compression turned out to be damaged.
void RequireUndamaged(const InputStream& input);

}  // namespace plumbline

#endif  // PLUMBLINE_FRONTEND_EIGHT_NUMBERS_H_
