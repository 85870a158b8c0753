#include <plumbline/apps/cli/app.h>
#include <plumbline/apps/cli/progress.h>
#include <plumbline/apps/solve/flag_remarks.h>
#include <plumbline/apps/solve_flags.h>

#include <algorithm>

namespace plumbline {
namespace {

// Of `flags` those that were given, "--a, --b"; how many.
int GivenOf(const std::vector<std::string>& flags, std::string* given) {
  int count = 0;
  for (const FlagValue& flag : ChangedFlags()) {
    if (std::count(flags.begin(), flags.end(), flag.name) == 0) continue;
    *given += (count++ > 0 ? ", --" : "--") + flag.name;
  }
  return count;
}

}  // namespace

void RemarkOnFlags(const std::string& name, const char* kind,
                   const char* other_kind,
                   const std::vector<std::string>& of_the_other) {
  std::string flags;
  const int count = GivenOf(of_the_other, &flags);
  if (count == 0) return;
  Remark("%s is a %s: %s %s for %s and %s no effect", name.c_str(), kind,
         flags.c_str(), count > 1 ? "are" : "is", other_kind,
         count > 1 ? "have" : "has");
}

void RemarkOnBagFlags(const std::string& name,
                      const std::vector<const LogReaderType*>& readers) {
  // A reader of a plug-in may know topics as well.
  std::string format;
  for (const LogReaderType* reader : readers) {
    if (reader->name != "carmen" && reader->name != "csv") return;
    format = reader->name == "csv" ? "table of scans" : "CARMEN log";
  }
  if (readers.size() > 1) format = "list of logs without topics";
  RemarkOnFlags(name, format.c_str(), "bags", {"scan_topic", "odometry_topic"});
}

void RemarkOnStructureFlags() {
  if (FLAGS_structure) return;
  std::string flags;
  const int count = GivenOf(StructureFlags(), &flags);
  if (count == 0) return;
  Remark("--structure=false: %s %s of structure and %s no effect",
         flags.c_str(), count > 1 ? "say more" : "says more",
         count > 1 ? "have" : "has");
}

}  // namespace plumbline
