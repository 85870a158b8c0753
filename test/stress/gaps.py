#!/usr/bin/env python3
"""Drives through places that look alike, of which scans are missing for some seconds.

    gaps.py FOLDER [--bin=build/bin] [--seeds=1-3] [--seconds=0,3,5,10] [--count=6]

Draws for each seed a corridor of steps (steps), one with equal niches on both sides
(niches), one with ribs every 0.6 m (ribs), and two rows of rooms of random widths
whose doors are in line (rooms). Drives through each with plumbline_simulate, leaves
out COUNT stretches of so many seconds, over which odometry goes on, solves what is
left and prints the error of the position, m, and how many entries tracking.loose has.
A log is wrong with a mean error of over 0.1 m, and silent without an entry.
"""

import argparse
import json
import math
import os
import random
import re
import subprocess

from world_file import path, wall


def chain(points):
    return [wall(a, b) for a, b in zip(points, points[1:])]


def there_and_back(points):
    return [path(points + points[-2::-1])]


def steps(draw):
    """A corridor that goes on at 6 to 15 degrees to its walls."""
    step = draw.uniform(1.2, 2.4)
    count = int(draw.uniform(40.0, 60.0) / step)
    rise = step * math.tan(math.radians(draw.uniform(6.0, 15.0)))
    lines = []
    for side in (-1.3, 1.3):
        points = []
        for i in range(count):
            points += [(i * step, side + i * rise), ((i + 1) * step, side + i * rise)]
        lines += chain(points)
    last = (count - 1) * rise
    lines += [wall((0.0, -1.3), (0.0, 1.3)),
              wall((count * step, last - 1.3), (count * step, last + 1.3))]
    return lines + there_and_back([(1.0, 0.0), (count * step - 1.0, last - 0.1)])


def niches(draw):
    """Niches of 1 m by 0.4 m every 3.6 m."""
    count = draw.randint(12, 18)
    end = 3.6 * count
    lines = [wall((0.0, -1.2), (0.0, 1.2)), wall((end, -1.2), (end, 1.2))]
    for side in (-1.0, 1.0):
        points = [(0.0, 1.2 * side)]
        for i in range(count):
            x = 3.6 * i + 1.3
            points += [(x, 1.2 * side), (x, 1.6 * side), (x + 1.0, 1.6 * side),
                       (x + 1.0, 1.2 * side)]
        lines += chain(points + [(end, 1.2 * side)])
    return lines + there_and_back([(1.0, 0.0), (end - 1.0, 0.0)])


def ribs(draw):
    """Ribs of 0.08 m by 0.1 m every 0.6 m, as of lockers."""
    end = draw.uniform(30.0, 45.0)
    lines = [wall((0.0, -1.0), (0.0, 1.0)), wall((end, -1.0), (end, 1.0))]
    for side in (-1.0, 1.0):
        lines.append(wall((0.0, side), (end, side)))
        lines += ["box %.3f %.3f 0.1 0.08 0" % (0.6 * k, 0.93 * side)
                  for k in range(1, int(end / 0.6))]
    return lines + there_and_back([(1.0, 0.0), (end - 1.0, 0.0)])


def rooms(draw):
    """Two rows of rooms of 4.5 to 7 m, a door from each to the next."""
    places = [0.0]
    for _ in range(draw.randint(5, 7)):
        places.append(places[-1] + draw.uniform(4.5, 7.0))
    depth = draw.uniform(5.0, 6.5)
    end = places[-1]
    lines = [wall((0.0, y), (end, y)) for y in (-depth, 0.0, depth)]
    lines += [wall((x, -depth), (x, depth)) for x in places]
    for row in (-0.5 * depth, 0.5 * depth):
        lines += ["door %.3f %.3f 1.0" % (x, row) for x in places[1:-1]]
    middles = [0.5 * (places[0] + places[1]), 0.5 * (places[-2] + places[-1])]
    lines += ["door %.3f 0.0 1.0" % x for x in middles]
    lap = [(middles[0], 0.5 * depth), (middles[1], 0.5 * depth),
           (middles[1], -0.5 * depth), (middles[0], -0.5 * depth),
           (middles[0], 0.5 * depth)]
    return lines + [path(lap + lap[1:])]


def cut(lines, count, seconds, draw):
    """The lines of a log without so many stretches of so many seconds."""
    times = [float(line.split()[-1]) for line in lines if line.startswith("FLASER")]
    begins = []
    for _ in range(100000):
        if len(begins) == count:
            break
        begin = draw.uniform(times[0] + 10.0, times[-1] - 10.0 - seconds)
        if all(abs(begin - other) > seconds + 8.0 for other in begins):
            begins.append(begin)
    return [line for line in lines if not line.startswith(("FLASER", "ODOM")) or not any(
        begin < float(line.split()[-1]) < begin + seconds for begin in begins)]


def solve(binaries, log, truth, folder):
    run = subprocess.run([binaries + "/plumbline_solve", "--input=" + log, "--output_dir=" + folder,
                          "--outputs=trajectory.tum,map.json", "--num_threads=1", "--quiet"],
                         capture_output=True, text=True)
    if run.returncode != 0:
        return None
    told = subprocess.run([binaries + "/plumbline_evaluate", "--truth=" + truth,
                           "--trajectory=" + folder + "/trajectory.tum", "--map=" + folder + "/map.json"],
                          capture_output=True, text=True).stdout
    found = re.search(r"position error.*mean\s+([\d.]+).*max\s+([\d.]+)", told)
    with open(folder + "/summary.json") as file:
        entries = len(json.load(file)["tracking"]["loose"])
    return float(found[1]), float(found[2]), entries


def main():
    parser = argparse.ArgumentParser(description=__doc__,
                                     formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder")
    parser.add_argument("--bin", default="build/bin")
    parser.add_argument("--seeds", default="1-3")
    parser.add_argument("--seconds", default="0,3,5,10")
    parser.add_argument("--count", type=int, default=6)
    options = parser.parse_args()
    first, _, last = options.seeds.partition("-")
    os.makedirs(options.folder, exist_ok=True)
    counts = {}
    for world in (steps, niches, ribs, rooms):
        for seed in range(int(first), int(last or first) + 1):
            name = os.path.join(options.folder, "%s_%d" % (world.__name__, seed))
            with open(name + ".world", "w") as file:
                file.write("\n".join(world(random.Random("%s %d" % (world.__name__, seed)))) + "\n")
            subprocess.run([options.bin + "/plumbline_simulate", "--world=" + name + ".world",
                            "--seed=%d" % seed, "--beams=361", "--maximum_range=10",
                            "--output=" + name + ".clf", "--truth=" + name + ".json", "--quiet"],
                           check=True, stdout=subprocess.DEVNULL)
            with open(name + ".clf") as file:
                lines = file.read().splitlines()
            for seconds in map(float, options.seconds.split(",")):
                log = "%s_%g.clf" % (name, seconds)
                kept = lines if seconds == 0.0 else cut(
                    lines, options.count, seconds, random.Random("%d %g" % (seed, seconds)))
                with open(log, "w") as file:
                    file.write("\n".join(kept) + "\n")
                result = solve(options.bin, log, name + ".json", log[:-4])
                count = counts.setdefault(seconds, [0, 0, 0])
                count[0] += 1
                if result is None:
                    print(log, "FAILED", flush=True)
                    count[1] += 1
                    continue
                mean, largest, entries = result
                count[1] += mean > 0.1
                count[2] += mean > 0.1 and entries == 0
                print("%s mean %.4f max %.2f entries %d" % (os.path.basename(log), mean, largest, entries),
                      flush=True)
    for seconds, (logs, wrong, silent) in counts.items():
        print("%g s missing: %d logs, %d wrong, %d of them without a word" % (seconds, logs, wrong, silent))


if __name__ == "__main__":
    main()
