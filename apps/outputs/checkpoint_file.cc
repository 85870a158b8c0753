#include <plumbline/core/atomic_file.h>
#include <plumbline/core/error.h>
#include <plumbline/core/sha256.h>
#include <plumbline/core/utf8.h>
#include <plumbline/outputs/checkpoint_file.h>

#include <algorithm>
#include <fstream>
#include <nlohmann/json.hpp>
#include <sstream>
#include <system_error>
#include <utility>

namespace plumbline {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::json;

constexpr char kMagic[] = "plumbline checkpoint 1";
// Time is spent on writing at most in this relation.
constexpr double kLargestShare = 0.02;

std::string Digest(std::string_view bytes) {
  Sha256 sha;
  sha.Update(bytes);
  return sha.HexDigest();
}

bool IsThere(const fs::path& path) {
  std::error_code error;
  return fs::exists(fs::symlink_status(path, error));
}

// Opens the file and reads the first of its lines: magic, digest of all that
// follows, identity, and then the state.
std::ifstream Open(const fs::path& path) {
  std::error_code error;
  if (!fs::is_regular_file(fs::symlink_status(path, error))) {
    throw Error(path.string(), 0, "is no checkpoint of plumbline",
                "another --output_dir");
  }
  std::ifstream file(path, std::ios::binary);
  std::string magic;
  // A file that is something else may be long.
  magic.resize(sizeof kMagic);
  file.read(magic.data(), static_cast<std::streamsize>(magic.size()));
  if (!file || magic != std::string(kMagic) + "\n") {
    throw Error(path.string(), 0, "is no checkpoint of plumbline",
                "another --output_dir, or the file in another place");
  }
  return file;
}

// What follows the first line.
std::string ReadRest(const fs::path& path) {
  std::ostringstream rest;
  rest << Open(path).rdbuf();
  return rest.str();
}

// Whether the digest is that of what follows it.
bool IsWhole(const std::string& rest) {
  const std::size_t end = rest.find('\n');
  return end != std::string::npos &&
         Digest(std::string_view(rest).substr(end + 1)) == rest.substr(0, end);
}

Error Damaged(const fs::path& path) {
  return Error(path.string(), 0, "the checkpoint is damaged",
               "the file removed, to start from the beginning");
}

}  // namespace

CheckpointFile::CheckpointFile(fs::path path,
                               std::function<Identity()> identity, double every)
    : path_(std::move(path)),
      make_identity_(std::move(identity)),
      every_(every) {}

const CheckpointFile::Identity& CheckpointFile::MyIdentity() {
  if (!identity_) {
    // A file name may have any bytes, the file's own text may not.
    identity_.emplace();
    for (const auto& [name, value] : make_identity_()) {
      (*identity_)[PrintableUtf8(name)] = PrintableUtf8(value);
    }
  }
  return *identity_;
}

std::optional<std::string> CheckpointFile::Read() {
  if (!IsThere(path_)) return std::nullopt;
  const std::string content = ReadRest(path_);
  std::istringstream lines(content);
  std::string digest, identity_text;
  std::getline(lines, digest);
  std::getline(lines, identity_text);
  const std::streamoff begin = lines.tellg();
  if (begin < 0 || !IsWhole(content)) throw Damaged(path_);
  const Json json = Json::parse(identity_text, nullptr, false);
  if (!json.is_object()) throw Damaged(path_);
  Identity there;
  for (const auto& [name, value] : json.items()) {
    if (value.is_string()) there[name] = value.get<std::string>();
  }
  const auto show = [](const Identity& identity, const std::string& name) {
    const auto found = identity.find(name);
    return found == identity.end() ? std::string("not there")
                                   : "'" + found->second + "'";
  };
  Identity all = there;
  all.insert(MyIdentity().begin(), MyIdentity().end());
  for (const auto& [name, value] : all) {
    const std::string theirs = show(there, name);
    const std::string mine = show(MyIdentity(), name);
    if (theirs == mine) continue;
    throw Error(path_.string(), 0,
                "a run that was not finished left its state here, and " + name +
                    " was " + theirs + " then and is " + mine + " now",
                "the same command as then, another --output_dir, or the file "
                "removed, to start from the beginning");
  }
  digest_ = digest;
  return content.substr(static_cast<std::size_t>(begin));
}

void CheckpointFile::Offer(const std::function<std::string()>& state) {
  const double seconds = since_last_.Seconds();
  if (seconds < std::max(every_, last_cost_ / kLargestShare)) return;
  const Stopwatch watch;
  // Whatever came there in the meantime, it is no matter for this program.
  if (IsThere(path_)) Open(path_);
  Json identity = Json::object();
  for (const auto& [name, value] : MyIdentity()) identity[name] = value;
  const std::string body =
      identity.dump(-1, ' ', false, Json::error_handler_t::replace) + "\n" +
      state();
  const std::string digest = Digest(body);
  WriteFileAtomically(path_.string(), [&](std::ostream& output) {
    output << kMagic << '\n' << digest << '\n';
    output.write(body.data(), static_cast<std::streamsize>(body.size()));
  });
  digest_ = digest;
  last_cost_ = watch.Seconds();
  since_last_ = Stopwatch();
}

void CheckpointFile::Remove() {
  if (digest_.empty()) return;
  try {
    const std::string content = ReadRest(path_);
    if (content.compare(0, digest_.size(), digest_) != 0 || !IsWhole(content)) {
      return;
    }
  } catch (const Error&) {
    // Gone, or no longer this file.
    return;
  }
  std::error_code ignored;
  fs::remove(path_, ignored);
}

}  // namespace plumbline
