#ifndef PLUMBLINE_APPS_EVALUATION_JSON_ENTRY_H_
#define PLUMBLINE_APPS_EVALUATION_JSON_ENTRY_H_

#include <plumbline/frontend/input_stream.h>
#include <plumbline/plan/polygon.h>

#include <Eigen/Core>
#include <cstdint>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

namespace plumbline {

/// Coordinates beyond it are garbage, m.
constexpr double kAbsurdCoordinate = 1e7;

/// A value of a JSON document with the way to it. All functions throw Error
/// that names the file and that way when the value is not what they read.
class JsonEntry {
 public:
  /// The name of the file and the document must outlive the entry; `path` is
  /// empty for the document as a whole.
  JsonEntry(const std::string& file, const nlohmann::json& json,
            std::string path);

  /// A member of an object.
  JsonEntry operator[](const std::string& key) const;
  /// False also for what is no object.
  bool Has(const std::string& key) const;
  bool IsNull() const { return json_.is_null(); }
  /// Of an array.
  std::vector<JsonEntry> Elements() const;
  /// An array of `count` numbers.
  std::vector<double> Numbers(std::size_t count) const;
  double Number() const;
  /// A length or coordinate, m, up to kAbsurdCoordinate.
  double Metres() const;
  Eigen::Vector2d Position() const;
  /// Rings of positions: the shell, then holes; a last position that repeats
  /// the first is left out.
  Polygon ReadPolygon() const;
  std::int64_t Integer() const;
  bool Flag() const;
  std::string Text() const;

  /// Throws the error that this entry is wrong.
  [[noreturn]] void Refuse(const std::string& what,
                           const std::string& expected) const;

 private:
  Ring ReadRing() const;

  const std::string& file_;
  const nlohmann::json& json_;
  std::string path_;
};

/// Reads a document of up to 256 MB. Throws Error with the line of what is no
/// JSON; `expected` says which file was expected.
nlohmann::json ParseJson(InputStream* input, const std::string& expected);

}  // namespace plumbline

#endif  // PLUMBLINE_APPS_EVALUATION_JSON_ENTRY_H_
