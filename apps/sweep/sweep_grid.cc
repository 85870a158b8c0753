#include <plumbline/apps/sweep/sweep_grid.h>
#include <plumbline/core/error.h>
#include <plumbline/core/number_text.h>

#include <algorithm>
#include <cctype>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <string_view>

namespace plumbline {
namespace {

constexpr double kMostValues = 10000;

[[noreturn]] void Refuse(const std::string& what, const std::string& expected) {
  throw Error("--grid", 0, what, expected);
}

std::string Trim(const std::string& text) {
  const std::size_t begin = text.find_first_not_of(" \t\n");
  if (begin == std::string::npos) return "";
  return text.substr(begin, text.find_last_not_of(" \t\n") - begin + 1);
}

// Pieces between separators that stand outside of quotes and parentheses.
std::vector<std::string> Split(const std::string& text, char separator) {
  std::vector<std::string> pieces(1);
  bool is_quoted = false;
  int depth = 0;
  for (const char c : text) {
    if (c == '"') is_quoted = !is_quoted;
    if (!is_quoted && c == '(') ++depth;
    if (!is_quoted && c == ')') --depth;
    if (c == separator && !is_quoted && depth <= 0) {
      pieces.emplace_back();
    } else {
      pieces.back() += c;
    }
  }
  if (is_quoted) Refuse("a quote does not end in '" + text + "'", "another \"");
  return pieces;
}

// Twelve digits: 0.1 + 2 * 0.1 is written as 0.3.
std::string RoundNumber(double value) {
  char digits[32];
  std::snprintf(digits, sizeof(digits), "%.12g", value);
  return digits;
}

bool ParseFinite(const std::string& text, double* value) {
  return ParseNumber(text, value) && std::isfinite(*value);
}

void AddRange(const std::string& text, double begin, double step, double end,
              std::vector<std::string>* values) {
  const double steps = (end - begin) / step;
  if (step == 0.0 || !(steps >= 0.0)) {
    Refuse("the range '" + text + "' does not get to its end",
           "a:step:b with a step from a towards b");
  }
  if (steps >= kMostValues) {
    Refuse("the range '" + text + "' has too many values", "10000 at most");
  }
  const int last = static_cast<int>(std::floor(steps * (1 + 1e-12) + 1e-9));
  for (int i = 0; i <= last; ++i) {
    values->push_back(RoundNumber(begin + i * step));
  }
}

void AddLogarithmic(const std::string& text, std::vector<std::string>* values) {
  const std::vector<std::string> arguments =
      Split(text.substr(4, text.size() - 5), ',');
  double begin = 0.0;
  double end = 0.0;
  int count = 0;
  if (arguments.size() != 3 || !ParseFinite(Trim(arguments[0]), &begin) ||
      !ParseFinite(Trim(arguments[1]), &end) ||
      !ParseNumber(Trim(arguments[2]), &count) || begin <= 0.0 || end <= 0.0 ||
      count < 2 || count > kMostValues) {
    Refuse("cannot read '" + text + "'",
           "log(a,b,n) with positive a and b and n from 2 to 10000");
  }
  for (int i = 0; i < count; ++i) {
    const double share = static_cast<double>(i) / (count - 1);
    // The ends are as they were given.
    values->push_back(i == 0           ? Trim(arguments[0])
                      : i == count - 1 ? Trim(arguments[1])
                                       : RoundNumber(std::exp(
                                             (1.0 - share) * std::log(begin) +
                                             share * std::log(end))));
  }
}

void AddValues(const std::string& text, std::vector<std::string>* values) {
  if (text.size() >= 2 && text.front() == '"' && text.back() == '"') {
    values->push_back(text.substr(1, text.size() - 2));
    return;
  }
  if (text.compare(0, 4, "log(") == 0 && text.back() == ')') {
    AddLogarithmic(text, values);
    return;
  }
  const std::vector<std::string> parts = Split(text, ':');
  double begin = 0.0;
  double step = 0.0;
  double end = 0.0;
  if (parts.size() == 3 && ParseFinite(parts[0], &begin) &&
      ParseFinite(parts[1], &step) && ParseFinite(parts[2], &end)) {
    AddRange(text, begin, step, end, values);
    return;
  }
  if (parts.size() == 2 && ParseFinite(parts[0], &begin) &&
      ParseFinite(parts[1], &end)) {
    Refuse("the range '" + text + "' has no step",
           "a:step:b, or \"" + text + "\" in quotes for the word");
  }
  values->push_back(text);
}

}  // namespace

std::vector<SweepAxis> ParseGrid(const std::string& text) {
  std::vector<SweepAxis> axes;
  for (const std::string& piece : Split(text, ';')) {
    if (Trim(piece).empty()) continue;
    const std::size_t equals = piece.find('=');
    SweepAxis axis;
    axis.flag = Trim(piece.substr(0, equals));
    const bool is_name =
        !axis.flag.empty() && axis.flag[0] != '-' &&
        std::all_of(axis.flag.begin(), axis.flag.end(), [](unsigned char c) {
          return std::isalnum(c) || c == '_' || c == '-' || c == '.' ||
                 c == ':';
        });
    if (equals == std::string::npos || !is_name) {
      Refuse("cannot read '" + Trim(piece) + "'",
             "flag=values without dashes in front, as in link_radius=5,10,20");
    }
    for (const SweepAxis& other : axes) {
      if (other.flag == axis.flag) {
        Refuse("'" + axis.flag + "' comes twice", "one list of values a flag");
      }
    }
    for (const std::string& entry : Split(piece.substr(equals + 1), ',')) {
      const std::string value = Trim(entry);
      if (value.empty()) {
        Refuse("an empty value of '" + axis.flag + "'",
               "values separated by commas (\"\" for a value that is empty)");
      }
      AddValues(value, &axis.values);
    }
    std::vector<std::string> sorted = axis.values;
    std::sort(sorted.begin(), sorted.end());
    const auto twin = std::adjacent_find(sorted.begin(), sorted.end());
    if (twin != sorted.end()) {
      Refuse("'" + axis.flag + "' has the value '" + *twin + "' twice",
             "different values");
    }
    axes.push_back(std::move(axis));
  }
  return axes;
}

std::vector<std::string> SplitNames(const std::string& text) {
  std::vector<std::string> names(1);
  bool is_quoted = false;
  for (const char c : text) {
    if (c == '"') {
      is_quoted = !is_quoted;
    } else if (c == ',' && !is_quoted) {
      names.emplace_back();
    } else {
      names.back() += c;
    }
  }
  if (is_quoted) {
    throw Error("'" + text + "'", 0, "a quote does not end", "another \"");
  }
  names.erase(std::remove(names.begin(), names.end(), ""), names.end());
  return names;
}

std::vector<std::string> SplitWords(const std::string& text) {
  std::vector<std::string> words;
  std::string word;
  bool is_word = false;
  char quote = '\0';
  for (std::size_t i = 0; i < text.size(); ++i) {
    const char c = text[i];
    if (c == '\\' && quote != '\'' && i + 1 < text.size()) {
      word += text[++i];
      is_word = true;
    } else if (quote != '\0') {
      if (c == quote) {
        quote = '\0';
      } else {
        word += c;
      }
    } else if (c == '"' || c == '\'') {
      quote = c;
      is_word = true;
    } else if (c == ' ' || c == '\t' || c == '\n') {
      if (is_word) words.push_back(word);
      word.clear();
      is_word = false;
    } else {
      word += c;
      is_word = true;
    }
  }
  if (quote != '\0') {
    throw Error("'" + text + "'", 0, "a quote does not end",
                std::string("another ") + quote);
  }
  if (is_word) words.push_back(word);
  return words;
}

std::string QuoteForShell(const std::string& word) {
  const std::string_view safe = "_-./=,:+@%";
  if (!word.empty() &&
      std::all_of(word.begin(), word.end(), [&](unsigned char c) {
        return std::isalnum(c) || safe.find(c) != std::string_view::npos;
      })) {
    return word;
  }
  std::string quoted = "'";
  for (const char c : word) {
    if (c == '\'') {
      quoted += "'\\''";
    } else {
      quoted += c;
    }
  }
  return quoted + "'";
}

}  // namespace plumbline
