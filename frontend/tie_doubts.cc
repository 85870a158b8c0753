#include <plumbline/frontend/part_evidence.h>
#include <plumbline/frontend/tie_doubts.h>

#include <algorithm>
#include <cstddef>
#include <map>
#include <optional>
#include <string>
#include <utility>

namespace plumbline {
namespace {

// Share that contradicts across a tie from which on it is doubted. Of wrong
// ties of the logs it is 0.8 and more, of right ones up to 0.37 mostly, where
// drift is not taken out yet, and 0.64 of one: such are not found elsewhere,
// and stay.
constexpr double kDoubt = 0.4;

// Key scans between two ties.
struct Piece {
  std::vector<std::size_t> keys;
  int part = 0;
  // The tie by which it hangs on an earlier one; none at the start of a part.
  std::optional<FoundTie> tie;
  std::size_t parent = 0;
};

// The pieces of what was seen, in the order of scans.
std::vector<Piece> PiecesOf(const std::vector<SeenKey>& seen,
                            const std::vector<FoundTie>& ties) {
  std::vector<Piece> pieces;
  auto tie = ties.begin();
  int parts = 0;
  for (std::size_t k = 0; k < seen.size(); ++k) {
    const bool begins_part = seen[k].part >= parts;
    bool is_tied = false;
    for (; tie != ties.end() && tie->scan <= seen[k].scan; ++tie) {
      is_tied = true;
    }
    if (begins_part || is_tied) {
      pieces.emplace_back();
      if (is_tied && !begins_part) pieces.back().tie = *std::prev(tie);
    }
    parts = std::max(parts, seen[k].part + 1);
    pieces.back().keys.push_back(k);
    pieces.back().part = seen[k].part;
  }
  for (Piece& piece : pieces) {
    if (!piece.tie) continue;
    while (piece.parent + 1 < pieces.size() &&
           seen[pieces[piece.parent + 1].keys.front()].scan <=
               piece.tie->since) {
      ++piece.parent;
    }
  }
  return pieces;
}

// What hangs together.
class TieTree {
 public:
  explicit TieTree(std::vector<Piece> pieces) : pieces_(std::move(pieces)) {}

  // Compares pieces of the same part with each other.
  void Compare(const TrackSearch& search) {
    for (std::size_t a = 0; a < pieces_.size(); ++a) {
      for (std::size_t b = a + 1; b < pieces_.size(); ++b) {
        if (pieces_[a].part != pieces_[b].part) continue;
        evidence_[{a, b}] =
            CompareParts(search, pieces_[a].keys, pieces_[b].keys);
      }
    }
  }

  // Cuts the most doubtful tie; false when none is.
  bool CutMostDoubtful(const TrackSearch& search) {
    const std::vector<std::size_t> roots = Roots();
    std::size_t worst = pieces_.size();
    double most = kDoubt;
    for (std::size_t p = 0; p < pieces_.size(); ++p) {
      if (!pieces_[p].tie) continue;
      const double doubt = Across(p, roots).Doubt();
      if (doubt > most) {
        most = doubt;
        worst = p;
      }
    }
    if (worst == pieces_.size()) return false;
    search.Trace("DOUBTFUL tie of scan " +
                 std::to_string(pieces_[worst].tie->scan) + ": " +
                 std::to_string(most));
    cut_[worst] = pieces_[worst].tie->loose;
    doubts_[pieces_[worst].tie->loose] = most;
    pieces_[worst].tie.reset();
    return true;
  }

  // By entry among the loose tracks, of the ties that were cut.
  const std::map<int, double>& doubts() const { return doubts_; }

  // Numbers the parts of the key scans anew; returns their numbers before.
  std::vector<int> Number(std::vector<SeenKey>* seen,
                          std::vector<int>* loose_of) const {
    const std::vector<std::size_t> roots = Roots();
    std::vector<int> numbered;
    std::vector<int> before;
    std::map<std::size_t, int> number_of;
    for (std::size_t p = 0; p < pieces_.size(); ++p) {
      const auto [entry, is_new] =
          number_of.emplace(roots[p], static_cast<int>(number_of.size()));
      if (is_new) before.push_back(pieces_[p].part);
      if (is_new && p > 0) {
        const auto cut = cut_.find(p);
        numbered.push_back(
            cut != cut_.end()
                ? cut->second
                : (*loose_of)[static_cast<std::size_t>(pieces_[p].part) - 1]);
      }
      for (const std::size_t k : pieces_[p].keys) {
        (*seen)[k].part = entry->second;
      }
    }
    *loose_of = std::move(numbered);
    return before;
  }

 private:
  // By piece the first one of what it hangs together with.
  std::vector<std::size_t> Roots() const {
    std::vector<std::size_t> roots(pieces_.size());
    for (std::size_t p = 0; p < pieces_.size(); ++p) {
      roots[p] = pieces_[p].tie ? roots[pieces_[p].parent] : p;
    }
    return roots;
  }

  // What pieces that hang on the tie of one say of those that do not.
  PartEvidence Across(std::size_t tied,
                      const std::vector<std::size_t>& roots) const {
    std::vector<bool> is_below(pieces_.size(), false);
    is_below[tied] = true;
    for (std::size_t p = tied + 1; p < pieces_.size(); ++p) {
      is_below[p] = pieces_[p].tie && is_below[pieces_[p].parent];
    }
    PartEvidence sum;
    for (const auto& [pair, evidence] : evidence_) {
      const auto& [a, b] = pair;
      if (is_below[a] != is_below[b] && roots[a] == roots[tied] &&
          roots[b] == roots[tied]) {
        sum.Add(evidence);
      }
    }
    return sum;
  }

  std::vector<Piece> pieces_;
  // By two pieces, the first one first.
  std::map<std::pair<std::size_t, std::size_t>, PartEvidence> evidence_;
  // By piece whose tie was cut, its entry among the loose tracks.
  std::map<std::size_t, int> cut_;
  std::map<int, double> doubts_;
};

}  // namespace

CutTies CutDoubtfulTies(std::vector<FoundTie> ties, TrackSearch* search,
                        std::vector<int>* loose_of) {
  if (ties.empty()) return {};
  std::sort(ties.begin(), ties.end(), [](const FoundTie& a, const FoundTie& b) {
    return a.scan < b.scan;
  });
  TieTree tree(PiecesOf(search->seen(), ties));
  tree.Compare(*search);
  if (search->Stops()) return {};
  while (tree.CutMostDoubtful(*search)) {
  }
  CutTies cut;
  cut.doubts = tree.doubts();
  if (!cut.doubts.empty()) {
    cut.before = tree.Number(&search->seen(), loose_of);
  }
  return cut;
}

}  // namespace plumbline
