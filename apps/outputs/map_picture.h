#ifndef PLUMBLINE_OUTPUTS_MAP_PICTURE_H_
#define PLUMBLINE_OUTPUTS_MAP_PICTURE_H_

#include <plumbline/outputs/map_drawing.h>

#include <string>

namespace plumbline {

/// Options of drawing a map.
struct MapDrawingOptions {
  /// Length of the picture's longer side, px, 200 to 20000. Line widths and
  /// letters grow with it.
  int long_side = 2400;
};

/// Writes the drawing as SVG whose outer user unit is the metre: x to the
/// right as in the map, y downwards, so y of the map is minus y of the viewBox.
/// Written whole or not at all; the same drawing gives the same bytes. Throws
/// Error for options out of range or when the file cannot be written.
void WriteMapSvg(const MapDrawing& drawing, const std::string& path,
                 const MapDrawingOptions& options = {});

/// The same picture as PNG on white.
void WriteMapPng(const MapDrawing& drawing, const std::string& path,
                 const MapDrawingOptions& options = {});

}  // namespace plumbline

#endif  // PLUMBLINE_OUTPUTS_MAP_PICTURE_H_
