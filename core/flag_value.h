#ifndef PLUMBLINE_CORE_FLAG_VALUE_H_
#define PLUMBLINE_CORE_FLAG_VALUE_H_

#include <string>

namespace plumbline {

/// A setting of a program as its command line has it, for what is written about
/// a run.
struct FlagValue {
  std::string name;
  std::string value;
  std::string default_value;
  /// "bool", "int32", "double", "string", ...
  std::string type;
};

}  // namespace plumbline

#endif  // PLUMBLINE_CORE_FLAG_VALUE_H_
