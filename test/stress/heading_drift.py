#!/usr/bin/env python3
"""How the heading of a trajectory drifts against that of another one of the same scans.

    heading_drift.py TRAJECTORY.tum REFERENCE.tum

Prints, for windows of 1, 5, 20 and 60 m of way, mean and standard deviation of what the one turned more than the other, degrees,
and the mean of a metre.
"""

import math
import sys


def read(name):
    with open(name) as lines:
        rows = [[float(w) for w in line.split()] for line in lines if line.strip() and line[0] != "#"]
    return [(r[1], r[2], 2.0 * math.atan2(r[6], r[7])) for r in rows]


def main():
    if len(sys.argv) != 3:
        sys.exit(__doc__)
    poses, reference = read(sys.argv[1]), read(sys.argv[2])
    if len(poses) != len(reference):
        sys.exit("%d poses in the one, %d in the other: expected the same scans" % (len(poses), len(reference)))
    way, apart = [0.0], [0.0]
    for k in range(1, len(poses)):
        way.append(way[-1] + math.hypot(reference[k][0] - reference[k - 1][0], reference[k][1] - reference[k - 1][1]))
        turn = (poses[k][2] - poses[k - 1][2]) - (reference[k][2] - reference[k - 1][2])
        apart.append(apart[-1] + math.degrees(math.atan2(math.sin(turn), math.cos(turn))))
    for window in (1, 5, 20, 60):
        ends, k = [], 0
        for mark in range(0, int(way[-1]), window):
            while way[k] < mark:
                k += 1
            ends.append(apart[k])
        turns = [b - a for a, b in zip(ends, ends[1:])]
        if not turns:
            continue
        mean = sum(turns) / len(turns)
        sigma = math.sqrt(sum((t - mean) ** 2 for t in turns) / len(turns))
        print("%2d m: mean %+.3f, sigma %.3f degrees" % (window, mean, sigma))
    if way[-1] > 0.0:
        print("mean of a metre %+.4f degrees over %.0f m" % (apart[-1] / way[-1], way[-1]))


main()
