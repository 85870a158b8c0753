// What libFuzzer does, for compilers that have none: runs every file named
// once, then mutations of them until --seconds=N have passed, or --mutations=N
// of each. The same --seed=N makes the same mutations. --dictionary=FILE has
// further words, as libFuzzer takes them. With PLUMBLINE_FUZZ_KEEP in the
// environment every input is written to ./crash-input before it is run, so that
// the one that ends the process is there.

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <fstream>
#include <iterator>
#include <random>
#include <string>
#include <utility>
#include <vector>

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data,
                                      std::size_t size);

namespace {

using Clock = std::chrono::steady_clock;

// Numbers and signs at the edges of what readers accept.
const char* const kWords[] = {
    "nan",    "inf",        "-1",          "0",
    "1e400",  "-1e308",     "1e200",       "+0.5",
    "1e-400", "2147483647", "4294967296",  "9223372036854775807",
    "\n",     " ",          "#",           "{",
    "}",      "[",          "]",           "\"",
    ",",      ":",          "\xEF\xBB\xBF"};

// The words of a dictionary, a line each: "word" or name="word", with \\, \"
// and \xAB in it.
std::vector<std::string> ReadDictionary(const std::string& path) {
  std::ifstream file(path);
  if (!file) {
    std::fprintf(stderr, "%s: cannot be opened\n", path.c_str());
    std::exit(1);
  }
  std::vector<std::string> words;
  for (std::string line; std::getline(file, line);) {
    const std::size_t begin = line.find('"');
    const std::size_t end = line.rfind('"');
    if (line[0] == '#' || begin == std::string::npos || end <= begin) continue;
    std::string word;
    for (std::size_t i = begin + 1; i < end; ++i) {
      if (line[i] == '\\' && i + 3 < end && line[i + 1] == 'x') {
        word +=
            static_cast<char>(std::stoi(line.substr(i + 2, 2), nullptr, 16));
        i += 3;
      } else {
        if (line[i] == '\\') ++i;
        word += line[i];
      }
    }
    words.push_back(word);
  }
  return words;
}

std::string Mutate(std::string text, const std::vector<std::string>& corpus,
                   const std::vector<std::string>& words,
                   std::mt19937_64* random) {
  const auto below = [random](std::size_t end) {
    return static_cast<std::size_t>((*random)() % end);
  };
  const int times = 1 + static_cast<int>(below(8));
  for (int i = 0; i < times && !text.empty(); ++i) {
    const std::size_t position = below(text.size());
    const std::size_t length = 1 + below(40);
    switch (below(9)) {
      case 0:
        text[position] = "0123456789.-+eE naif\n\r\t#"[below(24)];
        break;
      case 1:
        text[position] = static_cast<char>(below(256));
        break;
      case 2:
        text.erase(position, length);
        break;
      case 3:
        text.insert(position, text.substr(position, length));
        break;
      case 4: {
        // A word in the place of another.
        const std::size_t end = text.find_first_of(" \n,]}", position);
        text.replace(position, end == std::string::npos ? end : end - position,
                     words[below(words.size())]);
        break;
      }
      case 7:
        text.insert(position, words[below(words.size())]);
        break;
      case 5: {
        // A line once more, elsewhere.
        const std::size_t begin = text.rfind('\n', position) + 1;
        const std::size_t end = text.find('\n', begin);
        const std::string line = text.substr(
            begin, end == std::string::npos ? end : end + 1 - begin);
        text.insert(below(text.size()), line);
        break;
      }
      case 6: {
        const std::string& other = corpus[below(corpus.size())];
        if (!other.empty()) {
          text.insert(position, other.substr(below(other.size()), 5 * length));
        }
        break;
      }
      default:
        if (below(4) == 0) text.resize(position);
    }
  }
  return text;
}

void Run(const std::string& text) {
  // Written beforehand: who crashes can write no more.
  if (std::getenv("PLUMBLINE_FUZZ_KEEP") != nullptr) {
    std::ofstream("crash-input", std::ios::binary) << text;
  }
  LLVMFuzzerTestOneInput(reinterpret_cast<const std::uint8_t*>(text.data()),
                         text.size());
}

bool TakeNumber(const char* argument, const char* flag, long* number) {
  const std::size_t length = std::strlen(flag);
  if (std::strncmp(argument, flag, length) != 0) return false;
  *number = std::strtol(argument + length, nullptr, 10);
  return true;
}

}  // namespace

int main(int argc, char** argv) {
  long mutations = 0, seconds = 0, seed = 1;
  std::vector<std::string> corpus;
  std::vector<std::string> words(std::begin(kWords), std::end(kWords));
  constexpr char kDictionary[] = "--dictionary=";
  for (int i = 1; i < argc; ++i) {
    if (std::strncmp(argv[i], kDictionary, std::strlen(kDictionary)) == 0) {
      for (std::string& word :
           ReadDictionary(argv[i] + std::strlen(kDictionary))) {
        words.push_back(std::move(word));
      }
      continue;
    }
    if (TakeNumber(argv[i], "--mutations=", &mutations) ||
        TakeNumber(argv[i], "--seconds=", &seconds) ||
        TakeNumber(argv[i], "--seed=", &seed)) {
      continue;
    }
    std::ifstream file(argv[i], std::ios::binary);
    if (!file) {
      std::fprintf(stderr, "%s: cannot be opened\n", argv[i]);
      return 1;
    }
    corpus.emplace_back(std::istreambuf_iterator<char>(file),
                        std::istreambuf_iterator<char>());
  }
  if (corpus.empty()) {
    std::fprintf(stderr,
                 "usage: %s [--seconds=N] [--mutations=N] [--seed=N] "
                 "[--dictionary=FILE] FILE...\n",
                 argv[0]);
    return 1;
  }
  std::mt19937_64 random(static_cast<std::uint64_t>(seed));
  long executions = 0;
  for (const std::string& text : corpus) {
    Run(text);
    ++executions;
    for (long k = 0; k < mutations; ++k, ++executions) {
      Run(Mutate(text, corpus, words, &random));
    }
  }
  const Clock::time_point end = Clock::now() + std::chrono::seconds(seconds);
  while (seconds > 0 && Clock::now() < end) {
    Run(Mutate(corpus[static_cast<std::size_t>(executions) % corpus.size()],
               corpus, words, &random));
    ++executions;
  }
  std::printf("%zu files, %ld executions: no failure\n", corpus.size(),
              executions);
  return 0;
}
