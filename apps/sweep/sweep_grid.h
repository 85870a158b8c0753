#ifndef PLUMBLINE_APPS_SWEEP_SWEEP_GRID_H_
#define PLUMBLINE_APPS_SWEEP_SWEEP_GRID_H_

#include <string>
#include <vector>

namespace plumbline {

/// A flag and the values that a sweep gives it.
struct SweepAxis {
  /// Without dashes. Or "flag:key", for flags that take a list of keys and
  /// values: all axes of one such flag make one --flag=key=value,key=value.
  std::string flag;
  /// As they are written on the command line; no two are the same.
  std::vector<std::string> values;
};

/// Reads axes, `flag=values` separated by semicolons. Values are separated by
/// commas, each one of these:
///
///   0.3, frozen   itself
///   a:step:b      a, a + step, ... up to b, which is one of them when it lies
///                 on a step; numbers, or else the text is a value itself
///   log(a,b,n)    n positive numbers from a to b, each the same multiple of
///                 the one before
///   "0,45,90"     the text between the quotes, whatever is in it
///
/// Spaces around names and values do not count. Throws Error when a flag has no
/// name or no values, a flag or a value of it comes twice, and for ranges that
/// are not finite, do not get from a to b or have more than 10,000 values.
std::vector<SweepAxis> ParseGrid(const std::string& text);

/// Names separated by commas; "..." is a name that holds commas. Empty ones are
/// passed over. Throws Error for a quote that does not end.
std::vector<std::string> SplitNames(const std::string& text);

/// Words of a command line as a shell cuts it: at spaces; single and double
/// quotes and backslashes keep what they protect together. Nothing is expanded.
/// Throws Error for a quote that does not end.
std::vector<std::string> SplitWords(const std::string& text);

/// A word as a POSIX shell reads it back.
std::string QuoteForShell(const std::string& word);

}  // namespace plumbline

#endif  // PLUMBLINE_APPS_SWEEP_SWEEP_GRID_H_
