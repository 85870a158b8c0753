#!/usr/bin/env python3
"""How the solver fares on drives that are simulated as chance has it: a line for each.

    drives.py FIRST_SEED COUNT [--bin=build/bin] [--worlds=FOLDER]

For each seed draws a building (with --worlds instead each of the world files of a folder in turn), its size and rotation, the
laser (beams, range, noise, missing returns, rate), the speed and how odometry is off; runs plumbline_simulate, plumbline_solve
and plumbline_evaluate; prints the mean and the largest error of the robot (m) and of the directions of walls (degrees), bend
error (degrees), false walls and entries of tracking.loose. A mean over 0.1 m or a bend over 0.5 degrees is "told" where
something is loose, and SILENT otherwise. Same arguments, same drives.
"""
import glob
import json
import os
import random
import re
import subprocess
import sys
import tempfile

SILENT_FROM = 0.1
BENT_FROM = 0.5
WORLDS = ("office", "killian_like", "oblique", "symmetric", "parallel", "bent", "bent_niches")


def run(*words):
    return subprocess.run(words, check=True, capture_output=True, text=True).stdout


def draw_flags(draw, seed, world):
    name = world or draw.choice(WORLDS)
    flags = [f"--world={name}", f"--seed={seed}"]
    if not world:
        flags.append("--size=%g" % round(draw.uniform(.4, 1.2), 2))
    flags += ["--rotation=%g" % round(draw.uniform(0, 360)), "--beams=%d" % draw.choice((180, 181, 360, 361)),
              "--maximum_range=%g" % draw.choice((6, 8, 12, 20, 30, 80)), "--range_noise=%g" % draw.choice((.005, .01, .02, .03)),
              "--scan_rate=%g" % draw.choice((5, 8, 10, 20)), "--speed=%g" % draw.choice((.3, .5, .8)),
              "--missing=%g" % draw.choice((0, .02, .1)), "--odometry_scale=%g" % round(draw.gauss(0, .015), 4),
              "--odometry_turn_scale=%g" % round(draw.gauss(0, .03), 4),
              "--odometry_heading_bias=%g" % round(draw.gauss(0, .5), 3)]
    if name.startswith("bent"):
        flags.append("--bend_deg=%g" % draw.choice((-8, -4, -2, 2, 3, 6, 9, 15)))
    return flags


def figures(text, kind):
    return [float(x) for x in re.search(kind + r" error +\S+ +mean +([\d.]+).*?max +([\d.]+)", text).groups()]


def main():
    arguments = [a for a in sys.argv[1:] if not a.startswith("--")]
    options = dict(a[2:].split("=", 1) for a in sys.argv[1:] if a.startswith("--"))
    if len(arguments) != 2 or not set(options) <= {"bin", "worlds"}:
        sys.exit(__doc__)
    first, count = int(arguments[0]), int(arguments[1])
    binaries = options.get("bin", "build/bin")
    worlds = sorted(glob.glob(os.path.join(options["worlds"], "*.world"))) if "worlds" in options else [None]
    silent = 0
    for i in range(count):
        seed, world = first + i, worlds[i % len(worlds)]
        flags = draw_flags(random.Random(seed), seed, world)
        with tempfile.TemporaryDirectory() as work:
            log, truth, out = f"{work}/log.clf", f"{work}/truth.json", f"{work}/out"
            run(f"{binaries}/plumbline_simulate", *flags, f"--output={log}", f"--truth={truth}", "--quiet")
            run(f"{binaries}/plumbline_solve", f"--input={log}", f"--output_dir={out}", "--quiet", "--outputs=trajectory.tum,map.json")
            text = run(f"{binaries}/plumbline_evaluate", f"--trajectory={out}/trajectory.tum", f"--map={out}/map.json",
                       f"--truth={truth}")
            with open(f"{out}/summary.json") as file:
                loose = len(json.load(file)["tracking"]["loose"])
        position, direction = figures(text, "position"), figures(text, "wall direction")
        bend = re.search(r"bend error: ([\d.]+)", text)
        bend = float(bend.group(1)) if bend else 0.0
        is_wrong = position[0] > SILENT_FROM or bend > BENT_FROM
        verdict = "" if not is_wrong else " told" if loose else " SILENT"
        silent += verdict == " SILENT"
        print(f"{seed} {' '.join(f.split('=')[1] for f in flags)}: {position[0]} ({position[1]}) m, {direction[0]} ({direction[1]}) "
              f"degrees, bend {bend}, {re.search(r'false walls: (.*)', text).group(1)} false walls, {loose} loose{verdict}", flush=True)
    print(f"{count} drives, {silent} silent")


main()
