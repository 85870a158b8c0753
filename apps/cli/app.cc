#include <gflags/gflags.h>
#include <glog/logging.h>
#include <plumbline/apps/cli/app.h>
#include <plumbline/apps/cli/command_line.h>
#include <plumbline/apps/cli/help.h>
#include <plumbline/apps/cli/nearest_word.h>
#include <plumbline/core/error.h>
#include <plumbline/core/number_text.h>
#include <plumbline/core/text_file.h>
#include <plumbline/core/utf8.h>
#include <plumbline/core/version.h>
#include <unistd.h>
#ifdef __GLIBC__
#include <malloc.h>
#include <sys/mman.h>
#endif

#include <algorithm>
#include <cmath>
#include <csignal>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <exception>
#include <iostream>
#include <map>
#include <new>
#include <set>
#include <sstream>
#include <utility>

// gflags defines these and would act on them with exit status 1.
DECLARE_bool(help);
DECLARE_bool(helpshort);
DECLARE_bool(helpfull);
DECLARE_bool(version);

DEFINE_bool(check_flags, false,
            "Only checks the flags: for programs that start this one");
DEFINE_string(help_format, "text",
              "What --help prints: text, man (a manual page) or bash (a "
              "completion script)");
PLUMBLINE_FLAG_CHOICES(help_format, "text", "man", "bash");

namespace plumbline {

namespace {

volatile std::sig_atomic_t interrupted = 0;
// Whether messages go to one.
volatile std::sig_atomic_t has_terminal = 0;
// TellWhole() was called.
bool is_whole = false;

extern "C" void HandleInterrupt(int) { interrupted = 1; }

// Only what is safe within a signal handler.
extern "C" void EndAtInterrupt(int) {
  // On a terminal there may be a progress bar, which goes.
  constexpr char kWords[] = "\r\033[Kinterrupted\n";
  const std::size_t begin = has_terminal != 0 ? 0 : 4;
  [[maybe_unused]] const ssize_t written =
      write(STDERR_FILENO, kWords + begin, sizeof(kWords) - 1 - begin);
  _exit(kExitInterrupted);
}

// What one solve gives back the next one takes: to get it from the system again
// costs more than to fill it. Where memory is managed otherwise, as by a
// sanitizer, that is left as it is.
void KeepMemory() {
#if defined(__GLIBC__) && !defined(__SANITIZE_ADDRESS__) && \
    !defined(__SANITIZE_THREAD__)
  constexpr int kLargestKept = 32 << 20;
  constexpr int kMostKept = 1 << 30;
  mallopt(M_MMAP_THRESHOLD, kLargestKept);
  mallopt(M_TRIM_THRESHOLD, kMostKept);
  // The heap of the main thread comes in large pages where the system has them
  // on request: addresses for it are set aside at once, memory is taken when it
  // is written to.
  constexpr int kSetAside = 512 << 20;
  constexpr int kUsualPad = 128 << 10;
  constexpr std::uintptr_t kLargePage = 2 << 20;
  mallopt(M_TOP_PAD, kSetAside);
  void* const first = std::malloc(kLargestKept / 2);
  mallopt(M_TOP_PAD, kUsualPad);
  const auto end = reinterpret_cast<std::uintptr_t>(sbrk(0));
  const std::uintptr_t begin =
      (reinterpret_cast<std::uintptr_t>(first) + kLargePage - 1) / kLargePage *
      kLargePage;
  if (first != nullptr && begin < end && end - begin <= 2u * kSetAside) {
    madvise(reinterpret_cast<void*>(begin), end - begin, MADV_HUGEPAGE);
  }
  std::free(first);
  // What there is before the first large page is left alone: to come by it page
  // by page takes longer than to come by one large page more.
  constexpr std::uintptr_t kHead = 64;
  const auto place = reinterpret_cast<std::uintptr_t>(first);
  if (first != nullptr && begin > place + kHead) {
    static void* skipped;
    skipped = std::malloc(begin - place - kHead);
    // Else it would be optimized away.
    asm volatile("" : : "r"(skipped) : "memory");
  }
#endif
}

void CatchSignals(bool end_at_once) {
  // A write beyond the limit on the size of files (ulimit -f) then fails as one
  // on a full disk does, in place of ending the process half way.
  std::signal(SIGXFSZ, SIG_IGN);
  has_terminal = isatty(STDERR_FILENO);
  struct sigaction action = {};
  action.sa_handler = end_at_once ? EndAtInterrupt : HandleInterrupt;
  // The second signal finds the default action: the way out of work that does
  // not ask often enough.
  action.sa_flags = SA_RESETHAND | SA_RESTART;
  sigaction(SIGINT, &action, nullptr);
  sigaction(SIGTERM, &action, nullptr);
}

struct Condition {
  double minimum = 0.0;
  double maximum = 0.0;
  /// Not empty: one of these words, and no range.
  std::vector<std::string> choices;
};

// Constructed on first use: conditions register from static initializers.
std::map<std::string, Condition>& Conditions() {
  static auto* conditions = new std::map<std::string, Condition>;
  return *conditions;
}

std::string FormatNumber(double value) {
  char text[32];
  std::snprintf(text, sizeof(text), "%.10g", value);
  return text;
}

std::string Describe(const Condition& condition) {
  if (condition.choices.empty()) {
    return FormatNumber(condition.minimum) + " to " +
           FormatNumber(condition.maximum);
  }
  std::string text;
  for (const std::string& choice : condition.choices) {
    if (!text.empty()) text += ", ";
    text += choice;
  }
  return text;
}

std::string Guess(const std::string& value, const Condition& condition) {
  const std::string nearest = NearestWord(value, condition.choices);
  return nearest.empty() ? "" : " (" + nearest + "?)";
}

bool Holds(const Condition& condition, const std::string& value) {
  if (!condition.choices.empty()) {
    return std::find(condition.choices.begin(), condition.choices.end(),
                     value) != condition.choices.end();
  }
  const double number = std::strtod(value.c_str(), nullptr);
  return std::isfinite(number) && number >= condition.minimum &&
         number <= condition.maximum;
}

std::string Directory(const std::string& path) {
  const std::size_t slash = path.rfind('/');
  return slash == std::string::npos ? "" : path.substr(0, slash);
}

// What does not change of a flag, and where its value is.
struct Flag {
  std::string name;
  std::string type;
  std::string description;
  /// As gflags writes it: 0.3 as 0.29999999999999999.
  std::string default_text;
  std::string default_value;
  const void* value = nullptr;
  /// Not of glog, gflags or Ceres.
  bool is_own = false;
};

std::string ShortestText(double value) {
  std::string text;
  AppendNumber(value, &text);
  return text;
}

// gflags lists all flags as text, in a time that a small graph is solved in:
// it is asked once. Sorted by name.
const std::vector<Flag>& AllFlags() {
  static const auto* const table = [] {
    // The folder apps holds this file and those of the binaries.
    const std::string folder = Directory(Directory(__FILE__)) + "/";
    std::vector<gflags::CommandLineFlagInfo> all;
    gflags::GetAllFlags(&all);
    auto* flags = new std::vector<Flag>;
    flags->reserve(all.size());
    for (gflags::CommandLineFlagInfo& info : all) {
      Flag flag;
      flag.name = std::move(info.name);
      flag.type = std::move(info.type);
      flag.description = std::move(info.description);
      flag.default_text = std::move(info.default_value);
      flag.default_value =
          flag.type == "double"
              ? ShortestText(std::strtod(flag.default_text.c_str(), nullptr))
              : flag.default_text;
      flag.value = info.flag_ptr;
      flag.is_own = info.filename.compare(0, folder.size(), folder) == 0;
      flags->push_back(std::move(flag));
    }
    std::sort(flags->begin(), flags->end(),
              [](const Flag& a, const Flag& b) { return a.name < b.name; });
    return flags;
  }();
  return *table;
}

// The value that a flag has now.
std::string ValueOf(const Flag& flag) {
  if (flag.type == "bool") {
    return *static_cast<const bool*>(flag.value) ? "true" : "false";
  }
  if (flag.type == "double") {
    return ShortestText(*static_cast<const double*>(flag.value));
  }
  if (flag.type == "string") {
    return *static_cast<const std::string*>(flag.value);
  }
  if (flag.type == "int32") {
    return std::to_string(*static_cast<const gflags::int32*>(flag.value));
  }
  if (flag.type == "uint32") {
    return std::to_string(*static_cast<const gflags::uint32*>(flag.value));
  }
  if (flag.type == "int64") {
    return std::to_string(*static_cast<const gflags::int64*>(flag.value));
  }
  return std::to_string(*static_cast<const gflags::uint64*>(flag.value));
}

FlagValue ToFlagValue(const Flag& flag) {
  return {flag.name, ValueOf(flag), flag.default_value, flag.type};
}

[[noreturn]] void ExitWithUsageError(const AppInfo& info,
                                     const std::string& message) {
  std::fprintf(stderr, "%s%s: --help lists the flags\n",
               PrintableLines(message).c_str(), info.name.c_str());
  std::exit(kExitUsage);
}

}  // namespace

namespace internal {

FlagCondition::FlagCondition(const char* name, double minimum, double maximum) {
  Condition condition;
  condition.minimum = minimum;
  condition.maximum = maximum;
  Conditions()[name] = condition;
}

FlagCondition::FlagCondition(const char* name,
                             std::initializer_list<const char*> choices) {
  Condition condition;
  condition.choices.assign(choices.begin(), choices.end());
  Conditions()[name] = condition;
}

}  // namespace internal

std::vector<std::string> CheckFlagValues() {
  std::vector<std::string> problems;
  const std::vector<Flag>& flags = AllFlags();
  for (const auto& [name, condition] : Conditions()) {
    const auto flag = std::lower_bound(
        flags.begin(), flags.end(), name,
        [](const Flag& a, const std::string& b) { return a.name < b; });
    if (flag == flags.end() || flag->name != name) continue;
    const std::string value = ValueOf(*flag);
    if (Holds(condition, value)) continue;
    problems.push_back("--" + name + "=" + value + ": " +
                       (condition.choices.empty()
                            ? "out of range: expected "
                            : "unknown value: expected one of ") +
                       Describe(condition) + Guess(value, condition));
  }
  return problems;
}

std::vector<std::string> ParseFlags(const AppInfo& info, int argc,
                                    char** argv) {
  // As defaults, so that --minloglevel=0 and --log_dir still do what they say.
  gflags::SetCommandLineOptionWithMode("logtostderr", "true",
                                       gflags::SET_FLAGS_DEFAULT);
  gflags::SetCommandLineOptionWithMode("minloglevel", "1",
                                       gflags::SET_FLAGS_DEFAULT);
  gflags::SetUsageMessage(info.summary);
  gflags::SetVersionString(kVersion);
  // gflags keeps pointers to these.
  static std::vector<std::string> words;
  static std::vector<char*> pointers;
  CommandLine command_line =
      ReadCommandLine(std::vector<std::string>(argv + 1, argv + argc));
  if (!command_line.problems.empty()) {
    std::string problems;
    for (const std::string& problem : command_line.problems) {
      problems += problem + "\n";
    }
    ExitWithUsageError(info, problems);
  }
  words = std::move(command_line.arguments);
  words.insert(words.begin(), argv[0]);
  pointers.clear();
  for (std::string& word : words) pointers.push_back(word.data());
  pointers.push_back(nullptr);
  argc = static_cast<int>(words.size());
  argv = pointers.data();
  gflags::ParseCommandLineNonHelpFlags(&argc, &argv, /*remove_flags=*/true);

  if (FLAGS_help || FLAGS_helpshort) {
    for (const std::string& problem : CheckFlagValues()) {
      if (problem.find("--help_format") == 0) {
        ExitWithUsageError(info, problem + "\n");
      }
    }
    const std::vector<FlagDescription> flags = DescribeFlags();
    const std::string text = FLAGS_help_format == "man" ? ManPage(info, flags)
                             : FLAGS_help_format == "bash"
                                 ? BashCompletion(info, flags)
                                 : HelpText(info, flags);
    std::fputs(text.c_str(), stdout);
    std::exit(kExitSuccess);
  }
  if (FLAGS_helpfull) {
    gflags::ShowUsageWithFlags(argv[0]);
    std::exit(kExitSuccess);
  }
  if (FLAGS_version) {
    std::printf("%s %s\n", info.name.c_str(), kVersion);
    std::exit(kExitSuccess);
  }
  gflags::HandleCommandLineHelpFlags();

  std::string problems;
  for (const std::string& problem : CheckFlagValues()) {
    problems += problem + "\n";
  }
  std::vector<std::string> arguments(argv + 1, argv + argc);
  if (!info.takes_arguments) {
    for (const std::string& argument : arguments) {
      problems += PrintableUtf8(argument) +
                  ": unexpected argument: expected flags only, as --name=value"
                  " (a bool as --name or --noname)\n";
    }
  }
  if (!problems.empty()) ExitWithUsageError(info, problems);
  if (FLAGS_check_flags && !info.checks_flags_itself) {
    std::exit(kExitSuccess);
  }

  if (!google::IsGoogleLoggingInitialized()) {
    // glog keeps the pointer.
    static const std::string name = info.name;
    google::InitGoogleLogging(name.c_str());
  }
  CatchSignals(info.interrupts_end_it);
  return arguments;
}

bool OnlyChecksFlags() { return FLAGS_check_flags; }

int RunMain(const std::function<int()>& run) {
  KeepMemory();
  int status = kExitInternal;
  try {
    status = run();
    std::cout.flush();
    if (status == kExitSuccess &&
        (!std::cout || std::fflush(stdout) != 0 || std::ferror(stdout))) {
      throw Error("standard output", 0, "cannot be written", "");
    }
    if (status == kExitSuccess && InterruptRequested()) {
      if (is_whole) {
        std::fprintf(stderr,
                     "interrupted when all was done: what is written is "
                     "whole\n");
      } else {
        std::fprintf(stderr, "interrupted: what was done so far is written\n");
        status = kExitInterrupted;
      }
    }
  } catch (const Interruption&) {
    std::fprintf(stderr, "interrupted\n");
    status = kExitInterrupted;
  } catch (const FlagError& error) {
    std::fprintf(stderr, "%s\n", PrintableLines(error.what()).c_str());
    status = kExitUsage;
  } catch (const Error& error) {
    std::fprintf(stderr, "%s\n", PrintableLines(error.what()).c_str());
    status = kExitInput;
  } catch (const std::bad_alloc&) {
    std::fprintf(stderr, "out of memory\n");
    status = kExitInternal;
  } catch (const std::exception& error) {
    std::fprintf(stderr, "internal error: %s\n",
                 PrintableLines(error.what()).c_str());
    status = kExitInternal;
  } catch (...) {
    // A plug-in may throw anything.
    std::fprintf(stderr, "internal error: an exception of an unknown type\n");
    status = kExitInternal;
  }
  return status;
}

bool InterruptRequested() { return interrupted != 0; }

void TellWhole() { is_whole = true; }

std::string ReadTextInput(const std::string& path, std::size_t limit) {
  std::string text = ReadTextFile(path, limit, InterruptRequested);
  if (InterruptRequested()) throw Interruption();
  return text;
}

std::vector<FlagValue> OwnFlags() {
  std::vector<FlagValue> flags;
  for (const Flag& flag : AllFlags()) {
    if (flag.is_own) flags.push_back(ToFlagValue(flag));
  }
  return flags;
}

std::vector<FlagDescription> DescribeFlags() {
  std::vector<FlagDescription> flags;
  for (const Flag& own : AllFlags()) {
    if (!own.is_own) continue;
    FlagDescription flag;
    flag.name = own.name;
    flag.type = own.type;
    flag.description = own.description;
    flag.default_value =
        own.type == "double"
            ? FormatNumber(std::strtod(own.default_text.c_str(), nullptr))
            : own.default_text;
    const auto condition = Conditions().find(own.name);
    if (condition != Conditions().end()) {
      flag.choices = condition->second.choices;
      if (flag.choices.empty()) flag.range = Describe(condition->second);
    }
    flags.push_back(std::move(flag));
  }
  return flags;
}

std::vector<FlagValue> ChangedFlags() {
  std::vector<FlagValue> flags;
  for (const Flag& flag : AllFlags()) {
    if (flag.is_own && ValueOf(flag) != flag.default_value) {
      flags.push_back(ToFlagValue(flag));
    }
  }
  return flags;
}

}  // namespace plumbline
