#!/usr/bin/env python3
"""Writes worlds for plumbline_simulate that bend by a little everywhere.

    slow.py FOLDER

writes corridors of 2 m between straight pieces of wall of 5 m, each turned
against the one before, driven there and back: slow_5.world (5 degrees over 100
m), slow_10.world (10 over 200 m), slow_20.world (20 over 200 m) and
slow_s.world (10 degrees to the left over 100 m, then 10 to the right). Every
third piece has a door to a room of 3.4 x 4 m on one side.
"""

import math

from world_file import path, wall, write_worlds

PIECE = 5.0
HALF = 1.0
ROOM = 4.0


def corridor(turns):
    """`turns`: of each piece against the one before it, degrees."""
    lines, angle = [], 0.0
    at = (0.0, 0.0)

    def beside(point, heading, along, across):
        c, s = math.cos(heading), math.sin(heading)
        return (point[0] + c * along - s * across,
                point[1] + s * along + c * across)

    joints = [at]
    angles = []
    for turn in turns:
        angle += math.radians(turn)
        at = beside(at, angle, PIECE, 0.0)
        joints.append(at)
        angles.append(angle)
    # Faces meet on the bisector of two pieces.
    mitres = []
    for i, joint in enumerate(joints):
        before = angles[max(0, i - 1)]
        after = angles[min(i, len(angles) - 1)]
        mitres.append((joint, 0.5 * (before + after),
                       math.cos(0.5 * (after - before))))
    for side in (-1.0, 1.0):
        ends = [beside(joint, middle, 0.0, side * HALF / cosine)
                for joint, middle, cosine in mitres]
        for i, (a, b) in enumerate(zip(ends, ends[1:])):
            if i % 3 != (0 if side > 0 else 1):
                lines.append(wall(a, b))
                continue
            heading, start = angles[i], joints[i]
            jambs = [beside(start, heading, along, side * HALF)
                     for along in (1.7, 2.6)]
            lines += [wall(a, jambs[0]), wall(jambs[1], b)]
            room = [beside(start, heading, along, side * across)
                    for along, across in ((0.8, HALF), (0.8, HALF + ROOM),
                                          (4.2, HALF + ROOM), (4.2, HALF))]
            lines += [wall(p, q) for p, q in zip(room, room[1:])]
    for joint, heading in ((joints[0], angles[0]), (joints[-1], angles[-1])):
        lines.append(wall(beside(joint, heading, 0.0, -HALF),
                          beside(joint, heading, 0.0, HALF)))
    first = beside(joints[0], angles[0], 1.0, 0.0)
    last = beside(joints[-1], angles[-1], -1.0, 0.0)
    way = [first] + joints[1:-1] + [last]
    return lines + [path(way + way[-2::-1])]


def slow_5():
    return corridor([0.25] * 20)


def slow_10():
    return corridor([0.25] * 40)


def slow_20():
    return corridor([0.5] * 40)


def slow_s():
    return corridor([0.5] * 20 + [-0.5] * 20)


if __name__ == "__main__":
    write_worlds([slow_5, slow_10, slow_20, slow_s], __doc__)
