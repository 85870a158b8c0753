#!/usr/bin/env python3
"""Makes the world of a round corridor for plumbline_simulate --world=FILE.

    rings.py ring RADIUS WIDTH SIDES NICHES LAPS > FILE
    rings.py ends RADIUS LAPS > FILE

ring: a corridor WIDTH m wide along a circle of RADIUS m, of SIDES walls each
side, with so many niches of 4 m to its outside, evenly spread. ends: two
straight corridors 40 m long and 2 m wide with niches of 1 m, whose ends are
joined by half circles of RADIUS m, of walls of 0.6 m. Driven round LAPS times.
"""

import math
import sys


def wall(a, b):
    print("wall %.4f %.4f %.4f %.4f 0.10" % (*a, *b))


def path(points):
    print("path " + " ".join("%.3f %.3f" % point for point in points))


def ring(radius, width, sides, niches, laps):
    sides, niches = int(sides), int(niches)

    def at(distance, side):
        angle = 2 * math.pi * side / sides
        return distance * math.cos(angle), distance * math.sin(angle)

    inside, outside = radius - width / 2, radius + width / 2
    with_niche = {int((n + 0.5) * sides / niches) for n in range(niches)}
    for side in range(sides):
        wall(at(inside, side), at(inside, side + 1))
        deep = outside + 4 if side in with_niche else outside
        wall(at(deep, side), at(deep, side + 1))
        if side in with_niche:
            wall(at(outside, side), at(deep, side))
            wall(at(deep, side + 1), at(outside, side + 1))
    steps = 60
    path([at(radius, sides * step / steps)
          for step in range(int(laps * steps) + 1)])


def ends(radius, laps):
    length, arc = 40.0, math.pi * radius

    def at(way, aside):
        """So far on the way, and so far to its right, m."""
        half = length + arc
        side = 1 if way % (2 * half) < half else -1
        here = way % half
        turned = max(0.0, here - length) / radius - math.pi / 2
        return (side * (min(here, length) - length / 2 +
                        (radius + aside) * math.cos(turned)),
                side * (radius + aside) * math.sin(turned))

    straight, curved = 40, round(arc / 0.6)
    way = 0.0
    for k in range(2 * (straight + curved)):
        is_straight = k % (straight + curved) < straight
        end = way + (length / straight if is_straight else arc / curved)
        # Just before the end, where the next piece may be of the other kind.
        last = end - 1e-9
        wall(at(way, -1), at(last, -1))
        is_niche = is_straight and k % 7 == 3
        deep = 2 if is_niche else 1
        wall(at(way, deep), at(last, deep))
        if is_niche:
            wall(at(way, 1), at(way, deep))
            wall(at(last, deep), at(last, 1))
        way = end
    path([at(0.5 + step, 0) for step in range(int(laps * way))])


def main():
    words = sys.argv[1:]
    shapes = {"ring": (ring, 5), "ends": (ends, 2)}
    if not words or words[0] not in shapes or \
            len(words) != shapes[words[0]][1] + 1:
        sys.exit(__doc__)
    try:
        numbers = [float(word) for word in words[1:]]
    except ValueError as failure:
        sys.exit("rings.py: %s\n%s" % (failure, __doc__))
    shapes[words[0]][0](*numbers)


if __name__ == "__main__":
    main()
