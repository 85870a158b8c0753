#!/usr/bin/env python3
"""Plans of buildings whose rooms are round or have six sides.

    round_rooms.py FOLDER --bin=DIR [--kinds=round,apse,hexagons]
                   [--radii=2.4,2.9,3.4] [--seeds=1,2]

round: four rooms on each side of a corridor, with a door of 1 m. apse: three
rooms on each side with a half circle for a back wall, and a table and a column
in each. hexagons: nine rooms beside each other, with a door of 0.9 m to one or
two neighbours. RADIUS: of the rooms, m; of hexagons the length of a side. Each
world is driven through once with another seed, mapped with the defaults, and
the rooms of its plan are counted that overlap a true one by nine tenths of what
both cover. Prints a line a log.
"""

import argparse
import json
import math
import os
import subprocess
import sys

from world_file import path, wall


def pieces(points):
    return [wall(a, b) for a, b in zip(points, points[1:])]


def arc(center, radius, begin, end, sides):
    return [(center[0] + radius * math.cos(begin + (end - begin) * i / sides),
             center[1] + radius * math.sin(begin + (end - begin) * i / sides))
            for i in range(sides + 1)]


def pierced(begin, end, y, doors, width):
    """A wall along x with doorways, and these."""
    lines = []
    last = begin
    for x in doors:
        lines.append(wall((last, y), (x - width / 2, y)))
        lines.append("doorway %.4f %.4f %.4f %.4f 0.12" %
                     (x - width / 2, y, x + width / 2, y))
        last = x + width / 2
    return lines + [wall((last, y), (end, y))]


def along_corridor(doors, end, room):
    """Lines, way and true rooms of a corridor with rooms on both sides; `room`
    gives the lines, outline and middle of the one at a door, above y = 0."""
    lines = [wall((0, -1.1), (0, 1.1)), wall((end, -1.1), (end, 1.1))]
    way = [(0.5, 0.0)]
    rooms = [[(0, -1.1), (end, -1.1), (end, 1.1), (0, 1.1)]]
    for side in (1, -1):
        lines += pierced(0, end, side * 1.1, doors, 1.0)
        for x in doors if side > 0 else doors[::-1]:
            inside, outline, middle = room(x)
            lines += pieces([(x, side * y) for x, y in inside[0]])
            for more in inside[1:]:
                lines += pieces([(x, side * y) for x, y in more])
            rooms.append([(x, side * y) for x, y in outline])
            way += [(x, 0.0), (middle[0], side * middle[1]), (x, 0.0)]
    return lines, way + [(0.8, 0.0)], rooms


def round_rooms(radius):
    def room(x):
        half = math.asin(0.5 / radius)
        center = (x, 1.1 + radius)
        inside = arc(center, radius, half - math.pi / 2,
                     1.5 * math.pi - half, 40)
        return [inside], inside, center
    return along_corridor([4.0 + 8.0 * i for i in range(4)], 32.0, room)


def apses(radius):
    def room(x):
        center = (x, 1.1 + radius + 1.0)
        outline = ([(x + radius, 1.1)] + arc(center, radius, 0, math.pi, 30) +
                   [(x - radius, 1.1)])
        table = arc((x - 0.4 * radius, center[1] + 0.2), 0.6, 0, 2 * math.pi, 16)
        column = arc((x + 0.5 * radius, 2.4), 0.3, 0, 2 * math.pi, 12)
        return [outline, table, column], outline, (x + 0.3, center[1] + 0.3)
    return along_corridor([4.0 + 8.0 * i for i in range(3)], 24.0, room)


def hexagons(side):
    """Rooms by columns and rows, from each to the next a door."""
    apothem = math.sqrt(3) / 2 * side

    def center(column, row):
        return (1.5 * side * column, 2 * apothem * row + apothem * (column % 2))

    order = [(0, 0), (0, 1), (0, 2), (1, 2), (1, 1), (1, 0), (2, 0), (2, 1),
             (2, 2)]
    lines, rooms, way, drawn = [], [], [], {}
    for cell in order:
        corners = arc(center(*cell), side, 0, 2 * math.pi, 6)
        rooms.append(corners[:-1])
        for a, b in zip(corners, corners[1:]):
            middle = (round((a[0] + b[0]) / 2, 3), round((a[1] + b[1]) / 2, 3))
            drawn[middle] = (a, b)
    middles = [center(*cell) for cell in order]
    through = {(round((a[0] + b[0]) / 2, 3), round((a[1] + b[1]) / 2, 3))
               for a, b in zip(middles, middles[1:])}
    for middle, (a, b) in drawn.items():
        if middle not in through:
            lines.append(wall(a, b))
            continue
        along = ((b[0] - a[0]) / side, (b[1] - a[1]) / side)
        jambs = [(middle[0] + s * 0.45 * along[0],
                  middle[1] + s * 0.45 * along[1]) for s in (-1, 1)]
        lines += [wall(a, jambs[0]), wall(jambs[1], b),
                  "doorway %.4f %.4f %.4f %.4f 0.12" % (*jambs[0], *jambs[1])]
    way = middles + middles[::-1]
    return lines, way, rooms


KINDS = {"round": round_rooms, "apse": apses, "hexagons": hexagons}


def contains(ring, point):
    inside = False
    for (x1, y1), (x2, y2) in zip(ring, ring[1:] + ring[:1]):
        if (y1 > point[1]) != (y2 > point[1]) and point[0] < (
                (x2 - x1) * (point[1] - y1) / (y2 - y1) + x1):
            inside = not inside
    return inside


def overlap(a, b, step=0.1):
    """Over union of two rings, by a raster."""
    xs = [p[0] for p in a + b]
    ys = [p[1] for p in a + b]
    both = either = 0
    for i in range(int((max(xs) - min(xs)) / step) + 1):
        for k in range(int((max(ys) - min(ys)) / step) + 1):
            point = (min(xs) + i * step + 0.013, min(ys) + k * step + 0.017)
            in_a, in_b = contains(a, point), contains(b, point)
            both += in_a and in_b
            either += in_a or in_b
    return both / max(1, either)


def middle_of(ring):
    return (sum(p[0] for p in ring) / len(ring),
            sum(p[1] for p in ring) / len(ring))


def run(*command):
    done = subprocess.run(command, capture_output=True, text=True)
    if done.returncode != 0:
        sys.exit(" ".join(command) + ": " + done.stderr)


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("folder")
    parser.add_argument("--bin", required=True)
    parser.add_argument("--kinds", default="round,apse,hexagons")
    parser.add_argument("--radii", default="2.4,2.9,3.4")
    parser.add_argument("--seeds", default="1,2")
    arguments = parser.parse_args()
    os.makedirs(arguments.folder, exist_ok=True)
    for kind in arguments.kinds.split(","):
        for radius in arguments.radii.split(","):
            lines, way, rooms = KINDS[kind](float(radius))
            for seed in arguments.seeds.split(","):
                name = os.path.join(arguments.folder,
                                    "%s_%s_%s" % (kind, radius, seed))
                with open(name + ".world", "w") as file:
                    file.write("\n".join(lines + [path(way)]) + "\n")
                run(arguments.bin + "/plumbline_simulate",
                    "--world=" + name + ".world", "--seed=" + seed,
                    "--output=" + name + ".clf", "--truth=" + name + ".json")
                run(arguments.bin + "/plumbline_solve",
                    "--input=" + name + ".clf", "--output_dir=" + name,
                    "--outputs=trajectory.tum,floorplan.geojson", "--quiet")
                with open(name + ".json") as file:
                    start = json.load(file)["poses"][0]
                print(kind, radius, "seed", seed + ":",
                      count(name, rooms, start), flush=True)


def count(name, rooms, start):
    """The plan's frame is that of odometry, which begins at the origin."""
    with open(os.path.join(name, "trajectory.tum")) as file:
        words = [float(word) for word in file.readline().split()]
    heading = 2 * math.atan2(words[6], words[7])
    turn = start[3] - heading
    cosine, sine = math.cos(turn), math.sin(turn)

    def placed(point):
        x, y = point[0] - words[1], point[1] - words[2]
        return (start[1] + cosine * x - sine * y, start[2] + sine * x + cosine * y)

    with open(os.path.join(name, "floorplan.geojson")) as file:
        features = json.load(file)["features"]
    plan = [[placed(p) for p in f["geometry"]["coordinates"][0][:-1]]
            for f in features if f["properties"]["kind"] in ("room", "corridor")]
    doors = sum(f["properties"]["kind"] == "door" for f in features)
    found = sum(any(contains(ring, middle_of(room)) and
                    overlap(room, ring) >= 0.9 for ring in plan)
                for room in rooms)
    return "%d of %d rooms, %d in the plan, %d doors" % (found, len(rooms),
                                                         len(plan), doors)


if __name__ == "__main__":
    main()
