#ifndef PLUMBLINE_APPS_CLI_APP_H_
#define PLUMBLINE_APPS_CLI_APP_H_

#include <plumbline/core/error.h>
#include <plumbline/core/flag_value.h>

#include <cstddef>
#include <functional>
#include <initializer_list>
#include <string>
#include <utility>
#include <vector>

namespace plumbline {

/// Exit statuses of every binary.
enum ExitStatus {
  kExitSuccess = 0,
  /// A command line that is wrong by itself: a flag that there is not, a value
  /// that does not parse or is out of its range, a flag that is missing.
  kExitUsage = 1,
  /// Whatever an Error says: wrong input, a flag that only a closer look shows
  /// to be wrong (names, lists of names, flags that do not go together, files
  /// that are not there), output that cannot be written.
  kExitInput = 2,
  /// Any other exception.
  kExitInternal = 3,
  /// The log is of another building than the map that it was to go into.
  kExitElsewhere = 4,
  /// Ctrl-C, with what was done so far written out (128 + SIGINT).
  kExitInterrupted = 130,
};

/// Flags that belong together, for --help.
struct FlagGroup {
  std::string title;
  /// Names without dashes, in the order in which they are shown.
  std::vector<std::string> flags;
};

/// What --help says about a binary.
struct AppInfo {
  /// "plumbline_solve"
  std::string name;
  /// One or two sentences; wrapped to 80 columns.
  std::string summary;
  /// Command lines without the binary's name, shown as given:
  /// "--input=LOG_OR_GRAPH --output_dir=DIR [flags]".
  std::vector<std::string> usage;
  /// A whole command line to start from.
  std::string example;
  /// Flags of ours that no group lists come last, under "Other flags".
  std::vector<FlagGroup> groups;
  /// What exit statuses mean of this binary besides what they mean of all.
  std::vector<std::pair<int, std::string>> statuses;
  /// Arguments that are no flags are refused unless this is true.
  bool takes_arguments = false;
  /// Ctrl-C and SIGTERM end the process at once, with status kExitInterrupted
  /// and the files as they were: of binaries that have nothing to show before
  /// they are done, and so do not ask InterruptRequested().
  bool interrupts_end_it = false;
  /// The binary looks closer at its flags than their ranges and choices do:
  /// with --check_flags it is run, does that, and ends where it would begin its
  /// work (OnlyChecksFlags). Others end in ParseFlags.
  bool checks_flags_itself = false;
};

/// Parses the command line (and --flagfile, command_line.h; --fromenv), starts
/// glog (warnings and worse, on stderr only) and catches Ctrl-C and SIGTERM; a
/// write beyond the limit on the size of files is an error like any other.
/// Returns the arguments that are no flags.
///
/// Ends the process: with status 0 after --help and --version, and after
/// --check_flags unless the binary goes on with that, with kExitUsage
/// and a message on stderr for an unknown flag, a value that does not parse, a
/// value outside of its range (PLUMBLINE_FLAG_RANGE, PLUMBLINE_FLAG_CHOICES)
/// and arguments where none are taken.
std::vector<std::string> ParseFlags(const AppInfo& info, int argc, char** argv);

/// Whether flags are only checked (--check_flags): a binary with
/// AppInfo::checks_flags_itself ends, without having written anything, once it
/// knows that they are good.
bool OnlyChecksFlags();

/// Runs a binary's work and returns the process's exit status: what `run`
/// returns; kExitUsage when it throws a FlagError and kExitInput for any other
/// Error (their messages go to stderr); kExitInternal for any other exception;
/// kExitInterrupted when it succeeded but was cut short by Ctrl-C.
int RunMain(const std::function<int()>& run);

/// Thrown when the user pressed Ctrl-C before there was anything to write:
/// RunMain then returns kExitInterrupted.
struct Interruption {};

/// The content of a small text file that a flag names, as ReadTextFile. Throws
/// Interruption at Ctrl-C while it waits for a pipe.
std::string ReadTextInput(const std::string& path, std::size_t limit);

/// What is wrong with a command line by itself: a flag that is missing, a value
/// that cannot be read or is out of its range. RunMain then returns kExitUsage.
class FlagError : public Error {
 public:
  /// `flag` without dashes.
  FlagError(const std::string& flag, const std::string& what_is_wrong,
            const std::string& expected)
      : Error("--" + flag, 0, what_is_wrong, expected) {}
};

/// Does what the value of a flag says. What a library finds wrong with it is
/// then said of the flag: "--hierarchy: unknown detector ...".
template <typename Function>
auto ForFlag(const std::string& name, const Function& function)
    -> decltype(function()) {
  try {
    return function();
  } catch (const FlagError&) {
    throw;
  } catch (const Error& error) {
    throw error.WithPlace("--" + name);
  }
}

/// True once the user pressed Ctrl-C (or the process got SIGTERM). Long work
/// asks between steps, writes what it has and returns. A second Ctrl-C ends
/// the process at once.
bool InterruptRequested();

/// Says that all work is done: an interrupt that came meanwhile, or comes yet,
/// came too late to cut anything short. RunMain then says so and returns what
/// it would have returned without it.
void TellWhole();

/// What --help says of a flag of this project.
struct FlagDescription {
  std::string name;
  /// "bool", "int32", "double", "string", ...
  std::string type;
  std::string description;
  /// As it is shown; may be empty.
  std::string default_value;
  /// The words that are understood, if these are all.
  std::vector<std::string> choices;
  /// "0 to 1"; empty without a range.
  std::string range;
};

/// All of them, by name.
std::vector<FlagDescription> DescribeFlags();

/// Flags of this project that are linked into the binary, by name.
std::vector<FlagValue> OwnFlags();

/// Of OwnFlags those whose value is not the default.
std::vector<FlagValue> ChangedFlags();

/// What is wrong with the present values of flags that have a range or a list
/// of choices: one line each, empty when all is well. ParseFlags calls it.
std::vector<std::string> CheckFlagValues();

namespace internal {

/// Registers the condition that CheckFlagValues checks.
struct FlagCondition {
  FlagCondition(const char* name, double minimum, double maximum);
  FlagCondition(const char* name, std::initializer_list<const char*> choices);
};

}  // namespace internal

/// Behind a DEFINE_double, DEFINE_int32, ...: the values that make sense, both
/// ends included. Values that are not finite are refused always.
#define PLUMBLINE_FLAG_RANGE(flag, minimum, maximum)                   \
  static const ::plumbline::internal::FlagCondition flag_range_##flag( \
      #flag, (minimum), (maximum))

/// Behind a DEFINE_string: the words that are understood.
#define PLUMBLINE_FLAG_CHOICES(flag, ...)                                \
  static const ::plumbline::internal::FlagCondition flag_choices_##flag( \
      #flag, {__VA_ARGS__})

}  // namespace plumbline

#endif  // PLUMBLINE_APPS_CLI_APP_H_
