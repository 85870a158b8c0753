#!/usr/bin/env python3
"""Writes worlds for plumbline_simulate in which there is little to see.

    bare.py FOLDER

writes parallel.world (two corridors of 80 m side by side, joined at their ends,
with a door to a room every 25 m and more), hall.world (a hall of 30 x 40 m with
nothing in it, driven round near its walls and across: for a laser that sees
8 m), glass.world (an L of 40 and 30 m whose outer side is of glass, which
returns nothing, between posts every 3 m) and plain.world (a straight corridor
of 60 m with rooms at its ends, driven there and back).
"""

from world_file import path, rectangle, wall, write_worlds


def row(y, begin, end, doors):
    """A wall along y with doors of 0.9 m at these places."""
    lines, at = [], begin
    for door in doors:
        lines.append(wall((at, y), (door - 0.45, y)))
        at = door + 0.45
    return lines + [wall((at, y), (end, y))]


def parallel():
    # Corridors along y = 0 and y = 10, 2 m wide; ends of 2 m join them.
    lines = rectangle(0, -1, 84, 12)
    lines += row(1, 2, 82, [27.0, 53.0]) + row(9, 2, 82, [40.0])
    lines += [wall((2, 1), (2, 9)), wall((82, 1), (82, 9)),
              wall((33, 1), (33, 9))]
    lap = [(1, 0), (27, 0), (27, 4), (27, 0), (83, 0), (83, 10), (40, 10),
           (40, 6), (40, 10), (1, 10)]
    return lines + [path(lap + lap + [(1, 0)])]


def hall():
    lines = rectangle(0, 0, 40, 30)
    points = [(3, 3), (37, 3), (37, 27), (3, 27), (3, 3), (37, 27), (37, 3),
              (3, 27), (3, 15), (37, 15), (37, 3), (3, 3)]
    return lines + [path(points)]


def glass():
    # Solid inner side, outer side of posts; both legs are 2.5 m wide.
    lines = [wall((0, 2.5), (37.5, 2.5)), wall((37.5, 2.5), (37.5, 32.5)),
             wall((0, 0), (0, 2.5)), wall((37.5, 32.5), (40, 32.5))]
    lines += ["box %.2f 0 0.12 0.12 0" % (3.0 * k) for k in range(1, 14)]
    lines += ["box 40 %.2f 0.12 0.12 0" % (3.0 * k) for k in range(0, 11)]
    points = [(1, 1.25), (38.75, 1.25), (38.75, 31), (38.75, 1.25), (1, 1.25)]
    return lines + [path(points)]


def plain():
    lines = [wall((0, 1), (60, 1)), wall((0, -1), (60, -1))]
    for x in (-5, 60):
        lines += [wall((x, -3), (x + 5, -3)), wall((x, 3), (x + 5, 3)),
                  wall((x if x < 0 else x + 5, -3), (x if x < 0 else x + 5, 3))]
    for x in (0, 60):
        lines += [wall((x, -3), (x, -1)), wall((x, 1), (x, 3))]
    points = [(-3, 0), (63, 0), (-3, 0), (63, 0)]
    return lines + [path(points)]


if __name__ == "__main__":
    write_worlds((parallel, hall, glass, plain), __doc__)
