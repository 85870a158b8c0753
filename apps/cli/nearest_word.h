#ifndef PLUMBLINE_APPS_CLI_NEAREST_WORD_H_
#define PLUMBLINE_APPS_CLI_NEAREST_WORD_H_

#include <string>
#include <vector>

namespace plumbline {

/// The word that somebody may have meant: the one that fewest letters have to
/// be added, left out, changed or swapped with their neighbor for, at most a
/// third of them, or that the other begins; of several the first. Empty when
/// none is near. Dashes and underscores are one.
std::string NearestWord(const std::string& word,
                        const std::vector<std::string>& words);

}  // namespace plumbline

#endif  // PLUMBLINE_APPS_CLI_NEAREST_WORD_H_
