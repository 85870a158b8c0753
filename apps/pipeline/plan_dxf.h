#ifndef PLUMBLINE_PIPELINE_PLAN_DXF_H_
#define PLUMBLINE_PIPELINE_PLAN_DXF_H_

#include <plumbline/pipeline/known_structure.h>

#include <string>
#include <vector>

namespace plumbline {

/// Reads the straight lines of a drawing (ASCII DXF): LINE, LWPOLYLINE and
/// POLYLINE of the model space, in metres ($INSUNITS; without a unit they are
/// taken for metres). Polylines seen from below, as a command that mirrors
/// leaves them (extrusion 0, 0, -1), lie where the drawing shows them; those
/// whose plane is tilted are left out. Pieces shorter than 0.3 m, arcs, and
/// what is drawn by blocks are left out.
///
/// `layers`: names of those that are read, whatever their case; a name that
/// ends in * stands for all that begin so. Empty: those whose name begins with
/// WALL or A-WALL. `notes` (may be null) gets what was taken for granted.
/// Throws Error with the line for what is no such drawing, for one that breaks
/// off (does not end its sections with ENDSEC and itself with EOF), a binary
/// one, for lines that are absurdly many or far away, and for one without lines
/// on these layers: it then says what layers with lines there are, or what
/// there is in place of lines.
std::vector<PlanLine> ReadPlanDxf(const std::string& text,
                                  const std::string& name,
                                  const std::vector<std::string>& layers,
                                  std::vector<std::string>* notes);

}  // namespace plumbline

#endif  // PLUMBLINE_PIPELINE_PLAN_DXF_H_
