#!/usr/bin/env python3
"""How the solver fares on logs into which a cart was put that goes along with the robot: a line for each.

    carts.py LOG RELATIONS [--bin=build/bin] [--seeds=1-6]

LOG is a CARMEN log (plain, .gz or .bz2) with FLASER messages of a laser that looks ahead over 180 degrees. The seed draws the
cart's width (0.5 to 1.3 m), its distance from the laser (0.8 to 2 m), how far to the side it is, by how much it goes to and fro,
and for how long it is there (from 15 s to the whole log). Prints the mean and the largest error over the relations (m), what
tracking.loose has, and what the run says of it; seed 0 is the log as it is.
"""
import bz2
import gzip
import json
import math
import os
import random
import re
import subprocess
import sys
import tempfile


def open_log(path):
    return (bz2.open if path.endswith(".bz2") else gzip.open if path.endswith(".gz") else open)(path, "rt")


def draw_cart(seed, begin, end):
    draw = random.Random(seed)
    cart = {"width": draw.uniform(.5, 1.3), "ahead": draw.uniform(.8, 2.), "aside": draw.uniform(-.2, .2),
            "sway": draw.choice((0., 0., .05, .1)), "begin": begin, "end": end}
    seconds = draw.choice((15., 30., 60., 300., end - begin))
    if seconds < end - begin:
        cart["begin"] = draw.uniform(begin, end - seconds)
        cart["end"] = cart["begin"] + seconds
    return cart


def with_cart(words, cart):
    count, time = int(words[1]), float(words[-3])
    if not cart["begin"] <= time <= cart["end"]:
        return words
    ahead = cart["ahead"] + cart["sway"] * math.sin(1.3 * time)
    for i in range(count):
        angle = -math.pi / 2 + math.pi * i / (count if count % 2 == 0 else count - 1)
        if abs(angle) > 1.4 or abs(ahead * math.tan(angle) - cart["aside"]) > cart["width"] / 2:
            continue
        if float(words[2 + i]) > ahead / math.cos(angle):
            words[2 + i] = "%.3f" % (ahead / math.cos(angle))
    return words


def main():
    arguments = [a for a in sys.argv[1:] if not a.startswith("--")]
    options = dict(a[2:].split("=", 1) for a in sys.argv[1:] if a.startswith("--"))
    if len(arguments) != 2 or not set(options) <= {"bin", "seeds"}:
        sys.exit(__doc__)
    log, relations = arguments
    binaries = options.get("bin", "build/bin")
    first, _, last = options.get("seeds", "1-6").partition("-")
    with open_log(log) as file:
        lines = [line.split() for line in file if line.startswith("FLASER")]
    times = [float(words[-3]) for words in lines]
    for seed in range(int(first), int(last or first) + 1):
        cart = draw_cart(seed, times[0], times[-1])
        with tempfile.TemporaryDirectory() as folder:
            path = os.path.join(folder, "log.clf")
            with open(path, "w") as file:
                for words in lines:
                    file.write(" ".join(with_cart(list(words), cart) if seed else words) + "\n")
            solve = subprocess.run([os.path.join(binaries, "plumbline_solve"), "--input=" + path, "--output_dir=" + folder + "/out",
                                    "--outputs=trajectory.tum"], check=True, capture_output=True, text=True)
            said = re.findall(r"went along with the robot for ([\d.]+) m in (\d+ stretch\w*)", solve.stderr)
            text = subprocess.run([os.path.join(binaries, "plumbline_evaluate"), "--relations=" + relations,
                                   "--trajectory=" + folder + "/out/trajectory.tum"], check=True, capture_output=True,
                                  text=True).stdout
            mean, most = re.search(r"translational error +\S+ +mean +([\d.]+).*?max +([\d.]+)", text).groups()
            with open(folder + "/out/summary.json") as file:
                loose = len(json.load(file).get("tracking", {}).get("loose", []))
        what = "%.1f m wide, %.1f m ahead, %.2f to and fro, %.0f s" % (
            cart["width"], cart["ahead"], cart["sway"], cart["end"] - cart["begin"]) if seed else "none"
        print("%3d %s: %s (%s) m, %d loose, %s" % (seed, what, mean, most, loose,
                                                   "%s m in %s left out" % said[0] if said else "nothing left out"),
              flush=True)


main()
