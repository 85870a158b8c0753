#include <plumbline/core/number_text.h>
#include <plumbline/frontend/foreign_format.h>

#include <cstddef>

namespace plumbline {
namespace {

struct Signature {
  std::size_t offset;
  std::string_view bytes;
  const char* name;
};

using namespace std::string_view_literals;

// Specific ones before those that share their first bytes.
constexpr Signature kSignatures[] = {
    {0, "\xdb\x01\xf5\x5b\x7b\x1f\x1d\x7b"sv,
     "a Cartographer state (pbstream)"},
    {0, "# .PCD"sv, "a PCD point cloud"},
    {0, "VERSION .7"sv, "a PCD point cloud"},
    {0, "ply\n"sv, "a PLY point cloud"},
    {0, "ply\r\n"sv, "a PLY point cloud"},
    {0, "LASF"sv, "a LAS point cloud"},
    {0, "\x89HDF\r\n"sv, "an HDF5 file"},
    {0, "\x93NUMPY"sv, "a NumPy array"},
    {0, "\xd4\xc3\xb2\xa1"sv, "a network capture (pcap)"},
    {0, "\xa1\xb2\xc3\xd4"sv, "a network capture (pcap)"},
    {0, "\x4d\x3c\xb2\xa1"sv, "a network capture (pcap)"},
    {0, "\x0a\x0d\x0d\x0a"sv, "a network capture (pcapng)"},
    {0, "%PDF-"sv, "a PDF document"},
    {0, "\x89PNG\r\n"sv, "a PNG picture"},
    {0, "\xff\xd8\xff"sv, "a JPEG picture"},
    {0, "GIF8"sv, "a GIF picture"},
    {0, "P5\n"sv, "a PGM picture (a grid?)"},
    {0, "P2\n"sv, "a PGM picture (a grid?)"},
    {0, "RIFF"sv, "a film or a sound (RIFF)"},
    {4, "ftyp"sv, "a film (MP4)"},
    {257, "ustar"sv, "a tar archive"},
    {0, "PK\x03\x04"sv, "a zip archive"},
    {0, "7z\xbc\xaf\x27\x1c"sv, "a 7z archive"},
    {0, "Rar!"sv, "a RAR archive"},
    {0,
     "\x7f"
     "ELF"sv,
     "a program (ELF)"},
    {0, "MZ\x90"sv, "a program (Windows)"},
};

struct Ending {
  std::string_view ending;
  const char* expected;
};

// What files begin with whose names end so.
constexpr Ending kEndings[] = {
    {".bag", "a ROS 1 bag, which begins with '#ROSBAG V2.0'"},
    {".mcap", "an MCAP file, which begins with the bytes 0x89 MCAP0"},
    {".db3", "a ROS 2 bag's database, which begins with 'SQLite format 3'"},
    {".csv",
     "a line that names the columns, among them time and r0, then a line per "
     "scan"},
    {".g2o", "a graph (g2o) with lines such as VERTEX_SE2 and EDGE_SE2"},
};

constexpr std::string_view kPackings[] = {".gz",   ".bz2", ".xz", ".zst",
                                          ".zstd", ".lz4", ".zip"};

constexpr char kBlanks[] = " \t\r\n";

// Numbers of the first line that is neither empty nor a comment; 0 when there
// is something else in it, or it does not end within the prefix.
int NumbersOfFirstLine(std::string_view text) {
  while (true) {
    const std::size_t end = text.find('\n');
    if (end == std::string_view::npos) return 0;
    std::string_view line = text.substr(0, end);
    text.remove_prefix(end + 1);
    int count = 0;
    while (true) {
      const std::size_t begin = line.find_first_not_of(kBlanks);
      if (begin == std::string_view::npos) break;
      line.remove_prefix(begin);
      if (count == 0 && line.front() == '#') break;
      const std::string_view word = line.substr(0, line.find_first_of(kBlanks));
      double number;
      if (!ParseNumber(word, &number)) return 0;
      line.remove_prefix(word.size());
      ++count;
    }
    if (count > 0) return count;
  }
}

bool BeginsWith(std::string_view text, std::string_view begin) {
  return text.substr(0, begin.size()) == begin;
}

// Takes `end` off; whether it was there.
bool TakeEnd(std::string_view end, std::string_view* text) {
  if (text->size() < end.size() ||
      text->substr(text->size() - end.size()) != end) {
    return false;
  }
  text->remove_suffix(end.size());
  return true;
}

}  // namespace

std::string ExpectedInFileOf(const std::string& name) {
  std::string_view unpacked = name;
  for (const std::string_view packing : kPackings) {
    if (TakeEnd(packing, &unpacked)) break;
  }
  for (const Ending& known : kEndings) {
    if (TakeEnd(known.ending, &unpacked)) return known.expected;
  }
  return "a robot's log (CARMEN, CSV, or a ROS 1 or ROS 2 bag) or a graph "
         "(g2o)";
}

std::string ForeignFormat(std::string_view prefix) {
  for (const Signature& signature : kSignatures) {
    if (prefix.size() > signature.offset &&
        BeginsWith(prefix.substr(signature.offset), signature.bytes)) {
      return signature.name;
    }
  }
  const std::size_t begin = prefix.find_first_not_of(kBlanks);
  if (begin == std::string_view::npos) return "";
  const std::string_view text = prefix.substr(begin);
  if (BeginsWith(text, "{\"") || BeginsWith(text, "{\n") ||
      BeginsWith(text, "{ ") || BeginsWith(text, "[{")) {
    return "JSON";
  }
  if (BeginsWith(text, "<?xml") || BeginsWith(text, "<svg")) return "XML";
  if (BeginsWith(text, "<!DOCTYPE") || BeginsWith(text, "<html")) {
    return "a web page (HTML)";
  }
  if (BeginsWith(text, "image:")) return "the YAML of a ROS map";
  if (BeginsWith(text, "rosbag2_bagfile_information")) {
    return "the metadata of a ROS 2 bag (give its folder)";
  }
  switch (NumbersOfFirstLine(prefix)) {
    case 8:
      return "a trajectory (TUM) or a relations file";
    case 12:
      return "a trajectory (KITTI)";
    default:
      return "";
  }
}

}  // namespace plumbline
