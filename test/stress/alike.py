#!/usr/bin/env python3
"""Writes worlds for plumbline_simulate whose places look alike.

    alike.py FOLDER

writes comb.world (a corridor with four equal ones to its side), curve.world (a
corridor that bends by 3 degrees every 6 m, with equal niches), hall.world (a
hall with columns every 6 m) and aisles.world (shelves with equal aisles).
"""

import math
import os
import sys


def wall(a, b):
    return "wall %.4f %.4f %.4f %.4f 0.15" % (a[0], a[1], b[0], b[1])


def way(points):
    return "path " + " ".join("%.3f %.3f" % point for point in points)


def rectangle(width, height):
    corners = [(0, 0), (width, 0), (width, height), (0, height), (0, 0)]
    return [wall(a, b) for a, b in zip(corners, corners[1:])]


def comb():
    sides = [20, 40, 60, 80]
    cuts = [0] + [x for side in sides for x in (side - 1, side + 1)] + [100]
    lines = [wall((cuts[i], 1), (cuts[i + 1], 1))
             for i in range(0, len(cuts), 2)]
    lines += [wall((0, -1), (100, -1)), wall((0, -1), (0, 1)),
              wall((100, -1), (100, 1))]
    for x in sides:
        lines += [wall((x - 1, 1), (x - 1, 25)), wall((x + 1, 1), (x + 1, 25)),
                  wall((x - 1, 25), (x + 1, 25))]
    points = [(1, 0)]
    for x in sides:
        points += [(x, 0), (x, 23), (x, 0)]
    points += [(98, 0), (40, 0), (40, 23), (40, 0), (2, 0)]
    return lines + [way(points)]


def bent(offset, bends=20, step=6.0, angle=3.0):
    points = []
    x = y = heading = 0.0
    for _ in range(bends + 1):
        across = math.radians(heading - 0.5 * angle)
        points.append((x - offset * math.sin(across),
                       y + offset * math.cos(across)))
        x += step * math.cos(math.radians(heading))
        y += step * math.sin(math.radians(heading))
        heading += angle
    return points


def curve():
    lines = []
    for side in (-1, 1):
        points = bent(side)
        for a, b in zip(points, points[1:]):
            length = math.hypot(b[0] - a[0], b[1] - a[1])
            u = ((b[0] - a[0]) / length, (b[1] - a[1]) / length)
            niche = [(a[0] + u[0] * s, a[1] + u[1] * s) for s in (2.0, 2.9)]
            back = [(p[0] - 0.4 * side * u[1], p[1] + 0.4 * side * u[0])
                    for p in niche]
            lines += [wall(a, niche[0]), wall(niche[1], b),
                      wall(back[0], back[1])]
    lines += [wall(bent(-1)[0], bent(1)[0]), wall(bent(-1)[-1], bent(1)[-1])]
    points = [(1.0, 0.0)] + bent(0)[1:-1]
    return lines + [way(points + points[-2::-1])]


def rows(count, first, spacing, left, right):
    points = []
    for row in range(count):
        ends = [(left, first + spacing * row), (right, first + spacing * row)]
        points += ends if row % 2 == 0 else ends[::-1]
    return points + [(left, first)]


def hall():
    lines = rectangle(60, 40)
    lines += ["box %d %d 0.5 0.5 0" % (6 * i, 6 * j - 1)
              for i in range(1, 10) for j in range(1, 7)]
    return lines + [way(rows(6, 2, 6, 3, 57))]


def aisles():
    lines = rectangle(50, 40)
    lines += ["box 25 %d 40 1.2 0" % (4 * j) for j in range(1, 10)]
    return lines + [way(rows(10, 2, 4, 2.5, 47.5))]


def main():
    if len(sys.argv) != 2:
        sys.exit(__doc__)
    for world in (comb, curve, hall, aisles):
        path = os.path.join(sys.argv[1], world.__name__ + ".world")
        with open(path, "w") as file:
            file.write("\n".join(world()) + "\n")


if __name__ == "__main__":
    main()
