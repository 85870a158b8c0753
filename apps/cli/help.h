#ifndef PLUMBLINE_APPS_CLI_HELP_H_
#define PLUMBLINE_APPS_CLI_HELP_H_

#include <plumbline/apps/cli/app.h>

#include <string>
#include <vector>

namespace plumbline {

/// What --help prints: the flags (DescribeFlags(), by name) in groups with
/// their ranges and defaults, in 80 columns.
std::string HelpText(const AppInfo& info,
                     const std::vector<FlagDescription>& flags);

/// The same as a manual page of section 1 (roff with the man macros).
std::string ManPage(const AppInfo& info,
                    const std::vector<FlagDescription>& flags);

/// A script for bash that completes the binary's flags, the words that a flag
/// understands, and files.
std::string BashCompletion(const AppInfo& info,
                           const std::vector<FlagDescription>& flags);

}  // namespace plumbline

#endif  // PLUMBLINE_APPS_CLI_HELP_H_
