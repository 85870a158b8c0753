#include <plumbline/apps/simulation/bent_world.h>
#include <plumbline/apps/simulation/building.h>
#include <plumbline/core/error.h>
#include <plumbline/factors/angle.h>

#include <cmath>
#include <vector>

namespace plumbline {
namespace {

using Eigen::Vector2d;

// No niche this close to an end of a corridor, m.
constexpr double kPlainEnd = 0.6;

// A straight piece of the building's centre line.
struct Piece {
  Vector2d begin;
  double direction;  // rad
  double length;
  bool has_niches;
};

Vector2d Along(const Piece& piece) {
  return {std::cos(piece.direction), std::sin(piece.direction)};
}

Vector2d LeftOf(const Vector2d& v) { return {-v.y(), v.x()}; }

// The outline of one side (1: left, -1: right) from the first piece's beginning
// to the last one's end.
std::vector<Vector2d> Side(const std::vector<Piece>& pieces, double side,
                           double half_width, const BentOptions& options,
                           SimulationRandom* random) {
  const auto draw = [&](const WorldInterval& interval) {
    return random->Uniform(interval.low, interval.high);
  };
  std::vector<Vector2d> outline;
  for (std::size_t i = 0; i < pieces.size(); ++i) {
    const Piece& piece = pieces[i];
    const Vector2d along = Along(piece);
    const Vector2d outwards = side * LeftOf(along);
    // What a mitre takes from the wall's length at the piece's two joints.
    const auto mitre = [&](std::size_t a, std::size_t b) {
      const double turn = pieces[b].direction - pieces[a].direction;
      return side * half_width * std::tan(turn / 2.0);
    };
    const double begin = i > 0 ? mitre(i - 1, i) : 0.0;
    const double end =
        piece.length - (i + 1 < pieces.size() ? mitre(i, i + 1) : 0.0);
    const auto at = [&](double u, double depth) -> Vector2d {
      return piece.begin + u * along + (half_width + depth) * outwards;
    };
    // A joint's first point is the last one of the piece before.
    if (i == 0) outline.push_back(at(begin, 0.0));
    double u = begin + draw(options.niche_spacing);
    while (piece.has_niches && options.niche_depth > 0.0) {
      const double width = draw(options.niche_width);
      if (u + width > end - kPlainEnd) break;
      outline.push_back(at(u, 0.0));
      outline.push_back(at(u, options.niche_depth));
      outline.push_back(at(u + width, options.niche_depth));
      outline.push_back(at(u + width, 0.0));
      u += width + draw(options.niche_spacing);
    }
    outline.push_back(at(end, 0.0));
  }
  return outline;
}

void Check(bool holds, const char* what, const char* expected) {
  if (!holds) throw PLUMBLINE_ERROR(what, expected);
}

}  // namespace

BentOptions NichesOptions() {
  BentOptions options;
  options.joint_length = 1.6;
  options.niche_depth = 0.4;
  return options;
}

World MakeBentWorld(const BentOptions& options, std::uint64_t seed) {
  Check(std::abs(options.bend_deg) <= 60.0, "bad bend", "-60 to 60 degrees");
  Check(options.length.low >= kLeastCorridorLength &&
            options.width.low >= 1.0 && options.joint_length >= 0.0,
        "bad dimensions of a bent building",
        "corridors of at least 5 by 1 m, a joint of no negative length");
  Check(options.joint_length == 0.0 || options.joint_length >= 1.0,
        "the joint is too short", "0, or at least 1 m");
  Check(options.niche_depth >= 0.0 && options.niche_spacing.low >= kPlainEnd &&
            options.niche_width.low > 0.0,
        "bad niches", "a depth of at least 0, 0.6 m between them, a width");
  SimulationRandom random(seed);
  const double half_width =
      0.5 * random.Uniform(options.width.low, options.width.high);
  const double bend = DegToRad(options.bend_deg);

  std::vector<Piece> pieces;
  const auto add = [&](double direction, double length, bool has_niches) {
    const Vector2d begin =
        pieces.empty() ? Vector2d::Zero()
                       : Vector2d(pieces.back().begin +
                                  pieces.back().length * Along(pieces.back()));
    pieces.push_back({begin, direction, length, has_niches});
  };
  add(0.0, random.Uniform(options.length.low, options.length.high), true);
  if (options.joint_length > 0.0) add(bend / 2, options.joint_length, false);
  add(bend, random.Uniform(options.length.low, options.length.high), true);

  World world;
  world.name = options.niche_depth > 0.0 ? "bent_niches" : "bent";
  const auto add_outline = [&world](const std::vector<Vector2d>& outline) {
    for (std::size_t i = 1; i < outline.size(); ++i) {
      world.walls.push_back({outline[i - 1], outline[i], 0.0});
    }
  };
  const std::vector<Vector2d> left =
      Side(pieces, 1.0, half_width, options, &random);
  const std::vector<Vector2d> right =
      Side(pieces, -1.0, half_width, options, &random);
  add_outline(left);
  add_outline(right);
  add_outline({left.front(), right.front()});
  add_outline({left.back(), right.back()});

  constexpr double kFromEnd = 1.0;
  world.path.push_back(pieces.front().begin + kFromEnd * Along(pieces.front()));
  for (std::size_t i = 1; i < pieces.size(); ++i) {
    world.path.push_back(pieces[i].begin);
  }
  world.path.push_back(pieces.back().begin + (pieces.back().length - kFromEnd) *
                                                 Along(pieces.back()));
  return world;
}

}  // namespace plumbline
