// Feeds arbitrary bytes (plain or compressed) to the CARMEN reader. Whatever
// the input, it either gives a log that keeps its promises or throws Error.
//
// With libFuzzer: carmen_reader_fuzz CORPUS_DIR. Standalone
// (PLUMBLINE_FUZZ_STANDALONE): every file named is run once, then --mutations=N
// seeded mutations of each.

#include <plumbline/core/error.h>
#include <plumbline/frontend/carmen_reader.h>

#include <cmath>
#include <cstdint>
#include <cstdlib>
#include <string>

namespace {

void Require(bool holds) {
  if (!holds) std::abort();
}

void CheckLog(const plumbline::Log& log) {
  Require(!log.scans.empty());
  int line = 0;
  for (const plumbline::Scan& scan : log.scans) {
    Require(scan.line > line);
    line = scan.line;
    Require(std::isfinite(scan.timestamp) && !scan.timestamp_text.empty());
    Require(scan.odometry.allFinite() && scan.laser_offset.allFinite());
    Require(std::isfinite(scan.start_angle) && std::isfinite(scan.angle_step));
    Require(scan.maximum_range > 0.0 && !scan.ranges.empty());
    for (const float range : scan.ranges)
      Require(range >= 0.0f && range < scan.maximum_range);
  }
  for (const plumbline::SkipReport& report : log.skipped) {
    Require(!report.reason.empty() && report.count > 0);
    Require(report.first_lines.size() <= 5);
  }
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data,
                                      std::size_t size) {
  const std::string text(reinterpret_cast<const char*>(data), size);
  plumbline::LooksLikeCarmenLog(text);
  plumbline::LooksLikeG2o(text);
  try {
    plumbline::InputStream input("fuzz", text);
    CheckLog(plumbline::ReadCarmenLog(&input, plumbline::LaserOptions()));
  } catch (const plumbline::Error&) {
    // A refusal is an answer.
  }
  return 0;
}

#ifdef PLUMBLINE_FUZZ_STANDALONE

#include <cstdio>
#include <cstring>
#include <fstream>
#include <iterator>
#include <random>
#include <vector>

namespace {

// One to eight small damages: bytes changed, cut out, repeated, or the end cut
// off.
std::string Mutate(std::string text, std::mt19937_64* random) {
  static constexpr char kAlphabet[] = "0123456789.-+eE naif\n\r\t\0#FLASER";
  const int times = 1 + static_cast<int>((*random)() % 8);
  for (int i = 0; i < times && !text.empty(); ++i) {
    const std::size_t position = (*random)() % text.size();
    const std::size_t length = 1 + (*random)() % 40;
    switch ((*random)() % 5) {
      case 0:
        text[position] = kAlphabet[(*random)() % (sizeof(kAlphabet) - 1)];
        break;
      case 1:
        text[position] = static_cast<char>((*random)() & 0xff);
        break;
      case 2:
        text.erase(position, length);
        break;
      case 3:
        text.insert(position, text.substr(position, length));
        break;
      default:
        if ((*random)() % 4 == 0) text.resize(position);
    }
  }
  return text;
}

void Run(const std::string& text) {
  LLVMFuzzerTestOneInput(reinterpret_cast<const std::uint8_t*>(text.data()),
                         text.size());
}

}  // namespace

int main(int argc, char** argv) {
  long mutations = 0;
  std::mt19937_64 random(1);
  int files = 0;
  for (int i = 1; i < argc; ++i) {
    if (std::strncmp(argv[i], "--mutations=", 12) == 0) {
      mutations = std::strtol(argv[i] + 12, nullptr, 10);
      continue;
    }
    std::ifstream file(argv[i], std::ios::binary);
    if (!file) {
      std::fprintf(stderr, "%s: cannot be opened\n", argv[i]);
      return 1;
    }
    const std::string text((std::istreambuf_iterator<char>(file)),
                           std::istreambuf_iterator<char>());
    Run(text);
    for (long k = 0; k < mutations; ++k) Run(Mutate(text, &random));
    ++files;
  }
  if (files == 0) {
    std::fprintf(stderr, "usage: carmen_reader_fuzz [--mutations=N] FILE...\n");
    return 1;
  }
  std::printf("%d files, %ld mutations of each: no failure\n", files,
              mutations);
  return 0;
}

#endif  // PLUMBLINE_FUZZ_STANDALONE
