#ifndef PLUMBLINE_OUTPUTS_CHECKPOINT_FILE_H_
#define PLUMBLINE_OUTPUTS_CHECKPOINT_FILE_H_

#include <plumbline/core/stopwatch.h>

#include <filesystem>
#include <functional>
#include <map>
#include <optional>
#include <string>

namespace plumbline {

/// The state of a run in the middle of its work, kept in a file until the run
/// has ended, so that one that was killed can be resumed.
///
/// The file says what the state depends on (program, input, flags) and has a
/// digest of its own content. It is replaced whole, and nothing that is not
/// such a file is ever read, replaced or removed.
class CheckpointFile {
 public:
  static constexpr char kName[] = "checkpoint.plumbline";

  /// What the state depends on, by a name that a user understands
  /// ("--seed", "the input").
  using Identity = std::map<std::string, std::string>;

  /// Nothing is read or written yet. `identity` is asked for once, when it is
  /// needed. `every`: shortest time between two states that are written, s.
  CheckpointFile(std::filesystem::path path, std::function<Identity()> identity,
                 double every);

  /// The state that is there; nothing without a file. Throws Error, naming the
  /// first difference, when it is of another program, input or flags, when the
  /// file is damaged, or when it is no checkpoint.
  std::optional<std::string> Read();

  /// Writes `state()` if `every` has passed since the last one, or since this
  /// was made, and writing takes less than 2 % of the time. Throws Error when
  /// it cannot be written, or something else has the file's name.
  void Offer(const std::function<std::string()>& state);

  /// Removes the file if it is as this object has read or written it last.
  void Remove();

 private:
  const Identity& MyIdentity();

  std::filesystem::path path_;
  std::function<Identity()> make_identity_;
  std::optional<Identity> identity_;
  double every_;
  double last_cost_ = 0.0;
  Stopwatch since_last_;
  // Digest of what was read or written last; empty before.
  std::string digest_;
};

}  // namespace plumbline

#endif  // PLUMBLINE_OUTPUTS_CHECKPOINT_FILE_H_
