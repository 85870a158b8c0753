#ifndef PLUMBLINE_APPS_CLI_COMMAND_LINE_H_
#define PLUMBLINE_APPS_CLI_COMMAND_LINE_H_

#include <string>
#include <vector>

namespace plumbline {

/// A command line with its flag files read.
struct CommandLine {
  /// The arguments, the lines of a flag file in the place of --flagfile.
  std::vector<std::string> arguments;
  /// What gflags would pass over or misread, one line each: "my.flags:3: there
  /// is no flag --sed: expected ...". Empty when all is well.
  std::vector<std::string> problems;
};

/// Reads the files that --flagfile names (several separated by commas; relative
/// paths start at the working directory) into the command line, and checks what
/// gflags does not, or says in words of its own: a word that nobody understands
/// and a value that cannot be read are problems, never ignored.
///
/// A flag file has a flag on a line, as --name=value, --name or --noname; lines
/// that are empty or begin with # are comments, and blanks around a line do not
/// count. It may begin with a byte order mark and name further flag files, but
/// not itself. Behind "--" nothing is read or checked.
CommandLine ReadCommandLine(const std::vector<std::string>& arguments);

}  // namespace plumbline

#endif  // PLUMBLINE_APPS_CLI_COMMAND_LINE_H_
