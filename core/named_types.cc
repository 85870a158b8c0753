#include <plumbline/core/error.h>
#include <plumbline/core/named_types.h>

#include <algorithm>
#include <cctype>
#include <cstddef>

namespace plumbline {
namespace internal {
namespace {

// Levenshtein's edit distance: insertions, deletions and substitutions.
std::size_t EditDistance(const std::string& a, const std::string& b) {
  std::vector<std::size_t> row(b.size() + 1);
  for (std::size_t j = 0; j <= b.size(); ++j) row[j] = j;
  for (std::size_t i = 1; i <= a.size(); ++i) {
    std::size_t diagonal = row[0];
    row[0] = i;
    for (std::size_t j = 1; j <= b.size(); ++j) {
      const std::size_t substituted = diagonal + (a[i - 1] != b[j - 1] ? 1 : 0);
      diagonal = row[j];
      row[j] = std::min({row[j] + 1, row[j - 1] + 1, substituted});
    }
  }
  return row.back();
}

}  // namespace

void CheckNewName(const std::string& kind, const std::string& name,
                  bool is_taken) {
  const bool has_space =
      std::any_of(name.begin(), name.end(),
                  [](unsigned char c) { return std::isspace(c); });
  if (name.empty() || has_space) {
    throw PLUMBLINE_ERROR("bad " + kind + " name '" + name + "'",
                          "a word without white space");
  }
  if (is_taken) {
    throw PLUMBLINE_ERROR(kind + " '" + name + "' is registered already",
                          "a name that is not taken");
  }
}

void ThrowUnknownName(const std::string& kind, const std::string& name,
                      const std::vector<std::string>& names) {
  std::vector<std::pair<std::size_t, std::string>> nearest_first;
  for (const std::string& known : names) {
    nearest_first.emplace_back(EditDistance(name, known), known);
  }
  std::sort(nearest_first.begin(), nearest_first.end());
  std::string list;
  for (const auto& entry : nearest_first) {
    list += (list.empty() ? "one of " : ", ") + entry.second;
  }
  if (list.empty()) list = "one that is registered, and none is";
  throw PLUMBLINE_ERROR("unknown " + kind + " '" + name + "'", list);
}

}  // namespace internal
}  // namespace plumbline
