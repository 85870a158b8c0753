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

std::string Digest(const std::string& bytes) {
  Sha256 sha;
  sha.Update(bytes);
  return sha.HexDigest();
}

bool IsThere(const fs::path& path) {
  std::error_code error;
  return fs::exists(fs::symlink_status(path, error));
}

// The file's lines: magic, digest of all that follows, identity, and then the
// state.
std::string ReadWhole(const fs::path& path) {
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
  std::ostringstream rest;
  rest << file.rdbuf();
  return magic + rest.str();
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
  std::string content = ReadWhole(path_);
  std::istringstream lines(content);
  std::string magic, digest, identity_text;
  std::getline(lines, magic);
  std::getline(lines, digest);
  const std::streamoff covered = lines.tellg();
  std::getline(lines, identity_text);
  const std::streamoff begin = lines.tellg();
  if (covered < 0 || begin < 0 ||
      Digest(content.substr(static_cast<std::size_t>(covered))) != digest) {
    throw Damaged(path_);
  }
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
  digest_ = Digest(content);
  return content.substr(static_cast<std::size_t>(begin));
}

void CheckpointFile::Offer(const std::function<std::string()>& state) {
  const double seconds = since_last_.Seconds();
  if (seconds < std::max(every_, last_cost_ / kLargestShare)) return;
  const Stopwatch watch;
  // Whatever came there in the meantime, it is no matter for this program.
  if (IsThere(path_)) ReadWhole(path_);
  Json identity = Json::object();
  for (const auto& [name, value] : MyIdentity()) identity[name] = value;
  const std::string body =
      identity.dump(-1, ' ', false, Json::error_handler_t::replace) + "\n" +
      state();
  const std::string content =
      std::string(kMagic) + "\n" + Digest(body) + "\n" + body;
  WriteFileAtomically(path_.string(), [&](std::ostream& output) {
    output.write(content.data(), static_cast<std::streamsize>(content.size()));
  });
  digest_ = Digest(content);
  last_cost_ = watch.Seconds();
  since_last_ = Stopwatch();
}

void CheckpointFile::Remove() {
  if (digest_.empty() || Sha256OfFile(path_.string()) != digest_) return;
  std::error_code ignored;
  fs::remove(path_, ignored);
}

}  // namespace plumbline
