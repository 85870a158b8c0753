#ifndef PLUMBLINE_OUTPUTS_MAP_PALETTE_H_
#define PLUMBLINE_OUTPUTS_MAP_PALETTE_H_

/// Pictures of maps: colours, and where everything goes on the page.
namespace plumbline::map_page {

/// A color by its parts, each from 0 to 1.
struct Color {
  /// Red, green and blue.
  double r = 0.0;
  double g = 0.0;
  double b = 0.0;
};

/// A color from 0xRRGGBB.
constexpr Color Rgb(int hex) {
  return {((hex >> 16) & 255) / 255.0, ((hex >> 8) & 255) / 255.0,
          (hex & 255) / 255.0};
}

/// Of walls, by cluster: Okabe and Ito's palette (jfly.uni-koeln.de/color)
/// without its light colours, then two of Paul Tol's muted scheme: told apart
/// with any kind of colour vision, and dark enough for thin lines on white.
constexpr Color kClusterColors[] = {Rgb(0x0072B2), Rgb(0xD55E00), Rgb(0x009E73),
                                    Rgb(0xCC79A7), Rgb(0x332288), Rgb(0x56B4E9),
                                    Rgb(0x882255), Rgb(0x999933)};
/// Number of clusters with a colour of their own.
constexpr int kNumClusterColors =
    sizeof(kClusterColors) / sizeof(kClusterColors[0]);
/// All clusters past the palette share one colour; they hold little wall.
constexpr Color kMoreClustersColor = Rgb(0x8C6D5A);
/// Of walls without a cluster.
constexpr Color kNoClusterColor = Rgb(0x4D4D4D);
/// Of circles and of their common centres.
constexpr Color kCircleColor = Rgb(0xE69F00);
/// The area of rectangles, and its edge.
constexpr Color kRectangleColor = Rgb(0xFBF4DC);
constexpr Color kRectangleEdgeColor = Rgb(0xDCCB98);
/// Of ellipses, the path and points.
constexpr Color kEllipseColor = Rgb(0xCC3311);
constexpr Color kPathColor = Rgb(0xA9BDCE);
constexpr Color kPointColor = Rgb(0xC4C4C4);
/// Of letters and marks.
constexpr Color kInkColor = Rgb(0x222222);

/// The color of walls of a cluster, -1 for none.
constexpr Color ClusterColor(int cluster) {
  if (cluster < 0) return kNoClusterColor;
  if (cluster >= kNumClusterColors) return kMoreClustersColor;
  return kClusterColors[cluster];
}

}  // namespace plumbline::map_page

#endif  // PLUMBLINE_OUTPUTS_MAP_PALETTE_H_
