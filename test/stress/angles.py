#!/usr/bin/env python3
"""Writes worlds for plumbline_simulate whose walls meet at other angles than right ones.

    angles.py FOLDER

writes NAME_ANGLE_SEED.world for seeds 1 and 2:

  quad    a corridor with niches round a block whose corners are off by up to 2, 5 or 10 degrees, twice
  two     two wings of ten rooms that meet at 1.5, 4, 8 or -25 degrees, there and back
  skewed  fourteen rooms along a corridor, between walls that are off by up to 3 or 6 degrees
  fan     sixteen rooms along a corridor that turns by 1.5, 3 or 6 degrees at each pair of them
  racks   a store of equal racks in rows
  poly    a corridor with niches along a regular polygon of 5, 7 or 9 sides, twice
"""

import math
import os
import random
import sys

from world_file import path, rectangle, wall

DOOR = 0.9
HALF = 1.1  # of a corridor


def between(a, b, share):
    return a[0] + (b[0] - a[0]) * share, a[1] + (b[1] - a[1]) * share


def length(a, b):
    return math.hypot(b[0] - a[0], b[1] - a[1])


def normal(a, b):
    far = length(a, b)
    return -(b[1] - a[1]) / far, (b[0] - a[0]) / far


def moved(a, direction, by):
    return a[0] + direction[0] * by, a[1] + direction[1] * by


def pierced(a, b, doors):
    """A wall from a to b without the doors, m from a."""
    far, at, lines = length(a, b), 0.0, []
    for door in sorted(doors):
        if door - DOOR / 2 <= at or door + DOOR / 2 >= far:
            continue
        lines.append(wall(between(a, b, at / far), between(a, b, (door - DOOR / 2) / far)))
        at = door + DOOR / 2
    return lines + [wall(between(a, b, at / far), b)]


def niched(a, b, doors, direction, depth):
    """A wall from a to b with shut doors set back along a direction."""
    far, at, lines = length(a, b), 0.0, []
    for door in doors:
        first = between(a, b, (door - DOOR / 2) / far)
        last = between(a, b, (door + DOOR / 2) / far)
        deep_first, deep_last = moved(first, direction, depth), moved(last, direction, depth)
        lines += [wall(between(a, b, at / far), first), wall(first, deep_first), wall(deep_first, deep_last),
                  wall(deep_last, last)]
        at = door + DOOR / 2
    return lines + [wall(between(a, b, at / far), b)]


class Wing:
    """A corridor along x, seen from `origin` turned by `angle`, with `count` rooms on both sides."""

    def __init__(self, origin, angle, count, width, depth, half, draw, slant=0.0):
        self.origin, self.cosine, self.sine = origin, math.cos(angle), math.sin(angle)
        self.end, self.depth, self.half = count * width, depth, half
        self.lines, self.doors = [], {}
        for side in (1, -1):
            doors = [width * (k + draw.uniform(.25, .75)) for k in range(count)]
            self.doors[side] = sorted(doors)
            near, far = side * half, side * (half + depth)
            self.lines += pierced(self.at(0, near), self.at(self.end, near), doors)
            self.lines.append(wall(self.at(0, far), self.at(self.end, far)))
            for k in range(count + 1):
                off = math.tan(math.radians(draw.uniform(-slant, slant))) * depth if 0 < k < count else 0
                self.lines.append(wall(self.at(k * width, near), self.at(k * width + off, far)))

    def at(self, x, y):
        return (self.origin[0] + self.cosine * x - self.sine * y, self.origin[1] + self.sine * x + self.cosine * y)

    def shut(self, x):
        return wall(self.at(x, self.half), self.at(x, -self.half))

    def visit(self, x, side, share):
        return [self.at(x, 0), self.at(x, side * (self.half + self.depth * share)), self.at(x, 0)]


def quad(draw, off):
    a, b = draw.uniform(20, 35), draw.uniform(14, 25)

    def tangent():
        return math.tan(math.radians(draw.uniform(-off, off)))

    corners = [(0, 0), (a, a * tangent()), (a + b * tangent(), b), (b * tangent(), b + a * tangent())]

    def inset(by):
        points = []
        for i in range(4):
            before, corner, after = corners[i - 1], corners[i], corners[(i + 1) % 4]
            lines = []
            for first, second in ((before, corner), (corner, after)):
                n = normal(first, second)
                lines.append((n, n[0] * first[0] + n[1] * first[1] + by))
            (n, c), (m, d) = lines
            det = n[0] * m[1] - n[1] * m[0]
            points.append(((c * m[1] - d * n[1]) / det, (n[0] * d - m[0] * c) / det))
        return points

    lines = []
    for by, side in ((HALF, 1), (-HALF, -1)):
        points = inset(by)
        for i in range(4):
            first, second = points[i], points[(i + 1) % 4]
            far, at, doors = length(first, second), draw.uniform(1.5, 4), []
            while at < far - 2:
                doors.append(at)
                at += draw.uniform(2.5, 6)
            lines += niched(first, second, doors, normal(first, second), .25 * side)
    return lines + [path(corners + corners + corners[:1])]


def two(draw, angle):
    width, other_width = draw.uniform(3.5, 5), draw.uniform(3.5, 5)
    depth, other_depth = draw.uniform(3.5, 5.5), draw.uniform(3.5, 5.5)
    one = Wing((0, 0), 0, 5, width, depth, HALF, draw)
    other = Wing((one.end + 2.5, 0), math.radians(angle), 5, other_width, other_depth, HALF, draw)
    lines = one.lines + other.lines
    for side in (1, -1):
        lines.append(wall(one.at(one.end, side * HALF), other.at(0, side * HALF)))
    lines += [one.shut(0), other.shut(other.end)]
    way = [one.at(1, 0)]
    for door in one.doors[1][::2]:
        way += one.visit(door, 1, .45)
    for door in other.doors[-1][::2]:
        way += other.visit(door, -1, .45)
    way.append(other.at(other.end - 1, 0))
    for door in other.doors[1][::-2]:
        way += other.visit(door, 1, .45)
    for door in one.doors[-1][::-2]:
        way += one.visit(door, -1, .45)
    return lines + [path(way + [one.at(1, 0)])]


def skewed(draw, slant):
    width, depth = draw.uniform(3.5, 5), draw.uniform(4, 6)
    wing = Wing((0, 0), 0, 7, width, depth, 1.0, draw, slant)
    way = [wing.at(1, 0)]
    for door in wing.doors[1]:
        way += wing.visit(door, 1, .5)
    way.append(wing.at(wing.end - 1, 0))
    for door in wing.doors[-1][::-1]:
        way += wing.visit(door, -1, .5)
    return wing.lines + [wing.shut(0), wing.shut(wing.end), path(way + [wing.at(1, 0)])]


def fan(draw, turn):
    width, depth, count = draw.uniform(3.5, 5), draw.uniform(4, 5.5), 8
    points, heading, headings = [(0, 0)], 0.0, []
    for _ in range(count):
        headings.append(heading)
        points.append(moved(points[-1], (math.cos(heading), math.sin(heading)), width))
        heading += math.radians(turn)
    across = []
    for k in range(count + 1):
        here = headings[max(k - 1, 0):k + 1]
        mean = sum(here) / len(here)
        across.append((-math.sin(mean), math.cos(mean)))

    def at(k, aside):
        return moved(points[k], across[k], aside)

    lines, doors = [], {1: [], -1: []}
    for side in (1, -1):
        for k in range(count):
            a, b = at(k, side * HALF), at(k + 1, side * HALF)
            door = draw.uniform(.3, .7)
            lines += pierced(a, b, [door * length(a, b)])
            lines.append(wall(at(k, side * (HALF + depth)), at(k + 1, side * (HALF + depth))))
            doors[side].append((k, door))
        lines += [wall(at(k, side * HALF), at(k, side * (HALF + depth))) for k in range(count + 1)]
    lines += [wall(at(k, HALF), at(k, -HALF)) for k in (0, count)]

    def visit(side, k, share):
        out = between(at(k, 0), at(k + 1, 0), share)
        aside = side * (HALF + depth * .5)
        return [out, between(at(k, aside), at(k + 1, aside), share), out]

    begin = between(at(0, 0), at(1, 0), .2)
    way = [begin]
    for k, door in doors[1]:
        way += visit(1, k, door)
    way.append(between(at(count - 1, 0), at(count, 0), .8))
    for k, door in doors[-1][::-1]:
        way += visit(-1, k, door)
    return lines + [path(way + [begin])]


def racks(draw, _):
    columns, rows, deep = 3, 5, 1.0
    wide, lane = draw.uniform(6, 9), draw.uniform(2, 2.8)
    right, top = columns * (wide + lane) + lane, rows * (deep + lane) + lane
    lines = rectangle(0, 0, right, top)
    for i in range(columns):
        for j in range(rows):
            lines += rectangle(lane + i * (wide + lane), lane + j * (deep + lane), wide, deep)
    way = []
    for j in range(rows + 1):
        ends = (lane / 2, right - lane / 2)
        way += [(ends[(j + k) % 2], lane / 2 + j * (deep + lane)) for k in (0, 1)]
    is_right = way[-1][0] > right / 2
    for i in range(columns + 1):
        x = lane / 2 + i * (wide + lane)
        ends = (top - lane / 2, lane / 2)
        way += [(right - x if is_right else x, ends[(i + k) % 2]) for k in (0, 1)]
    return lines + [path(way)]


def poly(draw, sides):
    radius, lines = draw.uniform(12, 18), []

    def ring(distance):
        return [(distance * math.cos(2 * math.pi * k / sides) / math.cos(math.pi / sides),
                 distance * math.sin(2 * math.pi * k / sides) / math.cos(math.pi / sides)) for k in range(sides)]

    for distance, side in ((radius - HALF, 1), (radius + HALF, -1)):
        corners = ring(distance)
        for k in range(sides):
            a, b = corners[k], corners[(k + 1) % sides]
            lines += niched(a, b, [draw.uniform(.2, .8) * length(a, b)], normal(a, b), .3 * side)
    corners = ring(radius)
    return lines + [path(corners + corners + corners[:1])]


WORLDS = {quad: (2, 5, 10), two: (1.5, 4, 8, -25), skewed: (3, 6), fan: (1.5, 3, 6), racks: (0,), poly: (5, 7, 9)}


def main():
    if len(sys.argv) != 2:
        sys.exit(__doc__)
    for world, angles in WORLDS.items():
        for angle in angles:
            for seed in (1, 2):
                name = "%s_%g_%d.world" % (world.__name__, angle, seed)
                with open(os.path.join(sys.argv[1], name), "w") as file:
                    file.write("\n".join(world(random.Random(seed * 100 + 7), angle)) + "\n")


main()
