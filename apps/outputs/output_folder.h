#ifndef PLUMBLINE_OUTPUTS_OUTPUT_FOLDER_H_
#define PLUMBLINE_OUTPUTS_OUTPUT_FOLDER_H_

#include <plumbline/core/error.h>

#include <filesystem>
#include <functional>
#include <map>
#include <set>
#include <string>
#include <vector>

namespace plumbline {

/// A folder that holds the files of one run, or says that it does not.
///
/// Files are written into a staging folder below it and put in place together,
/// summary.json last. A process that is killed before leaves the earlier run
/// whole; one that is killed in between leaves a summary.json with the keys
/// `partial` (true) and `mixed` (why). What was left behind is cleaned up by
/// the next run.
///
/// Nothing is removed but files that a run is known to have written: the name
/// is one of `own_names`, and the content has the SHA-256 digest that the run
/// recorded in summary.json. The inputs of the present run are neither removed
/// nor replaced.
class OutputFolder {
 public:
  static constexpr char kSummary[] = "summary.json";

  /// Changes of the files that were there.
  struct Changes {
    /// Written by an earlier run and not by this one: removed.
    std::vector<std::string> removed;
    /// Named by an earlier run as its own and left in place, with why:
    /// "map.svg (changed since it was written)".
    std::vector<std::string> kept;
    /// Replaced, although no run had named them.
    std::vector<std::string> replaced_foreign;
    /// The run that was there was whole.
    bool replaced_whole_run = false;
  };

  /// Makes the folder if need be and cleans up what processes that are gone
  /// left there. `own_names`: all names that a run may write; `inputs`: files
  /// that the run reads, some of which may not exist. Throws Error when the
  /// folder cannot be made or written to.
  OutputFolder(std::filesystem::path folder, std::set<std::string> own_names,
               std::vector<std::filesystem::path> inputs);
  /// Removes the staging folder, and folders that the constructor made and that
  /// nothing came into.
  ~OutputFolder();
  OutputFolder(const OutputFolder&) = delete;
  OutputFolder& operator=(const OutputFolder&) = delete;

  /// Throws Error, naming the file, unless all of these and summary.json can be
  /// written: a name must not stand for an input of the run, for a folder, or
  /// for anything else that is no regular file.
  void CheckTargets(const std::set<std::string>& names) const;

  /// Where files are written until Commit; made on the first call. Throws Error
  /// when it cannot be made.
  const std::filesystem::path& staging();

  /// The error of a writer as if it had written to the folder itself: the
  /// staging folder's name means nothing to the reader of the message.
  Error InPlace(const Error& error) const;

  /// Removes leftovers of earlier runs and puts all staged files in place,
  /// among them summary.json. `digests`: SHA-256 of the staged files by name.
  /// Throws Error when a file cannot be put in place; unless the message says
  /// otherwise the folder is then as it was.
  ///
  /// `before_step` (may be null) is called before every change of the folder.
  Changes Commit(const std::map<std::string, std::string>& digests,
                 const std::function<void()>& before_step = nullptr);

  /// Removes what an earlier run wrote, as far as it is as the run left it, its
  /// summary.json last and only if nothing is kept, and the folder where it is
  /// empty then. Does nothing in a folder without such a summary.
  Changes Clear();

  /// Names of leftovers of processes that are gone, removed by the constructor.
  const std::vector<std::string>& cleaned() const { return cleaned_; }

 private:
  struct Manifest;

  static Manifest ReadManifest(const std::filesystem::path& path);
  bool IsInput(const std::filesystem::path& path) const;
  // Files of an earlier run that are to go, unless they are `staged`; those
  // that are not as it left them are told in `changes`.
  std::vector<std::string> Leftovers(const Manifest& old,
                                     const std::set<std::string>& staged,
                                     Changes* changes) const;
  void CleanUp();
  void RemoveStaging();

  std::filesystem::path folder_;
  std::set<std::string> own_names_;
  std::vector<std::filesystem::path> inputs_;
  // Folders that were not there, the innermost first.
  std::vector<std::filesystem::path> made_;
  std::filesystem::path staging_;
  int staging_descriptor_ = -1;
  std::vector<std::string> cleaned_;
};

}  // namespace plumbline

#endif  // PLUMBLINE_OUTPUTS_OUTPUT_FOLDER_H_
