#include <plumbline/plan/arrangement.h>
#include <plumbline/plan/polygon_cells.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <map>
#include <utility>

namespace plumbline {
namespace {

using Eigen::Vector2d;

// Corners to a millimetre.
using Corner = std::pair<std::int64_t, std::int64_t>;
Corner CornerOf(const Vector2d& p) {
  return {std::llround(p[0] * 1e3), std::llround(p[1] * 1e3)};
}

std::vector<ArrangementEdge> EdgesOf(const std::vector<Polygon>& faces) {
  std::map<std::pair<Corner, Corner>, std::size_t> index;
  std::vector<ArrangementEdge> edges;
  const auto add = [&](const Ring& ring, int face) {
    for (std::size_t i = 0; i < ring.size(); ++i) {
      const Vector2d& a = ring[i];
      const Vector2d& b = ring[(i + 1) % ring.size()];
      const Corner from = CornerOf(a);
      const Corner to = CornerOf(b);
      const auto other = index.find({to, from});
      if (other != index.end()) {
        edges[other->second].right = face;
        continue;
      }
      index[{from, to}] = edges.size();
      ArrangementEdge edge;
      edge.begin = a;
      edge.end = b;
      edge.left = face;
      edges.push_back(edge);
    }
  };
  for (std::size_t i = 0; i < faces.size(); ++i) {
    add(faces[i].shell, static_cast<int>(i));
    // Rings of holes run with the clock: the face is on their left as well.
    for (const Ring& hole : faces[i].holes) add(hole, static_cast<int>(i));
  }
  return edges;
}

// The line that an edge lies on, and what is known along it.
void MeasureEdge(const std::vector<DrawnLine>& drawn, ArrangementEdge* edge) {
  edge->line = LineOf(drawn, edge->begin, edge->end);
  if (edge->line < 0) {
    edge->lengths.metres[static_cast<std::size_t>(Mark::kUnknown)] =
        edge->length();
    return;
  }
  const DrawnLine& on = drawn[static_cast<std::size_t>(edge->line)];
  double from = on.line.Along(edge->begin);
  double to = on.line.Along(edge->end);
  if (from > to) std::swap(from, to);
  const WallProfile& profile = on.profile;
  const int first = std::clamp(profile.IndexOf(from), 0, profile.size() - 1);
  const int last = std::clamp(profile.IndexOf(to), 0, profile.size() - 1);
  for (int i = first; i <= last; ++i) {
    const double begin = std::max(from, profile.begin + i * WallProfile::kStep);
    const double end =
        std::min(to, profile.begin + (i + 1) * WallProfile::kStep);
    edge->lengths.metres[static_cast<std::size_t>(
        profile.marks[static_cast<std::size_t>(i)])] +=
        std::max(0.0, end - begin);
    edge->lengths.holds +=
        profile.holds[static_cast<std::size_t>(i)] * std::max(0.0, end - begin);
  }
}

}  // namespace

int LineOf(const std::vector<DrawnLine>& drawn, const Vector2d& begin,
           const Vector2d& end) {
  const Vector2d middle = 0.5 * (begin + end);
  const double length = (end - begin).norm();
  const Vector2d along = (end - begin) / length;
  double best = 0.05;
  int found = -1;
  for (std::size_t i = 0; i < drawn.size(); ++i) {
    const WallLine& line = drawn[i].line;
    const double across = std::abs(line.Across(middle));
    if (across >= best) continue;
    const double t = line.Along(middle);
    if (t < drawn[i].from - 0.01 || t > drawn[i].to + 0.01) continue;
    if (length > 0.05 && std::abs(along.dot(line.along)) < 0.95) continue;
    best = across;
    found = static_cast<int>(i);
  }
  return found;
}

Arrangement Arrange(const std::vector<DrawnLine>& drawn,
                    const SpaceGrid& space) {
  std::vector<StraightPiece> pieces;
  for (const DrawnLine& line : drawn) {
    pieces.push_back({line.line.At(line.from), line.line.At(line.to)});
  }
  Arrangement arrangement;
  arrangement.faces = FacesOf(pieces);
  arrangement.edges = EdgesOf(arrangement.faces);
  for (ArrangementEdge& edge : arrangement.edges) MeasureEdge(drawn, &edge);
  const double cell = space.resolution * space.resolution;
  for (const Polygon& face : arrangement.faces) {
    double free = 0.0;
    double unknown = 0.0;
    ForEachCell(face, space, [&](int column, int row) {
      const Space at = space.At(column, row);
      if (at == Space::kFree) free += cell;
      if (at == Space::kUnknown) unknown += cell;
    });
    arrangement.free.push_back(free);
    arrangement.unknown.push_back(unknown);
  }
  return arrangement;
}

std::map<int, RegionParts> PartsOfRegions(const Arrangement& arrangement,
                                          const std::vector<int>& region) {
  std::map<int, RegionParts> parts;
  for (std::size_t i = 0; i < region.size(); ++i) {
    if (region[i] < 0) continue;
    RegionParts& own = parts[region[i]];
    own.faces.push_back(arrangement.faces[i]);
    own.area += arrangement.faces[i].Area();
  }
  return parts;
}

}  // namespace plumbline
