#include <gflags/gflags.h>
#include <plumbline/apps/cli/command_line.h>
#include <plumbline/apps/cli/nearest_word.h>
#include <plumbline/core/error.h>
#include <plumbline/core/text_file.h>
#include <plumbline/core/utf8.h>

#include <algorithm>
#include <filesystem>
#include <string_view>

namespace plumbline {
namespace {

namespace fs = std::filesystem;

constexpr std::size_t kLargestFlagFile = std::size_t{1} << 20;
constexpr char kExpectedLine[] =
    "--name=value, --name, --noname or a comment that begins with #";

// A word of somebody's in a message.
std::string Shortened(const std::string& text) {
  constexpr std::size_t kLongest = 60;
  const std::string printable = PrintableUtf8(text.substr(0, kLongest));
  return printable + (text.size() > kLongest ? "..." : "");
}

std::string Shown(const std::string& text) {
  return "'" + Shortened(text) + "'";
}

std::string Trimmed(const std::string& text) {
  constexpr char kBlanks[] = " \t\r\v\f";
  const std::size_t begin = text.find_first_not_of(kBlanks);
  if (begin == std::string::npos) return "";
  return text.substr(begin, text.find_last_not_of(kBlanks) - begin + 1);
}

// What an argument that begins with a dash says.
struct FlagWords {
  std::string name;
  bool has_value = false;
  std::string value;
};

FlagWords SplitFlag(const std::string& argument) {
  FlagWords words;
  const std::size_t begin = argument.compare(0, 2, "--") == 0 ? 2 : 1;
  const std::size_t equals = argument.find('=', begin);
  words.name = argument.substr(begin, equals - begin);
  words.has_value = equals != std::string::npos;
  if (words.has_value) words.value = argument.substr(equals + 1);
  return words;
}

bool IsFlag(const std::string& argument) {
  return argument.size() > 1 && argument[0] == '-' && argument != "--";
}

bool FindFlag(const std::string& name, gflags::CommandLineFlagInfo* info) {
  return gflags::GetCommandLineFlagInfo(name.c_str(), info);
}

// Whether `name` is "no" and the name of a bool.
bool IsNegation(const std::string& name) {
  gflags::CommandLineFlagInfo info;
  return name.compare(0, 2, "no") == 0 && !FindFlag(name, &info) &&
         FindFlag(name.substr(2), &info) && info.type == "bool";
}

bool IsKnown(const std::string& name) {
  gflags::CommandLineFlagInfo info;
  return FindFlag(name, &info) || IsNegation(name);
}

// Values of a flag's type, for people.
std::string ValuesOf(const std::string& type) {
  if (type == "bool") return "true or false";
  if (type == "double") return "a number";
  if (type.compare(0, 4, "uint") == 0) return "a whole number from 0 on";
  return "a whole number";
}

// Whether gflags can read a value of a flag, which it is set to for a try: who
// calls has a FlagSaver. Words it takes as they are, and some of its own are
// more than values.
bool CanRead(const gflags::CommandLineFlagInfo& flag,
             const std::string& value) {
  if (flag.type == "string") return true;
  return !gflags::SetCommandLineOption(flag.name.c_str(), value.c_str())
              .empty();
}

// What the name of a flag that is not known may have been meant for, for
// people: " (--input?)", or nothing. Whoever writes --output may mean --outputs
// as well as --output_dir.
std::string Guess(const std::string& name) {
  std::vector<gflags::CommandLineFlagInfo> flags;
  gflags::GetAllFlags(&flags);
  std::vector<std::string> names;
  for (const gflags::CommandLineFlagInfo& flag : flags) {
    names.push_back(flag.name);
    if (flag.type == "bool") names.push_back("no" + flag.name);
  }
  std::sort(names.begin(), names.end());
  const std::string nearest = NearestWord(name, names);
  if (nearest.empty()) return "";
  const auto longer =
      std::find_if(names.begin(), names.end(), [&](const std::string& other) {
        return other.compare(0, name.size() + 1, name + "_") == 0;
      });
  const std::string or_longer =
      longer == names.end() || *longer == nearest ? "" : " or --" + *longer;
  return " (--" + nearest + or_longer + "?)";
}

// --flagfile takes files; gflags knows it as a flag like any other.
bool NamesFlagFiles(const FlagWords& flag) { return flag.name == "flagfile"; }

class CommandLineReader {
 public:
  CommandLine Read(const std::vector<std::string>& arguments) {
    // gflags' own way to let unknown flags be.
    const bool allows_unknown = std::any_of(
        arguments.begin(), arguments.end(), [](const std::string& argument) {
          return IsFlag(argument) && SplitFlag(argument).name == "undefok";
        });
    for (std::size_t i = 0; i < arguments.size(); ++i) {
      const std::string& argument = arguments[i];
      if (argument == "--") {
        result_.arguments.insert(result_.arguments.end(), arguments.begin() + i,
                                 arguments.end());
        break;
      }
      if (!IsFlag(argument)) {
        result_.arguments.push_back(argument);
        continue;
      }
      FlagWords flag = SplitFlag(argument);
      if (argument == "-h") {
        result_.arguments.push_back("--help");
        continue;
      }
      if (!IsKnown(flag.name) && !allows_unknown) {
        Problem(Shown("--" + flag.name) + ": there is no such flag" +
                Guess(flag.name));
        continue;
      }
      gflags::CommandLineFlagInfo info;
      const bool takes_next = !flag.has_value && i + 1 < arguments.size() &&
                              FindFlag(flag.name, &info) && info.type != "bool";
      if (takes_next) {
        // "--input --output_dir=out": gflags would take the second for the
        // value of the first.
        const std::string& next = arguments[i + 1];
        if (IsFlag(next) && IsKnown(SplitFlag(next).name)) {
          Problem("--" + flag.name + ": has no value: expected --" + flag.name +
                  "=value before " + Shown(next));
          continue;
        }
        flag.value = next;
      }
      if (FindFlag(flag.name, &info)) {
        if (!flag.has_value && !takes_next && info.type != "bool") {
          Problem("--" + flag.name + ": has no value: expected --" + flag.name +
                  "=value");
          continue;
        }
        if ((flag.has_value || takes_next) && !CanRead(info, flag.value)) {
          Problem(Unreadable(info, flag.value));
          if (takes_next) ++i;
          continue;
        }
      }
      CheckNegation("", flag);
      if (NamesFlagFiles(flag) && (flag.has_value || takes_next)) {
        ReadFiles("--flagfile", flag.value);
      } else {
        result_.arguments.push_back(argument);
        if (takes_next) result_.arguments.push_back(arguments[i + 1]);
      }
      if (takes_next) ++i;
    }
    return std::move(result_);
  }

 private:
  void Problem(std::string text) {
    result_.problems.push_back(std::move(text));
  }

  static std::string Unreadable(const gflags::CommandLineFlagInfo& flag,
                                const std::string& value) {
    return "--" + flag.name + "=" + Shortened(value) +
           ": cannot be read: expected " + ValuesOf(flag.type);
  }

  void CheckNegation(const std::string& place, const FlagWords& flag) {
    if (!flag.has_value || !IsNegation(flag.name)) return;
    Problem(place + "--" + flag.name + "=" + flag.value +
            ": 'no' and a value: expected --" + flag.name + " or --" +
            flag.name.substr(2) + "=true or =false");
  }

  // `place` is what named them.
  void ReadFiles(const std::string& place, const std::string& list) {
    std::size_t begin = 0;
    while (begin <= list.size()) {
      std::size_t end = list.find(',', begin);
      if (end == std::string::npos) end = list.size();
      const std::string name = list.substr(begin, end - begin);
      begin = end + 1;
      if (name.empty()) {
        Problem(place + ": no name of a file: expected --flagfile=FILE");
      } else {
        ReadFile(place, name);
      }
    }
  }

  void ReadFile(const std::string& place, const std::string& name) {
    std::error_code error;
    const fs::path canonical = fs::weakly_canonical(name, error);
    if (std::find(open_.begin(), open_.end(), canonical) != open_.end()) {
      Problem(place + ": " + Shown(name) +
              " names itself as a flag file: expected another one");
      return;
    }
    std::string text;
    try {
      text = ReadTextFile(name, kLargestFlagFile);
    } catch (const Error& error) {
      Problem(error.what());
      return;
    }
    open_.push_back(canonical);
    std::size_t begin = 0;
    for (int line = 1; begin < text.size(); ++line) {
      std::size_t end = text.find('\n', begin);
      if (end == std::string::npos) end = text.size();
      const std::size_t problems = result_.problems.size();
      ReadLine(name + ":" + std::to_string(line),
               Trimmed(text.substr(begin, end - begin)));
      begin = end + 1;
      // The first that is wrong in a file is enough: it may be no such file.
      if (result_.problems.size() > problems) break;
    }
    open_.pop_back();
  }

  void ReadLine(const std::string& place, const std::string& line) {
    if (line.empty() || line[0] == '#') return;
    if (!IsFlag(line)) {
      Problem(place + ": " + Shown(line) + " is no flag: expected " +
              kExpectedLine);
      return;
    }
    const FlagWords flag = SplitFlag(line);
    if (!IsKnown(flag.name)) {
      Problem(place + ": there is no flag " + Shown("--" + flag.name) +
              Guess(flag.name) + ": expected " + kExpectedLine);
      return;
    }
    if (NamesFlagFiles(flag)) {
      ReadFiles(place, flag.value);
      return;
    }
    const std::size_t problems = result_.problems.size();
    CheckNegation(place + ": ", flag);
    if (result_.problems.size() > problems) return;
    gflags::CommandLineFlagInfo info;
    if (FindFlag(flag.name, &info)) {
      if (!flag.has_value && info.type != "bool") {
        Problem(place + ": --" + flag.name + " has no value: expected --" +
                flag.name + "=value");
        return;
      }
      if (flag.has_value && !CanRead(info, flag.value)) {
        Problem(place + ": " + Unreadable(info, flag.value));
        return;
      }
    }
    result_.arguments.push_back(line);
  }

  // Values that were set for a try go in the end: one for all of them, since it
  // copies every flag.
  const gflags::FlagSaver saver_;
  CommandLine result_;
  // Flag files that are being read, the outermost first.
  std::vector<fs::path> open_;
};

}  // namespace

CommandLine ReadCommandLine(const std::vector<std::string>& arguments) {
  return CommandLineReader().Read(arguments);
}

}  // namespace plumbline
