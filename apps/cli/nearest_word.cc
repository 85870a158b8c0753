#include <plumbline/apps/cli/nearest_word.h>

#include <algorithm>
#include <cctype>
#include <cstddef>

namespace plumbline {
namespace {

constexpr std::size_t kLongest = 100;
// Of a word that is the beginning of one.
constexpr std::size_t kShortestBeginning = 3;

std::string Plain(const std::string& word) {
  std::string plain = word.substr(0, kLongest);
  for (char& c : plain) {
    c = c == '-'
            ? '_'
            : static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
  }
  return plain;
}

// Damerau and Levenshtein, each letter moved at most once.
std::size_t Distance(const std::string& a, const std::string& b) {
  std::vector<std::vector<std::size_t>> cost(
      a.size() + 1, std::vector<std::size_t>(b.size() + 1));
  for (std::size_t i = 0; i <= a.size(); ++i) {
    for (std::size_t k = 0; k <= b.size(); ++k) {
      if (i == 0 || k == 0) {
        cost[i][k] = i + k;
        continue;
      }
      cost[i][k] = std::min({cost[i - 1][k] + 1, cost[i][k - 1] + 1,
                             cost[i - 1][k - 1] + (a[i - 1] != b[k - 1])});
      if (i > 1 && k > 1 && a[i - 1] == b[k - 2] && a[i - 2] == b[k - 1]) {
        cost[i][k] = std::min(cost[i][k], cost[i - 2][k - 2] + 1);
      }
    }
  }
  return cost[a.size()][b.size()];
}

}  // namespace

std::string NearestWord(const std::string& word,
                        const std::vector<std::string>& words) {
  const std::string plain = Plain(word);
  std::string nearest;
  std::size_t least = plain.size() / 3 + 1;
  for (const std::string& other : words) {
    const std::size_t distance = Distance(plain, Plain(other));
    if (distance < least) {
      least = distance;
      nearest = other;
    }
  }
  if (!nearest.empty() || plain.size() < kShortestBeginning) return nearest;
  for (const std::string& other : words) {
    if (Plain(other).compare(0, plain.size(), plain) == 0) return other;
  }
  return "";
}

}  // namespace plumbline
