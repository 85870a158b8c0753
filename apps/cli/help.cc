#include <plumbline/apps/cli/help.h>
#include <plumbline/core/version.h>

#include <algorithm>
#include <map>
#include <sstream>
#include <utility>
#include <vector>

namespace plumbline {
namespace {

constexpr std::size_t kColumns = 80;

// A word that is wider than a line, in pieces that are not: cut behind the last
// separator that fits.
std::vector<std::string> CutWord(std::string word, std::size_t width) {
  std::vector<std::string> pieces;
  while (word.size() > width) {
    std::size_t cut = word.find_last_of(",/;:=|", width - 1);
    cut = cut == std::string::npos ? width : cut + 1;
    pieces.push_back(word.substr(0, cut));
    word.erase(0, cut);
  }
  pieces.push_back(word);
  return pieces;
}

/// `text` in lines of at most kColumns, each behind `indent` blanks.
std::string Wrap(const std::string& text, std::size_t indent) {
  std::istringstream words(text);
  std::string result;
  std::string line;
  std::string word;
  const std::string margin(indent, ' ');
  while (words >> word) {
    const std::vector<std::string> pieces = CutWord(word, kColumns - indent);
    for (std::size_t i = 0; i < pieces.size(); ++i) {
      // A piece of a word that was cut begins a line of its own.
      const bool fits =
          i == 0 && indent + line.size() + 1 + pieces[i].size() <= kColumns;
      if (!line.empty() && !fits) {
        result += margin + line + "\n";
        line.clear();
      }
      if (!line.empty()) line += ' ';
      line += pieces[i];
    }
  }
  if (!line.empty()) result += margin + line + "\n";
  return result;
}

// A command line in lines of at most kColumns, to be pasted as it is.
std::string WrapCommand(const std::string& command, std::size_t indent) {
  std::istringstream words(command);
  std::vector<std::string> lines;
  std::string word;
  while (words >> word) {
    const std::size_t margin = lines.size() > 1 ? indent + 4 : indent;
    // Room for the backslash.
    if (!lines.empty() &&
        margin + lines.back().size() + 1 + word.size() <= kColumns - 2) {
      lines.back() += " " + word;
    } else {
      lines.push_back(word);
    }
  }
  std::string text;
  for (std::size_t i = 0; i < lines.size(); ++i) {
    text += std::string(i > 0 ? indent + 4 : indent, ' ') + lines[i] +
            (i + 1 < lines.size() ? " \\\n" : "\n");
  }
  return text;
}

// "--name=TEXT", "--[no]name".
std::string Usage(const FlagDescription& flag) {
  if (flag.type == "bool") return "--[no]" + flag.name;
  return "--" + flag.name + (flag.type == "string" ? "=TEXT" : "=NUMBER");
}

// What the flag does, its range or choices, and its default.
std::string Sentence(const FlagDescription& flag) {
  std::string text = flag.description;
  while (!text.empty() && (text.back() == '.' || text.back() == ' ')) {
    text.pop_back();
  }
  std::string facts = flag.range;
  const bool are_said = std::all_of(
      flag.choices.begin(), flag.choices.end(), [&](const std::string& choice) {
        return text.find(choice) != std::string::npos;
      });
  if (!are_said) {
    for (const std::string& choice : flag.choices) {
      facts += (facts.empty() ? "" : ", ") + choice;
    }
  }
  if (!flag.default_value.empty()) {
    facts += (facts.empty() ? "default " : "; default ") + flag.default_value;
  }
  return facts.empty() ? text : text + " (" + facts + ")";
}

struct Group {
  std::string title;
  std::vector<FlagDescription> flags;
};

// In the order of AppInfo::groups, what they leave out after them.
std::vector<Group> Groups(const AppInfo& info,
                          const std::vector<FlagDescription>& flags) {
  std::map<std::string, FlagDescription> left;
  for (const FlagDescription& flag : flags) left[flag.name] = flag;
  // Listed with gflags' own.
  left.erase("help_format");
  left.erase("check_flags");
  std::vector<Group> groups;
  for (const FlagGroup& group : info.groups) {
    Group found;
    found.title = group.title;
    for (const std::string& name : group.flags) {
      const auto flag = left.find(name);
      if (flag == left.end()) continue;
      found.flags.push_back(flag->second);
      left.erase(flag);
    }
    if (!found.flags.empty()) groups.push_back(std::move(found));
  }
  if (!left.empty()) {
    Group others;
    others.title = info.groups.empty() ? "Flags" : "Other flags";
    for (const auto& entry : left) others.flags.push_back(entry.second);
    groups.push_back(std::move(others));
  }
  return groups;
}

struct CommonFlag {
  const char* usage;
  const char* description;
};

constexpr CommonFlag kCommonFlags[] = {
    {"--flagfile=FILE", "Reads flags from a file, one --name=value a line"},
    {"--fromenv=NAMES",
     "Takes the flags listed from environment variables FLAGS_name"},
    {"-h, --help, --version",
     "Print this, and the version. --helpfull shows the flags of the "
     "libraries, too"},
    {"--help_format=TEXT",
     "What --help prints: text, man (a manual page) or bash (a completion "
     "script) (default text)"},
    {"--[no]check_flags",
     "Only checks the flags, and ends with status 0 where they are good: for "
     "programs that start this one"}};

// What an exit status means, the lowest first.
std::map<int, std::string> Statuses(const AppInfo& info) {
  std::map<int, std::string> statuses = {
      {kExitSuccess, "Success"},
      {kExitUsage,
       "A command line that is wrong by itself: a flag that there is not, a "
       "value that cannot be read or is out of its range, a flag that is "
       "missing"},
      {kExitInput,
       "Wrong input; a flag that only a closer look shows to be wrong (names, "
       "lists of names, flags that do not go together, files that are not "
       "there); or "
       "output that cannot be written"},
      {kExitInternal, "Any other failure, such as a lack of memory"},
      {kExitInterrupted,
       "Interrupted by Ctrl-C or SIGTERM; what was done so far is written"}};
  if (info.interrupts_end_it) {
    statuses[kExitInterrupted] = "Interrupted by Ctrl-C or SIGTERM";
  }
  for (const auto& [status, meaning] : info.statuses) {
    std::string& text = statuses[status];
    text += (text.empty() ? "" : "; ") + meaning;
  }
  return statuses;
}

// Roff takes a backslash, a hyphen (from which a minus must be told) and a dot
// or quote at the beginning of a line for its own.
std::string Roff(const std::string& text) {
  std::string escaped;
  for (const char c : text) {
    if (c == '\\') {
      escaped += "\\e";
    } else if (c == '-') {
      escaped += "\\-";
    } else if (c == '\'') {
      escaped += "\\(aq";
    } else if (c == '`') {
      escaped += "\\(ga";
    } else {
      escaped += c;
    }
  }
  if (!escaped.empty() && escaped[0] == '.') escaped = "\\&" + escaped;
  return escaped;
}

std::string Upper(std::string text) {
  std::transform(text.begin(), text.end(), text.begin(), [](unsigned char c) {
    return static_cast<char>(c >= 'a' && c <= 'z' ? c - 'a' + 'A' : c);
  });
  return text;
}

std::string FirstSentence(const std::string& text) {
  std::size_t end = text.find_first_of(".:;");
  // The point in a file's name ends nothing.
  while (end != std::string::npos && end + 1 < text.size() &&
         text[end + 1] != ' ') {
    end = text.find_first_of(".:;", end + 1);
  }
  std::string first = text.substr(0, end);
  if (!first.empty() && first[0] >= 'A' && first[0] <= 'Z') {
    first[0] = static_cast<char>(first[0] - 'A' + 'a');
  }
  return first;
}

}  // namespace

std::string HelpText(const AppInfo& info,
                     const std::vector<FlagDescription>& flags) {
  std::string text = Wrap(info.name + ": " + info.summary, 0) + "\n";
  for (const std::string& usage : info.usage) {
    text += WrapCommand(info.name + " " + usage, 2);
  }
  if (!info.example.empty()) {
    text += "\nExample:\n" + WrapCommand(info.example, 2);
  }
  const auto add = [&text](const std::string& usage,
                           const std::string& sentence) {
    text += "  " + usage + "\n" + Wrap(sentence, 6);
  };
  for (const Group& group : Groups(info, flags)) {
    text += "\n" + group.title + ":\n";
    for (const FlagDescription& flag : group.flags) {
      add(Usage(flag), Sentence(flag));
    }
  }
  text += "\nCommon flags:\n";
  for (const CommonFlag& flag : kCommonFlags) add(flag.usage, flag.description);
  text += "\nExit status:\n";
  for (const auto& [status, meaning] : Statuses(info)) {
    add(std::to_string(status), meaning);
  }
  return text;
}

std::string ManPage(const AppInfo& info,
                    const std::vector<FlagDescription>& flags) {
  std::string text = ".TH " + Upper(info.name) + " 1 \"\" \"plumbline " +
                     std::string(kVersion) + "\" \"plumbline\"\n";
  // Long values cannot be broken: lines around them are not stretched.
  text += ".ad l\n.SH NAME\n" + Roff(info.name) + " \\- " +
          Roff(FirstSentence(info.summary)) + "\n";
  text += ".SH SYNOPSIS\n";
  for (std::size_t i = 0; i < info.usage.size(); ++i) {
    if (i > 0) text += ".br\n";
    text += ".B " + Roff(info.name) + "\n" + Roff(info.usage[i]) + "\n";
  }
  text += ".SH DESCRIPTION\n" + Roff(info.summary) + "\n";
  text += ".SH OPTIONS\n";
  const auto add = [&text](const std::string& usage,
                           const std::string& sentence) {
    text += ".TP\n.B " + Roff(usage) + "\n" + Roff(sentence) + "\n";
  };
  for (const Group& group : Groups(info, flags)) {
    text += ".SS " + Roff(group.title) + "\n";
    for (const FlagDescription& flag : group.flags) {
      add(Usage(flag), Sentence(flag));
    }
  }
  text += ".SS Common flags\n";
  for (const CommonFlag& flag : kCommonFlags) add(flag.usage, flag.description);
  text += ".SH EXIT STATUS\n";
  for (const auto& [status, meaning] : Statuses(info)) {
    add(std::to_string(status), meaning);
  }
  if (!info.example.empty()) {
    // As it would be typed: the lines of the help without their indent.
    text += ".SH EXAMPLE\n.nf\n";
    std::istringstream lines(WrapCommand(info.example, 0));
    std::string line;
    while (std::getline(lines, line)) text += Roff(line) + "\n";
    text += ".fi\n";
  }
  return text;
}

std::string BashCompletion(const AppInfo& info,
                           const std::vector<FlagDescription>& own_flags) {
  std::string names;
  std::string choices;
  std::string booleans;
  std::string numbers;
  std::vector<FlagDescription> flags = own_flags;
  for (const char* name : {"flagfile", "fromenv"}) {
    FlagDescription flag;
    flag.name = name;
    flag.type = "string";
    flags.push_back(flag);
  }
  for (const FlagDescription& flag : flags) {
    const std::string option = "--" + flag.name;
    if (flag.type == "bool") {
      names += " " + option + " --no" + flag.name;
      booleans += (booleans.empty() ? "" : "|") + option;
      continue;
    }
    names += " " + option + "=";
    if (!flag.choices.empty()) {
      std::string words;
      for (const std::string& choice : flag.choices) words += " " + choice;
      choices += "    " + option + ") values='" + words.substr(1) + "' ;;\n";
    } else if (flag.type != "string") {
      numbers += (numbers.empty() ? "" : "|") + option;
    }
  }
  names += " --help --version";

  const std::string function = "_" + info.name;
  std::string text =
      "# Completion of " + info.name + " for bash.\n" + function + "() {\n";
  text +=
      "  local word=${COMP_WORDS[COMP_CWORD]} flag='' values=''\n"
      "  # Bash cuts --flag=value into three words.\n"
      "  if [[ $word == = ]]; then\n"
      "    flag=${COMP_WORDS[COMP_CWORD - 1]} word=''\n"
      "  elif ((COMP_CWORD > 1)) && [[ ${COMP_WORDS[COMP_CWORD - 1]} == = ]]; "
      "then\n"
      "    flag=${COMP_WORDS[COMP_CWORD - 2]}\n"
      "  fi\n"
      "  COMPREPLY=()\n"
      "  case $flag in\n"
      "    '')\n"
      "      mapfile -t COMPREPLY < <(compgen -W '";
  text += names.substr(1);
  text +=
      "' -- \"$word\")\n"
      "      if ((${#COMPREPLY[@]} == 1)) && [[ ${COMPREPLY[0]} == *= ]]; "
      "then\n"
      "        compopt -o nospace 2>/dev/null\n"
      "      fi\n"
      "      return ;;\n" +
      choices;
  if (!booleans.empty()) {
    text += "    " + booleans + ") values='true false' ;;\n";
  }
  if (!numbers.empty()) text += "    " + numbers + ") return ;;\n";
  text +=
      "  esac\n"
      "  if [[ $values ]]; then\n"
      "    mapfile -t COMPREPLY < <(compgen -W \"$values\" -- \"$word\")\n"
      "  else\n"
      "    mapfile -t COMPREPLY < <(compgen -f -- \"$word\")\n"
      "    compopt -o filenames 2>/dev/null\n"
      "  fi\n"
      "}\n"
      "complete -F " +
      function + " " + info.name + "\n";
  return text;
}

}  // namespace plumbline
