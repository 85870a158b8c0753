#!/usr/bin/env python3
"""Writes worlds for plumbline_simulate that are taken for each other easily.

    buildings.py FOLDER [--seed=1]

writes, each as driven one way (NAME_a.world) and the other way or another time
(NAME_b.world):

  corridor_0 ... 8   30 or 40 m, straight, shut doors in niches of 0.12, 0.25 or
                     0.4 m, at places drawn at random
  bend_0 ... 3       the same round a corner, two by two with the same legs
  rows_0 ... 5       rooms along both sides of a corridor; those of one side are
                     the mirror images of those of the other but for one to three
                     doors, 0.7 or 1.5 m elsewhere
  twin_0 ... 5       rows_0 ... 5, but without doors elsewhere: as the next floor
                     of a house may be

and pairs.txt: a line "KIND A B" for each pair, with "same" for what is one
building, "other" for two buildings, and for B "~NAME" where the log of NAME is to
be mirrored (vary.py), which makes another building of it.
"""

import argparse
import itertools
import os
import random

from world_file import path, wall


def niched(a, b, side, niches, depth):
    """A wall from a to b with shut doors of 0.9 m at these distances from a,
    set back to a side."""
    length = max(abs(b[0] - a[0]), abs(b[1] - a[1]))
    along = ((b[0] - a[0]) / length, (b[1] - a[1]) / length)
    across = (-along[1] * side * depth, along[0] * side * depth)

    def at(distance, is_deep):
        point = (a[0] + along[0] * distance, a[1] + along[1] * distance)
        return (point[0] + across[0], point[1] + across[1]) if is_deep else point

    lines, begin = [], 0.0
    for niche in niches:
        first, last = niche - 0.45, niche + 0.45
        lines += [wall(at(begin, False), at(first, False)),
                  wall(at(first, False), at(first, True)),
                  wall(at(first, True), at(last, True)),
                  wall(at(last, True), at(last, False))]
        begin = last
    return lines + [wall(at(begin, False), at(length, False))]


def places(random_, length):
    """Of doors along a wall."""
    at, chosen = 1.2, []
    while True:
        at += random_.uniform(1.5, 6.0)
        if at > length - 1.2:
            return chosen
        chosen.append(at)


def corridor(random_, length, depth):
    lines = [wall((0, -1), (0, 1)), wall((length, -1), (length, 1))]
    for side in (1, -1):
        lines += niched((0, side), (length, side), side, places(random_, length),
                        depth)
    way = [(1.0, 0.0), (length - 1.0, 0.0)]
    return lines, way, way[::-1]


def bend(random_, length, depth):
    """An L: along x, then up."""
    end = (length + 2.0, length - 1.0)
    lines = [wall((0, -1), (0, 1)), wall((length, end[1]), end)]
    lines += niched((0, -1), (end[0], -1), -1, places(random_, end[0]), depth)
    lines += niched((0, 1), (length, 1), 1, places(random_, length), depth)
    lines += niched((length, 1), (length, end[1]), 1,
                    places(random_, end[1] - 1.0), depth)
    lines += niched((end[0], -1), end, -1, places(random_, length), depth)
    way = [(1.0, 0.0), (length + 1.0, 0.0), (length + 1.0, end[1] - 1.0)]
    return lines, way, way[::-1]


def rows(random_, moved, by):
    ends = [0.0]
    for _ in range(6):
        ends.append(ends[-1] + random_.uniform(4.5, 7.2))
    doors = [a + random_.uniform(1.2, b - a - 3.0)
             for a, b in zip(ends, ends[1:])]
    shelves = [(random_.uniform(4.8, 5.6), random_.uniform(1.0, 2.4))
               for _ in range(6)]
    others = set(random_.sample(range(6), moved))
    lines = [wall((0, -6.1), (0, 6.1)), wall((ends[-1], -6.1), (ends[-1], 6.1))]
    way, begin = [(1.0, 0.0)], {1: 0.0, -1: 0.0}
    for room in range(6):
        for side in (1, -1):
            door = doors[room] + (by if side < 0 and room in others else 0.0)
            lines.append(wall((begin[side], 1.1 * side), (door - 0.45, 1.1 * side)))
            begin[side] = door + 0.45
            if room > 0:
                lines.append(wall((ends[room], 1.1 * side), (ends[room], 6.1 * side)))
            at, length = shelves[room]
            lines.append(wall((ends[room] + 0.5, at * side),
                              (ends[room] + 0.5 + length, at * side)))
            if room % 2 == 0:
                middle = 0.5 * (ends[room] + ends[room + 1])
                way += [(x, y * side) for x, y in
                        ((door, 0.0), (door, 2.6), (middle, 3.6), (door, 2.6),
                         (door, 0.0))]
    for side in (1, -1):
        lines += [wall((begin[side], 1.1 * side), (ends[-1], 1.1 * side)),
                  wall((0, 6.1 * side), (ends[-1], 6.1 * side))]
    way.append((ends[-1] - 1.0, 0.0))
    return lines, way, way


def main():
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder")
    parser.add_argument("--seed", type=int, default=1)
    args = parser.parse_args()
    random_ = random.Random(args.seed)
    worlds = {}
    for i in range(9):
        worlds["corridor_%d" % i] = corridor(
            random_, (30.0, 40.0)[i % 2], (0.12, 0.25, 0.4)[i // 3])
    for i in range(4):
        worlds["bend_%d" % i] = bend(random_, 18.0 + 5.0 * (i // 2),
                                     (0.12, 0.25, 0.25, 0.4)[i])
    for i in range(6):
        for name, moved in (("rows", 1 + i % 3), ("twin", 0)):
            worlds["%s_%d" % (name, i)] = rows(
                random.Random(100 * args.seed + i), moved, (0.7, 1.5)[i // 3])
    for name, (lines, there, back) in worlds.items():
        for letter, way in (("a", there), ("b", back)):
            file = os.path.join(args.folder, "%s_%s.world" % (name, letter))
            with open(file, "w") as world:
                world.write("\n".join(lines + [path(way)]) + "\n")
    pairs = [("same", name + "_a", name + "_b") for name in worlds]
    corridors = [name for name in worlds if name.startswith("corridor")]
    bends = [name for name in worlds if name.startswith("bend")]
    for a, b in list(itertools.combinations(corridors, 2))[::2]:
        pairs += [("other", a + "_a", b + "_b")]
    for a, b in itertools.combinations(bends, 2):
        pairs += [("other", a + "_a", b + "_a")]
    pairs += [("other", "rows_%d_a" % i, "twin_%d_b" % i) for i in range(6)]
    # The mirror image of a twin is the twin.
    for name in worlds:
        if not name.startswith("twin"):
            pairs += [("other", name + "_a", "~" + name + "_b")]
    with open(os.path.join(args.folder, "pairs.txt"), "w") as file:
        file.write("".join("%s %s %s\n" % pair for pair in pairs))


if __name__ == "__main__":
    main()
