#!/usr/bin/env python3
"""Logs of a robot that is carried from one floor of a house to another one.

    floors.py FOLDER [--bin=build/bin] [--seed=1] [--count=3]

Draws COUNT L-shaped floors, rooms along both sides of two corridors, and for each
a second floor with the same outer walls and corridors: with as many of its doors
elsewhere as the name says (doors_1, doors_3, doors_all), with other walls between
its rooms (walls), its mirror image (mirror), and the same floor again (same), where
one map is right. Drives through both with plumbline_simulate and writes them as
FOLDER/SEED_KIND.clf, one log each: the robot is carried between the two, to where it
began (even seeds) or to where it was, turned about (odd ones), and its odometry does
not know.
"""

import argparse
import os
import random
import subprocess
import tempfile

from world_file import path, wall

WIDTH = 2.2  # of the corridors, m
DEPTH = 5.0  # of the rooms, m
KINDS = ("same", "doors_1", "doors_3", "doors_all", "walls", "mirror")


def cuts(draw, begin, end):
    """Places of the walls between the rooms from begin to end."""
    places = [begin]
    while end - places[-1] > 7.5:
        places.append(places[-1] + draw.uniform(3.2, 6.4))
    if end - places[-1] < 3.0:
        places.pop()
    return places + [end]


def doors(draw, places):
    return [draw.uniform(a + 0.8, b - 0.8) for a, b in zip(places, places[1:])]


class Floor:
    """A corridor along x and one up from its end; rows of rooms are named by the
    side of the corridor that they are on."""

    def __init__(self, draw):
        self.long = draw.uniform(28.0, 36.0)
        self.high = draw.uniform(20.0, 26.0)
        self.rows = {
            "below": (0.0, self.long + WIDTH),
            "above": (0.0, self.long - DEPTH),
            "right": (0.0, self.high),
            "left": (WIDTH + DEPTH, self.high),
        }
        self.draw_walls(draw)
        self.visited = {row: [i % 2 == 0 for i in range(len(self.doors[row]))]
                        for row in self.rows}

    def draw_walls(self, draw):
        self.cuts = {row: cuts(draw, *ends) for row, ends in self.rows.items()}
        self.doors = {row: doors(draw, places) for row, places in self.cuts.items()}

    def move_doors(self, draw, count):
        """Moves so many doors by 1 m or more, or all that have room for it."""
        all_doors = [(row, i) for row in self.rows for i in range(len(self.doors[row]))]
        draw.shuffle(all_doors)
        for row, i in all_doors:
            begin, end = self.cuts[row][i] + 0.8, self.cuts[row][i + 1] - 0.8
            was = self.doors[row][i]
            spans = [(a, b) for a, b in ((begin, was - 1.0), (was + 1.0, end)) if a < b]
            if not spans or count == 0:
                continue
            self.doors[row][i] = draw.uniform(*draw.choice(spans))
            count -= 1

    def place(self, row, along, across):
        """A point so far along the row and so far from its corridor's face into
        the rooms."""
        return {
            "below": (along, -0.5 * WIDTH - across),
            "above": (along, 0.5 * WIDTH + across),
            "right": (self.long + WIDTH + across, along - 0.5 * WIDTH),
            "left": (self.long - across, along - 0.5 * WIDTH),
        }[row]

    def lines(self, turned_back):
        lines = []
        for row, (begin, end) in self.rows.items():
            at = lambda along, across, row=row: self.place(row, along, across)
            lines += [wall(at(begin, 0), at(end, 0)), wall(at(begin, DEPTH), at(end, DEPTH))]
            lines += [wall(at(along, 0), at(along, DEPTH)) for along in self.cuts[row]]
            lines += ["door %.3f %.3f 0.9" % at(door, 0) for door in self.doors[row]]
        # Ends of the corridors, and what is between the rows above and to the left.
        half = 0.5 * WIDTH
        lines += [wall((0, -half), (0, half)),
                  wall((self.long, self.high - half), (self.long + WIDTH, self.high - half)),
                  wall((self.long - DEPTH, half), (self.long, half)),
                  wall((self.long, half), (self.long, half + DEPTH))]
        return lines + [path(self.way(turned_back))]

    def way(self, turned_back):
        corner = (self.long + 0.5 * WIDTH, 0.0)
        up = (corner[0], self.high - WIDTH)
        stops = []
        for row in self.rows:
            for door, is_visited in zip(self.doors[row], self.visited[row]):
                if is_visited:
                    x, y = self.place(row, door, -0.5 * WIDTH)
                    stops.append((row in ("right", "left"), y if row in ("right", "left") else x,
                                  [(x, y), self.place(row, door, 0.3), self.place(row, door, 2.2),
                                   self.place(row, door, 0.3), (x, y)]))
        stops.sort(key=lambda stop: stop[:2])
        points = [(1.0, 0.0)]
        is_up = False
        for stop in stops:
            if stop[0] and not is_up:
                points.append(corner)
                is_up = True
            points += stop[2]
        points.append(up)
        return points[::-1] if turned_back else points


def simulate(binaries, lines, seed, name):
    with open(name + ".world", "w") as file:
        file.write("\n".join(lines) + "\n")
    subprocess.run([binaries + "/plumbline_simulate", "--world=" + name + ".world", "--seed=%d" % seed,
                    "--output=" + name + ".clf", "--quiet"], check=True)
    with open(name + ".clf") as file:
        return [line.split() for line in file if line.startswith("FLASER")]


def mirrored(lines):
    """The world on the other side of the x axis."""
    result = []
    for line in lines:
        words = line.split()
        last = {"wall": 5, "door": 3, "path": len(words)}[words[0]]
        for i in range(2, last, 2):
            words[i] = "%.4f" % -float(words[i])
        result.append(" ".join(words))
    return result


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder")
    parser.add_argument("--bin", default="build/bin")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--count", type=int, default=3)
    args = parser.parse_args()
    for seed in range(args.seed, args.seed + args.count):
        for kind in KINDS:
            draw = random.Random(seed)
            floor = Floor(draw)
            with tempfile.TemporaryDirectory() as work:
                logs = [simulate(args.bin, floor.lines(False), 2 * seed, work + "/a")]
                if kind == "walls":
                    floor.draw_walls(draw)
                    floor.visited = {row: [i % 2 == 0 for i in range(len(floor.doors[row]))] for row in floor.rows}
                elif kind.startswith("doors"):
                    floor.move_doors(draw, {"1": 1, "3": 3, "all": -1}[kind.split("_")[1]])
                lines = floor.lines(seed % 2 == 1)
                logs.append(simulate(args.bin, mirrored(lines) if kind == "mirror" else lines, 2 * seed + 1, work + "/b"))
            join(logs, os.path.join(args.folder, "%d_%s.clf" % (seed, kind)))


def join(logs, name):
    """Odometry of each log goes on where that of the one before ended; it begins
    30 s later."""
    from math import cos, sin
    with open(name, "w") as file:
        x, y, heading, time = 0.0, 0.0, 0.0, 0.0
        for scans in logs:
            count = 2 + int(scans[0][1])
            # Two poses (laser, robot), a time, a host, a time.
            x0, y0, heading0 = (float(word) for word in scans[0][count + 3:count + 6])
            time0 = float(scans[0][count + 6])
            turn = heading - heading0
            for words in scans:
                for i in (count, count + 3):
                    dx, dy = float(words[i]) - x0, float(words[i + 1]) - y0
                    words[i] = "%.6f" % (x + cos(turn) * dx - sin(turn) * dy)
                    words[i + 1] = "%.6f" % (y + sin(turn) * dx + cos(turn) * dy)
                    words[i + 2] = "%.6f" % (float(words[i + 2]) + turn)
                words[count + 6] = words[count + 8] = "%.6f" % (float(words[count + 6]) - time0 + time)
                file.write(" ".join(words) + "\n")
            x, y, heading = (float(word) for word in scans[-1][count + 3:count + 6])
            time = float(scans[-1][count + 6]) + 30.0


main()
