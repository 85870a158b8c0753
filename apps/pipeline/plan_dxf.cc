#include <plumbline/core/error.h>
#include <plumbline/core/number_text.h>
#include <plumbline/core/utf8.h>
#include <plumbline/pipeline/plan_dxf.h>

#include <algorithm>
#include <cctype>
#include <cmath>
#include <map>
#include <string_view>

namespace plumbline {
namespace {

constexpr double kLeastLength = 0.3;
constexpr std::size_t kMostLines = 20000;
constexpr double kAbsurdCoordinate = 1e7;
constexpr int kShownLayers = 20;
// A plane is the floor's whose normal is off by this, rad.
constexpr double kMostTilt = 1e-6;

// A foot of surveys in the United States, m.
constexpr double kSurveyFoot = 1200.0 / 3937.0;

// $INSUNITS in metres; 0 for what no building is drawn in.
double Unit(int code) {
  switch (code) {
    case 0:  // none
    case 6:
      return 1.0;
    case 1:  // inch
      return 0.0254;
    case 2:  // foot
      return 0.3048;
    case 4:  // millimetre
      return 1e-3;
    case 5:  // centimetre
      return 1e-2;
    case 7:  // kilometre
      return 1e3;
    case 10:  // yard
      return 0.9144;
    case 12:  // nanometre
      return 1e-9;
    case 13:  // micrometre
      return 1e-6;
    case 14:  // decimetre
      return 0.1;
    case 15:  // decametre
      return 10.0;
    case 16:  // hectometre
      return 100.0;
    case 21:
      return kSurveyFoot;
    case 22:  // inch of surveys
      return kSurveyFoot / 12.0;
    case 23:  // yard of surveys
      return 3.0 * kSurveyFoot;
    default:
      return 0.0;
  }
}

std::string Lower(std::string text) {
  std::transform(text.begin(), text.end(), text.begin(),
                 [](unsigned char c) { return std::tolower(c); });
  return text;
}

bool Selects(const std::string& pattern, const std::string& layer) {
  const std::string low = Lower(pattern);
  if (!low.empty() && low.back() == '*') {
    return Lower(layer).compare(0, low.size() - 1, low, 0, low.size() - 1) == 0;
  }
  return Lower(layer) == low;
}

// Pairs of lines: a code and a value.
class DxfReader {
 public:
  DxfReader(const std::string& text, const std::string& name,
            const std::vector<std::string>& layers)
      : text_(text), name_(name), layers_(layers) {
    if (layers_.empty()) layers_ = {"WALL*", "A-WALL*"};
  }

  std::vector<PlanLine> Read(std::vector<std::string>* notes) {
    if (text_.compare(0, 18, "AutoCAD Binary DXF") == 0) {
      throw Error(name_, 0, "is a binary DXF", "a DXF saved as text");
    }
    if (text_.compare(0, 4, "AC10") == 0) {
      throw Error(name_, 0, "is a DWG", "a DXF saved as text");
    }
    // The one that is open.
    std::string section;
    bool has_ended = false;
    while (!has_ended && Next()) {
      if (code_ == 0) {
        EndEntity();
        entity_ = value_;
        if (entity_ == "ENDSEC") section.clear();
        has_ended = entity_ == "EOF";
        BeginEntity(section == "ENTITIES");
      } else if (code_ == 2 && entity_ == "SECTION") {
        section = value_;
        has_sections_ = true;
      } else if (section == "HEADER") {
        if (code_ == 9) variable_ = value_;
        if (code_ == 70 && variable_ == "$INSUNITS") ReadUnit();
      } else if (is_entity_) {
        TakeGroup();
      }
    }
    EndEntity();
    if (!has_sections_) Refuse("has no sections", "a drawing (DXF)");
    // What is missing may be walls.
    if (!section.empty()) {
      Refuse("breaks off in section " + PrintableUtf8(section.substr(0, 40)),
             "ENDSEC, and EOF at the end of the drawing");
    }
    if (!has_ended) Refuse("breaks off", "EOF at the end of the drawing");
    if (lines_.empty()) RefuseWithoutLines();
    for (PlanLine& line : lines_) {
      line.begin *= unit_;
      line.end *= unit_;
    }
    const auto is_short = [](const PlanLine& line) {
      return (line.end - line.begin).norm() < kLeastLength;
    };
    lines_.erase(std::remove_if(lines_.begin(), lines_.end(), is_short),
                 lines_.end());
    if (lines_.empty()) {
      throw Error(name_, 0, "has lines of less than 0.3 m only",
                  "walls, and the drawing's unit in $INSUNITS");
    }
    if (notes != nullptr) {
      if (!has_unit_) {
        notes->push_back("the plan says no unit: it is taken for metres");
      }
      if (inserts_ > 0) {
        notes->push_back(std::to_string(inserts_) +
                         " blocks of the plan are not read");
      }
      if (tilted_ > 0) {
        notes->push_back(
            std::to_string(tilted_) +
            " polylines of the plan are not read: their planes are tilted");
      }
    }
    return std::move(lines_);
  }

 private:
  [[noreturn]] void Refuse(const std::string& what,
                           const std::string& expected) const {
    throw Error(name_, line_, what, expected);
  }

  bool NextLine(std::string* line) {
    if (at_ >= text_.size()) return false;
    const std::size_t end = std::min(text_.find('\n', at_), text_.size());
    std::string_view view(text_.data() + at_, end - at_);
    at_ = end + 1;
    ++line_;
    while (!view.empty() &&
           std::isspace(static_cast<unsigned char>(view.front()))) {
      view.remove_prefix(1);
    }
    while (!view.empty() &&
           std::isspace(static_cast<unsigned char>(view.back()))) {
      view.remove_suffix(1);
    }
    line->assign(view);
    return true;
  }

  bool Next() {
    std::string code;
    if (!NextLine(&code)) return false;
    // Some writers end with empty lines.
    if (code.empty() &&
        text_.find_first_not_of(" \r\n", at_) == std::string::npos) {
      return false;
    }
    if (!ParseNumber(std::string_view(code), &code_)) {
      Refuse("'" + PrintableUtf8(code.substr(0, 40)) + "' is no group code",
             "a drawing (DXF): a line with a whole number before every value");
    }
    if (!NextLine(&value_)) Refuse("breaks off", "a whole drawing (DXF)");
    return true;
  }

  double Number() const {
    double number = 0.0;
    if (!ParseNumber(std::string_view(value_), &number) ||
        !(std::abs(number) < 1e12)) {
      Refuse("'" + PrintableUtf8(value_.substr(0, 40)) + "' is no coordinate",
             "a number");
    }
    return number;
  }

  void ReadUnit() {
    int code = 0;
    if (!ParseNumber(std::string_view(value_), &code) || Unit(code) == 0.0) {
      Refuse("'" + PrintableUtf8(value_.substr(0, 40)) +
                 "' is no unit of a building",
             "$INSUNITS of metres (6), millimetres (4), centimetres (5), feet "
             "(2), inches (1), ...");
    }
    unit_ = Unit(code);
    has_unit_ = code != 0;
  }

  void BeginEntity(bool is_entity) {
    is_entity_ = is_entity;
    if (entity_ == "VERTEX" || entity_ == "SEQEND") return;
    is_paper_ = is_closed_ = is_of_space_ = false;
    normal_ = Eigen::Vector3d::UnitZ();
    layer_.clear();
    points_.clear();
    bulges_.clear();
  }

  void TakeGroup() {
    const bool is_vertex = entity_ == "VERTEX";
    // What belongs to a polyline is on its layer and in its plane.
    if (!is_vertex && entity_ != "SEQEND") {
      if (code_ == 8) layer_ = value_;
      if (code_ == 210) normal_.x() = Number();
      if (code_ == 220) normal_.y() = Number();
      if (code_ == 230) normal_.z() = Number();
    }
    if (code_ == 67) is_paper_ = value_ == "1";
    const bool is_line = entity_ == "LINE";
    const bool is_polyline = entity_ == "LWPOLYLINE";
    if (code_ == 70 && (is_polyline || entity_ == "POLYLINE")) {
      int flags = 0;
      ParseNumber(std::string_view(value_), &flags);
      is_closed_ = (flags & 1) != 0;
      is_of_space_ = entity_ == "POLYLINE" && (flags & 8) != 0;
      // A mesh is no line.
      if ((flags & 80) != 0) is_paper_ = true;
    }
    if (!is_line && !is_polyline && !is_vertex) return;
    if (code_ == 10 || (code_ == 11 && is_line)) {
      points_.emplace_back(Number(), 0.0);
      bulges_.push_back(0.0);
    } else if ((code_ == 20 || (code_ == 21 && is_line)) && !points_.empty()) {
      points_.back().y() = Number();
    } else if (code_ == 42 && !bulges_.empty()) {
      bulges_.back() = Number();
    }
    if (points_.size() > kMostLines) {
      Refuse("has a polyline of too many points", "20000 at most");
    }
  }

  // Points of a polyline are in the system of its plane, whose axes follow from
  // the plane's normal by the "arbitrary axis algorithm" of the format: seen
  // from below, as commands that mirror leave it, x points the other way. Those
  // of a LINE, and of polylines in space, are in that of the drawing. False
  // where the plane is not the floor's.
  bool ToDrawing() {
    if (entity_ == "LINE" || is_of_space_) return true;
    if (normal_.head<2>().norm() > kMostTilt * std::abs(normal_.z())) {
      return false;
    }
    if (normal_.z() < 0.0) {
      for (Eigen::Vector2d& point : points_) point.x() = -point.x();
    }
    return true;
  }

  // What a layer has.
  struct Content {
    int lines = 0;
    int arcs = 0;
    int blocks = 0;
    // Polylines in a plane that is not the floor's.
    int tilted = 0;
    bool is_read = false;
  };

  Content& ContentOfLayer() {
    const auto [entry, is_new] = content_.try_emplace(layer_);
    if (is_new) {
      entry->second.is_read = std::any_of(
          layers_.begin(), layers_.end(),
          [this](const std::string& p) { return Selects(p, layer_); });
    }
    return entry->second;
  }

  // What came before the next entity is whole.
  void EndEntity() {
    if (!is_entity_ || is_paper_) return;
    if (entity_ == "INSERT") {
      ++inserts_;
      ++ContentOfLayer().blocks;
    } else if (entity_ == "ARC" || entity_ == "CIRCLE" ||
               entity_ == "ELLIPSE" || entity_ == "SPLINE") {
      ++ContentOfLayer().arcs;
    } else if (points_.size() >= 2 &&
               (entity_ == "LINE" || entity_ == "LWPOLYLINE" ||
                entity_ == "SEQEND")) {
      TakeLines(&ContentOfLayer());
      points_.clear();
      bulges_.clear();
    }
  }

  void TakeLines(Content* content) {
    if (!ToDrawing()) {
      ++content->tilted;
      if (content->is_read) ++tilted_;
      return;
    }
    const bool is_closed = is_closed_ && entity_ != "LINE";
    const std::size_t count = points_.size() - (is_closed ? 0 : 1);
    for (std::size_t i = 0; i < count; ++i) {
      if (bulges_[i] != 0.0) {
        ++content->arcs;
        continue;
      }
      ++content->lines;
      if (!content->is_read) continue;
      PlanLine line;
      line.begin = points_[i];
      line.end = points_[(i + 1) % points_.size()];
      line.layer = layer_;
      if (line.begin.cwiseAbs().maxCoeff() * unit_ > kAbsurdCoordinate ||
          line.end.cwiseAbs().maxCoeff() * unit_ > kAbsurdCoordinate) {
        Refuse("a line is absurdly far away",
               "walls within 10000 km, and the drawing's unit in $INSUNITS");
      }
      lines_.push_back(std::move(line));
    }
    if (lines_.size() > kMostLines) {
      Refuse("has too many lines on the layers that are read",
             "20000 at most: --plan_layers with those of walls");
    }
  }

  [[noreturn]] void RefuseWithoutLines() const {
    // On all layers, and on those that are read.
    Content all;
    Content read;
    for (const auto& [layer, content] : content_) {
      Add(content, &all);
      if (content.is_read) Add(content, &read);
    }
    const std::string unread = Unread(read);
    if (all.lines > 0) {
      throw Error(name_, 0,
                  "has no lines on the layers that are read" +
                      (unread.empty() ? "" : " (only " + unread + ")") +
                      "; it has " + Layers(&Lines),
                  "--plan_layers with some of these");
    }
    const std::string found = Layers(&Unread);
    throw Error(
        name_, 0,
        "has no lines at all" + (found.empty() ? "" : "; it has " + found),
        "walls that are drawn as LINE, LWPOLYLINE or POLYLINE in the model "
        "space (blocks exploded)");
  }

  static void Add(const Content& content, Content* sum) {
    sum->lines += content.lines;
    sum->arcs += content.arcs;
    sum->blocks += content.blocks;
    sum->tilted += content.tilted;
  }

  static std::string Lines(const Content& content) {
    return content.lines == 0 ? "" : std::to_string(content.lines) + " lines";
  }

  // What is on a layer and never read.
  static std::string Unread(const Content& content) {
    std::string text;
    const auto append = [&text](int count, const char* what) {
      if (count == 0) return;
      text += (text.empty() ? "" : ", ") + std::to_string(count) + what;
    };
    append(content.arcs, " arcs");
    append(content.blocks, " blocks");
    append(content.tilted, " polylines in tilted planes");
    return text;
  }

  // The layers that something can be told of.
  std::string Layers(std::string (*tell)(const Content&)) const {
    std::string text;
    int shown = 0;
    for (const auto& [layer, content] : content_) {
      const std::string told = tell(content);
      if (told.empty()) continue;
      if (++shown > kShownLayers) return text + ", ...";
      text +=
          (text.empty() ? "" : ", ") + PrintableUtf8(layer) + " (" + told + ")";
    }
    return text;
  }

  const std::string& text_;
  const std::string& name_;
  std::vector<std::string> layers_;
  std::size_t at_ = 0;
  int line_ = 0;
  int code_ = 0;
  std::string value_;
  std::string variable_;
  bool has_sections_ = false;
  double unit_ = 1.0;
  bool has_unit_ = false;
  int inserts_ = 0;
  int tilted_ = 0;
  // The entity that is read.
  std::string entity_;
  bool is_entity_ = false;
  bool is_paper_ = false;
  bool is_closed_ = false;
  // In the drawing's own coordinates.
  bool is_of_space_ = false;
  // Of its plane ("extrusion direction"), of any length.
  Eigen::Vector3d normal_ = Eigen::Vector3d::UnitZ();
  std::string layer_;
  std::vector<Eigen::Vector2d> points_;
  std::vector<double> bulges_;
  // By layer.
  std::map<std::string, Content> content_;
  std::vector<PlanLine> lines_;
};

}  // namespace

std::vector<PlanLine> ReadPlanDxf(const std::string& text,
                                  const std::string& name,
                                  const std::vector<std::string>& layers,
                                  std::vector<std::string>* notes) {
  return DxfReader(text, name, layers).Read(notes);
}

}  // namespace plumbline
