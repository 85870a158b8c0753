#!/usr/bin/env python3
"""Makes of a CARMEN log and its relations what another robot would have recorded on the same way.

    vary.py LOG RELATIONS OUT.clf OUT.relations KIND [VALUE] [--seed=1]

Relations stay true; those whose scans are gone are left out. Kinds, with what VALUE is and without it:

  mirror      left and right exchanged
  reverse     the last scan first: the robot drives the way backwards
  every       one scan in VALUE (3)
  noise       normal noise on the ranges, VALUE m (0.03)
  steps       ranges in steps of VALUE m (0.05)
  spikes      a share VALUE (0.05) of the returns lies anywhere before where it was
  holes       a share VALUE (0.2) of the returns is missing
  near        what lies VALUE m (6) away or farther returns nothing
  beams       one beam in VALUE (2), from the first one on
  view        beams of the middle VALUE degrees (120) of a laser of 180; told by --laser_start_angle=-VALUE/2
              --laser_step=STEP with the step of the log
  long        ranges times VALUE (1.01)
  offset      all ranges are VALUE m (0.05) too long
  askew       odometry says that the robot drives VALUE degrees (1.5) to the right of where it does
  drift       odometry turns by VALUE degrees (1) a metre to the left
  slip        in one step of odometry of twenty the robot turned VALUE degrees (5) more than it says, or less
  wheels      normal noise on each step of odometry, a share VALUE (0.2) of it
  still       odometry says nothing at all
  late        odometry is VALUE scans (2) late
  gaps        four stretches of VALUE scans (100) are missing; odometry goes on
  rolled      four stretches of 100 scans are missing, and odometry tells of up to VALUE m (0.8) and 60 degrees by chance:
              the robot was carried, and its wheels were turned
"""

import bz2
import gzip
import math
import random
import sys

DEFAULTS = {"mirror": 0, "reverse": 0, "every": 3, "noise": 0.03, "steps": 0.05, "spikes": 0.05, "holes": 0.2, "near": 6.0, "beams": 2, "view": 120.0,
            "long": 1.01, "offset": 0.05, "askew": 1.5, "drift": 1.0, "slip": 5.0, "wheels": 0.2, "still": 0, "late": 2,
            "gaps": 100, "rolled": 0.8}
NO_RETURN = 81.83


def norm(angle):
    return math.atan2(math.sin(angle), math.cos(angle))


def compose(p, q):
    c, s = math.cos(p[2]), math.sin(p[2])
    return (p[0] + c * q[0] - s * q[1], p[1] + s * q[0] + c * q[1], norm(p[2] + q[2]))


def between(p, q):
    c, s = math.cos(p[2]), math.sin(p[2])
    x, y = q[0] - p[0], q[1] - p[1]
    return (c * x + s * y, -s * x + c * y, norm(q[2] - p[2]))


class Scan:
    def __init__(self, words):
        count = int(words[1])
        self.ranges = [float(w) for w in words[2:2 + count]]
        values = [float(w) for w in words[2 + count:8 + count]]
        self.odometry = tuple(values[3:6])
        self.laser = between(self.odometry, tuple(values[:3]))
        self.time = words[8 + count]

    def text(self):
        pose = compose(self.odometry, self.laser)
        return " ".join(["FLASER", str(len(self.ranges))] + ["%.3f" % r for r in self.ranges] +
                        ["%.6f" % v for v in pose + self.odometry] + [self.time, "robot", self.time])


def on_ranges(scans, change):
    for scan in scans:
        scan.ranges = [change(r) if 0.0 < r < NO_RETURN - 1.0 else r for r in scan.ranges]


def on_steps(scans, change):
    steps = [between(a.odometry, b.odometry) for a, b in zip(scans, scans[1:])]
    for k, step in enumerate(steps):
        scans[k + 1].odometry = compose(scans[k].odometry, change(k, step))


def between_scans(scans, relations):
    """The relations between scans that are there."""
    there = {round(float(scan.time), 4) for scan in scans}
    return [r for r in relations if all(round(float(t), 4) in there for t in r[:2])]


def main():
    arguments = [a for a in sys.argv[1:] if not a.startswith("--seed=")]
    seed = [a[7:] for a in sys.argv[1:] if a.startswith("--seed=")]
    if len(arguments) not in (5, 6) or arguments[4] not in DEFAULTS:
        sys.exit(__doc__)
    source, truth, target, target_truth, kind = arguments[:5]
    value = float(arguments[5]) if len(arguments) == 6 else DEFAULTS[kind]
    rnd = random.Random("%s %s" % (kind, seed[0] if seed else "1"))
    opener = {"bz2": bz2.open, ".gz": gzip.open}.get(source[-3:], open)
    with opener(source, "rt", errors="replace") as log:
        scans = [Scan(line.split()) for line in log if line.startswith("FLASER ")]
    with open(truth) as lines:
        relations = [line.split() for line in lines if line.strip()]

    if kind == "mirror":
        def flip(p):
            return (p[0], -p[1], -p[2])
        for scan in scans:
            scan.ranges.reverse()
            scan.odometry, scan.laser = flip(scan.odometry), flip(scan.laser)
        for r in relations:
            r[3], r[7] = repr(-float(r[3])), repr(-float(r[7]))
    elif kind == "reverse":
        total = float(scans[0].time) + float(scans[-1].time)
        again = {scan.time: "%.6f" % (total - float(scan.time)) for scan in scans}
        near = {round(float(t), 4): new for t, new in again.items()}
        for scan in scans:
            scan.time = again[scan.time]
        scans.reverse()
        for r in relations:
            r[0], r[1] = (near.get(round(float(t), 4), "%.6f" % (total - float(t))) for t in r[:2])
    elif kind == "every":
        scans = scans[::int(value)]
        relations = between_scans(scans, relations)
    elif kind == "noise":
        on_ranges(scans, lambda r: max(0.02, rnd.gauss(r, value)))
    elif kind == "steps":
        on_ranges(scans, lambda r: max(value, value * round(r / value)))
    elif kind == "spikes":
        on_ranges(scans, lambda r: rnd.uniform(0.1, max(r, 0.2)) if rnd.random() < value else r)
    elif kind == "holes":
        on_ranges(scans, lambda r: NO_RETURN if rnd.random() < value else r)
    elif kind == "near":
        on_ranges(scans, lambda r: NO_RETURN if r >= value else r)
    elif kind == "beams":
        for scan in scans:
            scan.ranges = scan.ranges[::int(value)]
    elif kind == "view":
        for scan in scans:
            cut = round(len(scan.ranges) * (180.0 - value) / 360.0)
            scan.ranges = scan.ranges[cut:len(scan.ranges) - cut]
    elif kind == "long":
        on_ranges(scans, lambda r: value * r)
    elif kind == "offset":
        on_ranges(scans, lambda r: max(0.02, r + value))
    elif kind == "askew":
        c, s = math.cos(math.radians(value)), math.sin(math.radians(value))
        on_steps(scans, lambda k, p: (c * p[0] + s * p[1], -s * p[0] + c * p[1], p[2]))
    elif kind == "drift":
        on_steps(scans, lambda k, p: (p[0], p[1], p[2] + math.radians(value) * math.hypot(p[0], p[1])))
    elif kind == "slip":
        on_steps(scans, lambda k, p: (p[0], p[1], p[2] + (math.radians(rnd.choice((-value, value)))
                                                          if rnd.random() < 0.05 else 0.0)))
    elif kind == "wheels":
        on_steps(scans, lambda k, p: tuple(v + rnd.gauss(0.0, value * abs(v)) for v in p))
    elif kind == "still":
        for scan in scans:
            scan.odometry = (0.0, 0.0, 0.0)
    elif kind == "late":
        odometry = [scan.odometry for scan in scans]
        for k, scan in enumerate(scans):
            scan.odometry = odometry[max(0, k - int(value))]
    elif kind in ("gaps", "rolled"):
        size, begins = int(value) if kind == "gaps" else 100, []
        for _ in range(10000):
            begin = rnd.randrange(30, max(31, len(scans) - size - 30))
            if len(begins) < 4 and all(abs(begin - other) > 2 * size for other in begins):
                begins.append(begin)
        if kind == "rolled":
            ends = {begin + size - 1 for begin in begins}
            within = {k for begin in begins for k in range(begin - 1, begin + size - 1)}
            on_steps(scans, lambda k, p: (rnd.uniform(0.0, value), 0.0, math.radians(rnd.uniform(-60.0, 60.0))) if k in ends
                     else (0.0, 0.0, 0.0) if k in within else p)
        scans = [scan for k, scan in enumerate(scans) if not any(begin <= k < begin + size for begin in begins)]
        relations = between_scans(scans, relations)

    with open(target, "w") as out:
        out.write("\n".join(scan.text() for scan in scans) + "\n")
    with open(target_truth, "w") as out:
        out.write("\n".join(" ".join(r) for r in relations) + "\n")


main()
