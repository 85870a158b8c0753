#include <geos_c.h>
#include <plumbline/core/error.h>
#include <plumbline/core/late_library.h>
#include <plumbline/plan/polygon.h>

#include <algorithm>
#include <cmath>
#include <memory>
#include <string>

namespace plumbline {
namespace {

// Loaded when there is a plan to be made.
LateLibrary geos_library("libgeos_c.so.1");
PLUMBLINE_LATE_FUNCTION(geos_library, GEOSBufferWithStyle_r);
PLUMBLINE_LATE_FUNCTION(geos_library, GEOSContext_setErrorMessageHandler_r);
PLUMBLINE_LATE_FUNCTION(geos_library, GEOSCoordSeq_create_r);
PLUMBLINE_LATE_FUNCTION(geos_library, GEOSCoordSeq_getSize_r);
PLUMBLINE_LATE_FUNCTION(geos_library, GEOSCoordSeq_getXY_r);
PLUMBLINE_LATE_FUNCTION(geos_library, GEOSCoordSeq_setXY_r);
PLUMBLINE_LATE_FUNCTION(geos_library, GEOSCoverageUnion_r);
PLUMBLINE_LATE_FUNCTION(geos_library, GEOSDifferencePrec_r);
PLUMBLINE_LATE_FUNCTION(geos_library, GEOSGeomTypeId_r);
PLUMBLINE_LATE_FUNCTION(geos_library, GEOSGeom_createCollection_r);
PLUMBLINE_LATE_FUNCTION(geos_library, GEOSGeom_createLineString_r);
PLUMBLINE_LATE_FUNCTION(geos_library, GEOSGeom_createLinearRing_r);
PLUMBLINE_LATE_FUNCTION(geos_library, GEOSGeom_createPolygon_r);
PLUMBLINE_LATE_FUNCTION(geos_library, GEOSGeom_destroy_r);
PLUMBLINE_LATE_FUNCTION(geos_library, GEOSGeom_getCoordSeq_r);
PLUMBLINE_LATE_FUNCTION(geos_library, GEOSGetExteriorRing_r);
PLUMBLINE_LATE_FUNCTION(geos_library, GEOSGetGeometryN_r);
PLUMBLINE_LATE_FUNCTION(geos_library, GEOSGetInteriorRingN_r);
PLUMBLINE_LATE_FUNCTION(geos_library, GEOSGetNumGeometries_r);
PLUMBLINE_LATE_FUNCTION(geos_library, GEOSGetNumInteriorRings_r);
PLUMBLINE_LATE_FUNCTION(geos_library, GEOSIntersectionPrec_r);
PLUMBLINE_LATE_FUNCTION(geos_library, GEOSMakeValid_r);
PLUMBLINE_LATE_FUNCTION(geos_library, GEOSMaximumInscribedCircle_r);
PLUMBLINE_LATE_FUNCTION(geos_library, GEOSPolygonize_r);
PLUMBLINE_LATE_FUNCTION(geos_library, GEOSUnaryUnionPrec_r);
PLUMBLINE_LATE_FUNCTION(geos_library, GEOS_finish_r);
PLUMBLINE_LATE_FUNCTION(geos_library, GEOS_init_r);
PLUMBLINE_LATE_FUNCTION(geos_library, GEOSisEmpty_r);
PLUMBLINE_LATE_FUNCTION(geos_library, GEOSisValid_r);

using Eigen::Vector2d;

// Corners lie on a raster of this, m: what is drawn is no finer, and GEOS'
// snap-rounding makes noding robust.
constexpr double kPrecision = 1e-3;
// Corners this near to the straight line between their neighbours are none, m.
constexpr double kStraight = 1.5e-3;

// Handle of the library, whose messages become errors.
class Geos {
 public:
  Geos() : handle_(GEOS_init_r()) {
    GEOSContext_setErrorMessageHandler_r(handle_, &Geos::Take, &message_);
  }
  ~Geos() { GEOS_finish_r(handle_); }
  Geos(const Geos&) = delete;
  Geos& operator=(const Geos&) = delete;

  operator GEOSContextHandle_t() const { return handle_; }

  struct Destroy {
    GEOSContextHandle_t handle;
    void operator()(GEOSGeometry* geometry) const {
      GEOSGeom_destroy_r(handle, geometry);
    }
  };
  using Geometry = std::unique_ptr<GEOSGeometry, Destroy>;

  // Takes over what a function of the library made. Throws when it failed.
  Geometry Own(GEOSGeometry* geometry) const {
    if (geometry == nullptr) {
      throw PLUMBLINE_ERROR("polygons of a plan: " + message_,
                            "what GEOS can work on");
    }
    return Geometry(geometry, Destroy{handle_});
  }

  Geometry Line(const Vector2d& a, const Vector2d& b) const {
    GEOSCoordSequence* const points = GEOSCoordSeq_create_r(handle_, 2, 2);
    GEOSCoordSeq_setXY_r(handle_, points, 0, a[0], a[1]);
    GEOSCoordSeq_setXY_r(handle_, points, 1, b[0], b[1]);
    return Own(GEOSGeom_createLineString_r(handle_, points));
  }

  Geometry From(const Polygon& polygon) const {
    std::vector<GEOSGeometry*> holes;
    for (const Ring& ring : polygon.holes) {
      if (ring.size() >= 3) holes.push_back(Closed(ring));
    }
    return Own(GEOSGeom_createPolygon_r(handle_, Closed(polygon.shell),
                                        holes.data(),
                                        static_cast<unsigned>(holes.size())));
  }

  // A valid geometry of a polygon that may cross itself.
  Geometry FromMended(const Polygon& polygon) const {
    Geometry geometry = From(polygon);
    if (GEOSisValid_r(handle_, geometry.get()) == 1) return geometry;
    return Own(GEOSMakeValid_r(handle_, geometry.get()));
  }

  Geometry Collection(int type, std::vector<Geometry> parts) const {
    std::vector<GEOSGeometry*> raw;
    raw.reserve(parts.size());
    for (Geometry& part : parts) raw.push_back(part.release());
    return Own(GEOSGeom_createCollection_r(handle_, type, raw.data(),
                                           static_cast<unsigned>(raw.size())));
  }

  // All polygons of a geometry in its own order.
  void AppendPolygons(const GEOSGeometry* geometry,
                      std::vector<Polygon>* polygons) const {
    if (GEOSGeomTypeId_r(handle_, geometry) == GEOS_POLYGON) {
      if (GEOSisEmpty_r(handle_, geometry) == 1) return;
      Polygon polygon;
      polygon.shell = RingOf(GEOSGetExteriorRing_r(handle_, geometry), true);
      const int holes = GEOSGetNumInteriorRings_r(handle_, geometry);
      for (int i = 0; i < holes; ++i) {
        polygon.holes.push_back(
            RingOf(GEOSGetInteriorRingN_r(handle_, geometry, i), false));
      }
      polygons->push_back(std::move(polygon));
      return;
    }
    const int parts = GEOSGetNumGeometries_r(handle_, geometry);
    for (int i = 0; i < parts; ++i) {
      const GEOSGeometry* part = GEOSGetGeometryN_r(handle_, geometry, i);
      if (part != geometry) AppendPolygons(part, polygons);
    }
  }

 private:
  static void Take(const char* message, void* to) {
    *static_cast<std::string*>(to) = message;
  }

  GEOSGeometry* Closed(const Ring& ring) const {
    const unsigned size = static_cast<unsigned>(ring.size()) + 1;
    GEOSCoordSequence* const points = GEOSCoordSeq_create_r(handle_, size, 2);
    for (unsigned i = 0; i < size; ++i) {
      const Vector2d& point = ring[i % ring.size()];
      GEOSCoordSeq_setXY_r(handle_, points, i, point[0], point[1]);
    }
    return GEOSGeom_createLinearRing_r(handle_, points);
  }

  Ring RingOf(const GEOSGeometry* geometry, bool is_shell) const {
    const GEOSCoordSequence* const points =
        GEOSGeom_getCoordSeq_r(handle_, geometry);
    unsigned size = 0;
    GEOSCoordSeq_getSize_r(handle_, points, &size);
    Ring ring;
    for (unsigned i = 0; i + 1 < size; ++i) {
      Vector2d point;
      GEOSCoordSeq_getXY_r(handle_, points, i, &point[0], &point[1]);
      ring.push_back(point);
    }
    if ((SignedArea(ring) > 0.0) != is_shell) {
      std::reverse(ring.begin(), ring.end());
    }
    return ring;
  }

  GEOSContextHandle_t handle_;
  std::string message_;
};

bool ComesBefore(const Vector2d& a, const Vector2d& b) {
  return a[0] != b[0] ? a[0] < b[0] : a[1] < b[1];
}

// Begins at the least corner, so that a figure is written in one way only.
void Normalize(Ring* ring) {
  std::rotate(ring->begin(),
              std::min_element(ring->begin(), ring->end(), ComesBefore),
              ring->end());
}

void DropStraightCorners(Ring* ring) {
  bool has_changed = true;
  while (has_changed && ring->size() > 3) {
    has_changed = false;
    for (std::size_t i = 0; i < ring->size() && ring->size() > 3;) {
      const std::size_t size = ring->size();
      const Vector2d& before = (*ring)[(i + size - 1) % size];
      const Vector2d& after = (*ring)[(i + 1) % size];
      const Vector2d along = after - before;
      const Vector2d here = (*ring)[i] - before;
      const double length = along.norm();
      const bool is_straight =
          length < kPrecision ||
          std::abs(along[0] * here[1] - along[1] * here[0]) <=
              kStraight * length;
      if (is_straight) {
        ring->erase(ring->begin() + static_cast<std::ptrdiff_t>(i));
        has_changed = true;
      } else {
        ++i;
      }
    }
  }
}

std::vector<Polygon> Ordered(const Geos& geos, const GEOSGeometry* geometry) {
  std::vector<Polygon> polygons;
  geos.AppendPolygons(geometry, &polygons);
  for (Polygon& polygon : polygons) {
    DropStraightCorners(&polygon.shell);
    Normalize(&polygon.shell);
    for (Ring& hole : polygon.holes) {
      DropStraightCorners(&hole);
      Normalize(&hole);
    }
    std::sort(polygon.holes.begin(), polygon.holes.end(),
              [](const Ring& a, const Ring& b) {
                return ComesBefore(a.front(), b.front());
              });
  }
  std::sort(polygons.begin(), polygons.end(),
            [](const Polygon& a, const Polygon& b) {
              const double area_a = a.Area();
              const double area_b = b.Area();
              if (area_a != area_b) return area_a > area_b;
              return ComesBefore(a.shell.front(), b.shell.front());
            });
  return polygons;
}

bool IsInside(const Ring& ring, const Vector2d& point) {
  bool is_inside = false;
  for (std::size_t i = 0, j = ring.size() - 1; i < ring.size(); j = i++) {
    const Vector2d& a = ring[i];
    const Vector2d& b = ring[j];
    if ((a[1] > point[1]) != (b[1] > point[1]) &&
        point[0] < (b[0] - a[0]) * (point[1] - a[1]) / (b[1] - a[1]) + a[0]) {
      is_inside = !is_inside;
    }
  }
  return is_inside;
}

bool IsEmpty(const Polygon& polygon) { return polygon.shell.size() < 3; }

double Length(const Ring& ring) {
  double length = 0.0;
  for (std::size_t i = 0; i < ring.size(); ++i) {
    length += (ring[(i + 1) % ring.size()] - ring[i]).norm();
  }
  return length;
}

}  // namespace

double SignedArea(const Ring& ring) {
  double doubled = 0.0;
  for (std::size_t i = 0; i < ring.size(); ++i) {
    // Relative to a corner: nothing is lost far from the origin.
    const Vector2d a = ring[i] - ring[0];
    const Vector2d b = ring[(i + 1) % ring.size()] - ring[0];
    doubled += a[0] * b[1] - a[1] * b[0];
  }
  return 0.5 * doubled;
}

double Polygon::Area() const {
  double area = std::abs(SignedArea(shell));
  for (const Ring& hole : holes) area -= std::abs(SignedArea(hole));
  return area;
}

double Polygon::Perimeter() const {
  double length = Length(shell);
  for (const Ring& hole : holes) length += Length(hole);
  return length;
}

bool Polygon::Contains(const Vector2d& point) const {
  if (!IsInside(shell, point)) return false;
  return std::none_of(holes.begin(), holes.end(),
                      [&](const Ring& hole) { return IsInside(hole, point); });
}

std::vector<Polygon> FacesOf(const std::vector<StraightPiece>& pieces) {
  if (pieces.empty()) return {};
  const Geos geos;
  std::vector<Geos::Geometry> lines;
  lines.reserve(pieces.size());
  for (const auto& [a, b] : pieces) lines.push_back(geos.Line(a, b));
  const Geos::Geometry all =
      geos.Collection(GEOS_MULTILINESTRING, std::move(lines));
  const Geos::Geometry noded =
      geos.Own(GEOSUnaryUnionPrec_r(geos, all.get(), kPrecision));
  const GEOSGeometry* const input = noded.get();
  const Geos::Geometry faces = geos.Own(GEOSPolygonize_r(geos, &input, 1));
  std::vector<Polygon> polygons;
  geos.AppendPolygons(faces.get(), &polygons);
  return polygons;
}

std::vector<Polygon> UnionOf(const std::vector<Polygon>& polygons) {
  if (polygons.empty()) return {};
  const Geos geos;
  std::vector<Geos::Geometry> parts;
  parts.reserve(polygons.size());
  for (const Polygon& polygon : polygons) parts.push_back(geos.From(polygon));
  const Geos::Geometry all =
      geos.Collection(GEOS_MULTIPOLYGON, std::move(parts));
  // What shares whole edges needs no search for crossings. Where more meets in
  // a corner than that can take apart, it tells.
  GEOSGeometry* whole = GEOSCoverageUnion_r(geos, all.get());
  if (whole == nullptr) {
    whole = GEOSUnaryUnionPrec_r(geos, all.get(), kPrecision);
  }
  return Ordered(geos, geos.Own(whole).get());
}

std::vector<Polygon> Offset(const Polygon& polygon, double distance) {
  if (IsEmpty(polygon)) return {};
  const Geos geos;
  const Geos::Geometry whole = geos.FromMended(polygon);
  const Geos::Geometry moved = geos.Own(
      GEOSBufferWithStyle_r(geos, whole.get(), distance, 8, GEOSBUF_CAP_SQUARE,
                            GEOSBUF_JOIN_MITRE, 3.0));
  return Ordered(geos, moved.get());
}

std::vector<Polygon> IntersectionOf(const Polygon& a, const Polygon& b) {
  if (IsEmpty(a) || IsEmpty(b)) return {};
  const Geos geos;
  const Geos::Geometry first = geos.FromMended(a);
  const Geos::Geometry second = geos.FromMended(b);
  const Geos::Geometry common = geos.Own(
      GEOSIntersectionPrec_r(geos, first.get(), second.get(), kPrecision));
  return Ordered(geos, common.get());
}

std::vector<Polygon> DifferenceOf(const Polygon& a, const Polygon& b) {
  if (IsEmpty(a)) return {};
  if (IsEmpty(b)) return {a};
  const Geos geos;
  const Geos::Geometry first = geos.FromMended(a);
  const Geos::Geometry second = geos.FromMended(b);
  const Geos::Geometry left = geos.Own(
      GEOSDifferencePrec_r(geos, first.get(), second.get(), kPrecision));
  return Ordered(geos, left.get());
}

Vector2d InnerPoint(const Polygon& polygon) {
  if (IsEmpty(polygon)) return Vector2d::Zero();
  const Geos geos;
  const Geos::Geometry whole = geos.FromMended(polygon);
  const Geos::Geometry radius =
      geos.Own(GEOSMaximumInscribedCircle_r(geos, whole.get(), 0.1));
  Vector2d point;
  const GEOSCoordSequence* const points =
      GEOSGeom_getCoordSeq_r(geos, radius.get());
  GEOSCoordSeq_getXY_r(geos, points, 0, &point[0], &point[1]);
  return point;
}

Polygon Mended(const Polygon& polygon) {
  if (IsEmpty(polygon)) return {};
  const Geos geos;
  const Geos::Geometry whole = geos.FromMended(polygon);
  std::vector<Polygon> parts = Ordered(geos, whole.get());
  return parts.empty() ? Polygon() : std::move(parts.front());
}

}  // namespace plumbline
