// The pages say what the code says: the table of relations is that of the
// headers' comments, and examples are the files that test/consumer builds.
//
// With the environment variable PLUMBLINE_UPDATE_PAGES set, the pages are
// written anew in place of being compared.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <plumbline/core/builtins.h>
#include <plumbline/core/registry.h>

#include <algorithm>
#include <cctype>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <map>
#include <set>
#include <sstream>
#include <string>
#include <vector>

namespace plumbline {
namespace {

namespace fs = std::filesystem;

fs::path Source(const std::string& name) {
  return fs::path(PLUMBLINE_SOURCE_DIR) / name;
}

bool UpdatesPages() { return std::getenv("PLUMBLINE_UPDATE_PAGES") != nullptr; }

std::vector<std::string> ReadLines(const std::string& name) {
  std::ifstream file(Source(name));
  EXPECT_TRUE(file) << name << " cannot be read";
  std::vector<std::string> lines;
  std::string line;
  while (std::getline(file, line)) lines.push_back(line);
  return lines;
}

void WriteLines(const std::string& name,
                const std::vector<std::string>& lines) {
  std::ofstream file(Source(name));
  for (const std::string& line : lines) file << line << '\n';
}

std::string Join(const std::vector<std::string>& lines) {
  std::string text;
  for (const std::string& line : lines) text += line + "\n";
  return text;
}

// "PointLineDistance" is registered as "point_line_distance".
std::string SnakeCase(const std::string& name) {
  std::string snake;
  for (const char c : name) {
    if (std::isupper(static_cast<unsigned char>(c)) && !snake.empty()) {
      snake += '_';
    }
    snake += static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
  }
  return snake;
}

// Names under which a class is registered: its own, but for one that serves
// several of g2o's tags.
std::vector<std::string> RegisteredNames(const std::string& class_name) {
  if (class_name == "PositionPrior") {
    return {"point_prior", "pose_position_prior"};
  }
  return {SnakeCase(class_name)};
}

// The fixed fields of a relation's comment, in the order of the comment.
constexpr const char* kFields[] = {"residual",   "blocks",     "frames", "unit",
                                   "chi-square", "degenerate", "source"};

struct RelationComment {
  std::string class_name;
  std::string header;
  // By field. Lines of a formula, which are indented, are parted by <br>.
  std::map<std::string, std::string> fields;
};

// The text of a comment in a cell of a table.
std::string Cell(const std::string& text) {
  std::string cell;
  for (std::size_t i = 0; i < text.size(); ++i) {
    if (text[i] == '|' || text[i] == '*' || text[i] == '_') cell += '\\';
    cell += text[i];
  }
  return cell;
}

// The relations of a header: classes whose comment has the field "residual".
std::vector<RelationComment> ReadRelations(const std::string& header) {
  // Where the text of a field begins.
  constexpr std::size_t kColumn = 18;
  std::vector<RelationComment> relations;
  RelationComment comment;
  std::vector<std::string> names;
  bool after_formula = false;
  for (const std::string& line : ReadLines(header)) {
    if (line.rfind("///", 0) == 0) {
      if (line.size() > 6 && line.substr(0, 6) == "///   " && line[6] != ' ') {
        const std::size_t colon = line.find(':');
        names.clear();
        std::istringstream list(line.substr(6, colon - 6));
        std::string name;
        while (std::getline(list, name, ',')) {
          name.erase(0, name.find_first_not_of(' '));
          names.push_back(name);
        }
        const std::size_t begin = line.find_first_not_of(' ', colon + 1);
        for (const std::string& field : names) {
          comment.fields[field] =
              begin == std::string::npos ? "" : Cell(line.substr(begin));
        }
        after_formula = false;
      } else if (!names.empty()) {
        const std::size_t begin = line.find_first_not_of(' ', 3);
        if (begin == std::string::npos || begin < 6) {
          names.clear();  // Text below the fields.
          continue;
        }
        const bool is_formula = begin > kColumn;
        for (const std::string& field : names) {
          std::string& text = comment.fields[field];
          if (!text.empty()) {
            text += is_formula || after_formula ? "<br>" : " ";
          }
          text += Cell(line.substr(begin));
        }
        after_formula = is_formula;
      }
      continue;
    }
    if (line.rfind("class ", 0) == 0 && comment.fields.count("residual") > 0) {
      comment.header = header;
      comment.class_name = line.substr(6, line.find(' ', 6) - 6);
      relations.push_back(comment);
    }
    if (line.rfind("template", 0) != 0) {
      comment = RelationComment();
      names.clear();
    }
  }
  return relations;
}

std::vector<RelationComment> RelationsOfTheFactors() {
  std::vector<std::string> headers;
  for (const auto& entry : fs::directory_iterator(Source("factors"))) {
    if (entry.path().extension() == ".h") {
      headers.push_back("factors/" + entry.path().filename().string());
    }
  }
  std::sort(headers.begin(), headers.end());
  std::vector<RelationComment> relations;
  for (const std::string& header : headers) {
    for (RelationComment& relation : ReadRelations(header)) {
      relations.push_back(std::move(relation));
    }
  }
  return relations;
}

std::string Row(const RelationComment& relation, const Registry& registry) {
  const fs::path header(relation.header);
  std::string row =
      "| [" + relation.class_name + "](" + header.filename().string() + ")";
  for (const std::string& name : RegisteredNames(relation.class_name)) {
    const RelationType* type = registry.FindRelation(name);
    row += "<br>`" + name + "`<br>`" +
           (type == nullptr ? std::string() : type->g2o_tag) + "`";
  }
  row += " |";
  for (const char* field : kFields) {
    if (field == std::string("frames")) continue;
    row += " " + relation.fields.at(field) + " |";
  }
  return row;
}

// Compares the lines of a page from a marker to the other with `table` (which
// holds both), or writes it there.
void ExpectTable(const std::string& name, const char* first, const char* last,
                 const std::vector<std::string>& table) {
  std::vector<std::string> page = ReadLines(name);
  const auto begin = std::find(page.begin(), page.end(), first);
  const auto end = std::find(page.begin(), page.end(), last);
  ASSERT_TRUE(begin < end && end != page.end())
      << name << " has no table between " << first << " and " << last;
  const std::vector<std::string> present(begin, end + 1);
  if (UpdatesPages()) {
    std::vector<std::string> updated(page.begin(), begin);
    updated.insert(updated.end(), table.begin(), table.end());
    updated.insert(updated.end(), end + 1, page.end());
    WriteLines(name, updated);
    return;
  }
  const std::set<std::string> has(present.begin(), present.end());
  const std::set<std::string> wants(table.begin(), table.end());
  for (const std::string& row : table) {
    EXPECT_EQ(has.count(row), 1u)
        << name << " lacks, or has otherwise, the row\n"
        << row;
  }
  for (const std::string& row : present) {
    EXPECT_EQ(wants.count(row), 1u)
        << name << " has a row that the code has not:\n"
        << row;
  }
  if (!::testing::Test::HasFailure()) {
    EXPECT_EQ(present, table) << "rows in another order";
  }
  if (::testing::Test::HasFailure()) {
    ADD_FAILURE() << "PLUMBLINE_UPDATE_PAGES=1 core_test "
                     "--gtest_filter='*PageTest*' writes the table";
  }
}

constexpr char kRelationsPage[] = "factors/relations.md";
constexpr char kTableBegin[] = "<!-- relations -->";
constexpr char kTableEnd[] = "<!-- end of relations -->";

// The unit of each row, as the comment says it: "rows 0, 1: m, rad (...)",
// "rows 0 to 3: m (...)", "rows 0, 1: none, row 2: m (...)".
std::vector<std::string> UnitsOf(const std::string& comment, int rows) {
  std::istringstream words(comment.substr(0, comment.find('(')));
  std::vector<int> at;
  std::vector<std::string> units(static_cast<std::size_t>(rows));
  std::size_t next = 0;
  std::string last;
  const auto fill = [&] {
    for (; next < at.size(); ++next) units[at[next]] = last;
    at.clear();
    next = 0;
  };
  for (std::string word; words >> word;) {
    while (word.back() == ',' || word.back() == ':') word.pop_back();
    if (word == "row" || word == "rows") {
      fill();
    } else if (std::isdigit(static_cast<unsigned char>(word[0]))) {
      at.push_back(std::stoi(word));
    } else if (word == "to") {
      words >> word;
      for (int i = at.back() + 1; i <= std::stoi(word); ++i) at.push_back(i);
    } else {
      last = word == "none" ? "" : word;
      if (next < at.size()) units[at[next++]] = last;
    }
  }
  // A unit that is said once is that of all rows that are left.
  fill();
  return units;
}

std::vector<std::string> UnitsOf(const RelationType& type) {
  std::vector<std::string> units;
  for (const Quantity& row : type.rows) units.emplace_back(row.unit);
  return units;
}

class RelationsPageTest : public ::testing::Test {
 protected:
  RelationsPageTest() { RegisterBuiltinRelations(&registry_); }

  Registry registry_;
};

TEST_F(RelationsPageTest, EveryRegisteredRelationIsDescribed) {
  std::set<std::string> described;
  for (const RelationComment& relation : RelationsOfTheFactors()) {
    SCOPED_TRACE(relation.header + ", " + relation.class_name);
    for (const char* field : kFields) {
      EXPECT_EQ(relation.fields.count(field), 1u)
          << "the comment has no field '" << field << "'";
    }
    const RelationType* type = nullptr;
    for (const std::string& name : RegisteredNames(relation.class_name)) {
      described.insert(name);
      type = registry_.FindRelation(name);
      EXPECT_NE(type, nullptr) << "expected it to be registered as " << name;
    }
    if (type == nullptr) continue;
    // "2 degrees of freedom (...)"; or "as PoseSegmentCollinearity".
    const std::string& freedom = relation.fields.at("chi-square");
    if (!std::isdigit(static_cast<unsigned char>(freedom[0]))) continue;
    EXPECT_LE(std::stoi(freedom), type->residual_size) << freedom;
    // "rows 0, 1: m, rad (before whitening)": the last row has the largest
    // number.
    const std::string& unit = relation.fields.at("unit");
    int rows = 0;
    for (const char c : unit.substr(0, unit.find('('))) {
      if (std::isdigit(static_cast<unsigned char>(c))) {
        rows = std::max(rows, c - '0' + 1);
      }
    }
    EXPECT_EQ(rows, type->residual_size) << unit;
    EXPECT_EQ(UnitsOf(unit, rows), UnitsOf(*type)) << unit;
  }
  for (const RelationType* type : registry_.relations()) {
    EXPECT_EQ(described.count(type->name), 1u)
        << type->name << " is registered, but no class of a header in factors/ "
        << "has this name and a comment with the fixed fields";
  }
}

TEST_F(RelationsPageTest, TableIsThatOfTheHeaders) {
  std::vector<std::string> table = {
      kTableBegin,
      "",
      "| class, name, g2o tag | residual | blocks | unit | chi-square | "
      "degenerate | source |",
      "|---|---|---|---|---|---|---|",
  };
  for (const RelationComment& relation : RelationsOfTheFactors()) {
    table.push_back(Row(relation, registry_));
  }
  table.push_back("");
  table.push_back(kTableEnd);

  ExpectTable(kRelationsPage, kTableBegin, kTableEnd, table);
}

TEST_F(RelationsPageTest, HeadersNameEveryFeatureType) {
  const std::string feature = Join(ReadLines("core/feature.h"));
  const std::string builtins = Join(ReadLines("core/builtins.h"));
  for (const FeatureType* type : registry_.features()) {
    EXPECT_NE(feature.find("\n///   " + type->name + " "), std::string::npos)
        << type->name;
    EXPECT_NE(builtins.find(type->name), std::string::npos) << type->name;
  }
}

constexpr char kGraphFilesPage[] = "core/graph_files.md";

class GraphFilesPageTest : public RelationsPageTest {};

TEST_F(GraphFilesPageTest, VerticesAreThoseOfTheRegistry) {
  std::vector<std::string> table = {
      "<!-- vertices -->", "", "| line | feature | units |", "|---|---|---|"};
  for (const FeatureType* type : registry_.features()) {
    std::string fields;
    std::string units;
    for (const Quantity& parameter : type->parameters) {
      fields += " " + std::string(parameter.name);
      units += (units.empty() ? "" : ", ") + std::string(parameter.unit);
    }
    table.push_back("| `" + type->g2o_tag + " id" + fields + "` | " +
                    type->name + ": " + type->description + " | " + units +
                    " |");
    for (const G2oVertexFormat& format : type->other_g2o_formats) {
      // Numbers of another meaning are told of in the text.
      std::string line = format.tag + " id" + (format.read ? " ..." : fields);
      for (const std::string& extra : format.extra_fields) line += " " + extra;
      table.push_back("| `" + line + "` | " + type->name + " | |");
    }
  }
  table.push_back("");
  table.push_back("<!-- end of vertices -->");
  ExpectTable(kGraphFilesPage, "<!-- vertices -->", "<!-- end of vertices -->",
              table);
}

TEST_F(GraphFilesPageTest, EdgesAreThoseOfTheRegistry) {
  std::vector<std::string> table = {
      "<!-- edges -->", "",
      "| tag | ids of | values | relation, what the values are compared with |",
      "|---|---|---|---|"};
  for (const RelationType* type : registry_.relations()) {
    std::string features;
    for (const std::vector<std::string>& fitting : type->feature_types) {
      std::string words;
      for (const std::string& word : fitting) {
        words += (words.empty() ? "" : " or ") + word;
      }
      features += (features.empty() ? "" : ", ") + words;
    }
    const std::string size = std::to_string(type->residual_size);
    table.push_back("| `" + type->g2o_tag + "` | " + features + " | " + size +
                    " | `" + type->name + "`: " + Cell(type->description) +
                    " |");
    for (const G2oEdgeFormat& format : type->other_g2o_formats) {
      table.push_back("| `" + format.tag + "` | | " + size + " | `" +
                      type->name + "`, written otherwise |");
    }
  }
  table.push_back("");
  table.push_back("<!-- end of edges -->");
  ExpectTable(kGraphFilesPage, "<!-- edges -->", "<!-- end of edges -->",
              table);
}

// Lines of a file between two lines that hold the marker "! [name]"; all lines
// when the name is empty.
std::vector<std::string> Snippet(const std::string& file,
                                 const std::string& name) {
  const std::vector<std::string> lines = ReadLines(file);
  if (name.empty()) return lines;
  const std::string marker = "! [" + name + "]";
  std::vector<std::string> snippet;
  int markers = 0;
  for (const std::string& line : lines) {
    if (line.size() >= marker.size() &&
        line.compare(line.size() - marker.size(), marker.size(), marker) == 0) {
      ++markers;
    } else if (markers == 1) {
      snippet.push_back(line);
    }
  }
  EXPECT_EQ(markers, 2) << file << ": lines that end in '" << marker << "'";
  return snippet;
}

// Examples in a page stand below "<!-- FILE [NAME] -->" (or "<!-- FILE -->") as
// a fenced block. Returns what is quoted, "FILE [NAME]".
std::set<std::string> CheckExamples(const std::string& page) {
  const std::vector<std::string> lines = ReadLines(page);
  std::vector<std::string> updated;
  std::set<std::string> quoted;
  for (std::size_t i = 0; i < lines.size(); ++i) {
    updated.push_back(lines[i]);
    if (lines[i].rfind("<!-- test/consumer/", 0) != 0) continue;
    const std::string what = lines[i].substr(5, lines[i].size() - 5 - 4);
    quoted.insert(what);
    const std::size_t bracket = what.find(" [");
    const std::string file = what.substr(0, bracket);
    const std::string name =
        bracket == std::string::npos
            ? ""
            : what.substr(bracket + 2, what.size() - bracket - 3);
    const std::size_t begin = i + 1;
    if (begin >= lines.size() || lines[begin].rfind("```", 0) != 0) {
      ADD_FAILURE() << page << ":" << begin + 1 << ": expected ``` below "
                    << lines[i];
      continue;
    }
    std::size_t end = begin + 1;
    while (end < lines.size() && lines[end] != "```") ++end;
    const std::vector<std::string> present(lines.begin() + begin + 1,
                                           lines.begin() + end);
    const std::vector<std::string> snippet = Snippet(file, name);
    if (!UpdatesPages()) {
      EXPECT_EQ(Join(present), Join(snippet))
          << page << ":" << begin + 1 << " is not what stands in " << what;
    }
    updated.push_back(lines[begin]);
    updated.insert(updated.end(), snippet.begin(), snippet.end());
    updated.push_back("```");
    i = end;
  }
  if (UpdatesPages() && !quoted.empty()) WriteLines(page, updated);
  return quoted;
}

TEST(ExamplesPageTest, PluginsPageQuotesFilesThatAreBuilt) {
  const std::string folder = "test/consumer/plugin/";
  EXPECT_THAT(
      CheckExamples("core/plugins.md"),
      ::testing::IsSupersetOf({folder + "equal_radius.h [relation]",
                               folder + "mine.cc [plugin]",
                               folder + "equal_radius_detector.cc [detector]",
                               folder + "equal_radius_detector.cc [parameters]",
                               folder + "ranges_reader.h [reader]",
                               folder + "columns_writer.h [writer]"}));
  // What the page promises.
  EXPECT_LE(Snippet(folder + "equal_radius.h", "relation").size(), 40u);
}

TEST(ExamplesPageTest, ReadmeQuotesFilesThatAreBuilt) {
  EXPECT_THAT(
      CheckExamples("README.md"),
      ::testing::IsSupersetOf(
          {"test/consumer/bare_problem/CMakeLists.txt [target]",
           "test/consumer/bare_problem/bare_problem.cc [bare problem]",
           "test/consumer/log_to_floor_plan/log_to_floor_plan.cc [log to floor "
           "plan]"}));
}

#ifdef PLUMBLINE_DOXYGEN

TEST(ReferenceTest, DoxygenHasNothingToSay) {
  const fs::path output(PLUMBLINE_DOXYGEN_OUTPUT);
  fs::create_directories(output);
  const std::string command = "cd " + Source("").string() +
                              " && " PLUMBLINE_DOXYGEN " " PLUMBLINE_DOXYFILE
                              " > " +
                              (output / "log.txt").string();
  ASSERT_EQ(std::system(command.c_str()), 0) << command;
  std::ifstream warnings(output / "warnings.txt");
  ASSERT_TRUE(warnings);
  std::string warning;
  while (std::getline(warnings, warning)) {
    ADD_FAILURE() << warning;
  }
  EXPECT_TRUE(
      fs::exists(output / "html/classplumbline_1_1EmOrchestrator.html"));
  // Fields stand line by line, and headers as they are included.
  std::ifstream file(output /
                     "html/classplumbline_1_1PoseSegmentCollinearity.html");
  const std::string page((std::istreambuf_iterator<char>(file)),
                         std::istreambuf_iterator<char>());
  EXPECT_THAT(page, ::testing::HasSubstr(
                        "plumbline/factors/pose_segment_collinearity.h"));
  EXPECT_THAT(page, ::testing::ContainsRegex("with\n +f0 = "));
}

#endif

}  // namespace
}  // namespace plumbline
