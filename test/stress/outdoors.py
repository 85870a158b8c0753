#!/usr/bin/env python3
"""Writes worlds for plumbline_simulate of which a plan has one room, or none.

    outdoors.py FOLDER

writes room.world, corridor.world, open_corridor.world (its ends are open),
nothing.world (no returns at all), trees.world, poles.world, cars.world (two
rows of parked cars) and street.world (two rows of houses with alleys).
"""

import random

from world_file import path, rectangle, wall, write_worlds

SQUARE = [(0, 0), (20, 0), (20, 15), (0, 15), (0, 0)]


def room():
    return rectangle(0, 0, 6, 5) + [
        path([(1, 1), (5, 1), (5, 4), (1, 4), (1, 1), (5, 4)])]


def corridor():
    return rectangle(0, -1, 40, 2) + [path([(1, 0), (39, 0), (1, 0)])]


def open_corridor():
    return [wall((0, -1), (40, -1)), wall((0, 1), (40, 1)),
            path([(1, 0), (39, 0), (1, 0)])]


def nothing():
    return [wall((200, 200), (201, 200)), path(SQUARE)]


def trees():
    dice = random.Random(3)
    lines = []
    while len(lines) < 70:
        x, y = dice.uniform(-25, 45), dice.uniform(-25, 40)
        # Not on the way.
        if min(abs(y), abs(y - 15)) > 1.5 and min(abs(x), abs(x - 20)) > 1.5:
            lines.append("circle %.3f %.3f %.3f" %
                         (x, y, dice.uniform(0.08, 0.35)))
    return lines + [path(SQUARE)]


def poles():
    return ["circle %d %d 0.06" % (x, y) for x in range(-20, 41, 4)
            for y in (-3, 18)] + [path(SQUARE)]


def cars():
    dice = random.Random(3)
    lines = []
    for y in (4, -9):
        for i in range(10):
            lines += rectangle(-10 + 3.0 * i, y + dice.uniform(-0.2, 0.2), 1.8,
                               4.4)
    return lines + [path([(-12, 0), (22, 0), (22, 11), (-12, 11), (-12, 0),
                          (22, 0)])]


def street():
    dice = random.Random(3)
    lines = []
    for y in (9, -18):
        x = -30.0
        while x < 60.0:
            width = dice.uniform(8, 16)
            lines += rectangle(x, y + dice.uniform(-1, 1), width, 8)
            x += width + dice.uniform(2, 6)
    return lines + [path([(-25, 0), (50, 0), (50, 3), (-25, 3)])]


if __name__ == "__main__":
    write_worlds((room, corridor, open_corridor, nothing, trees, poles, cars,
                  street), __doc__)
