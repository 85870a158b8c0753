#!/usr/bin/env python3
"""How the solver fares on logs that were changed in two ways at once (vary.py twice): a line for each draw.

    pairs.py FOLDER LOGS COUNT [--seed=1] [--bin=build/bin]

FOLDER holds LOG.clf.bz2 and LOG.relations for each of LOGS (names with commas). Draws a log, two kinds and their values,
COUNT times; prints the mean and the largest translational error (m), the mean rotational one (degrees), pieces and entries of
tracking.loose. A mean over 0.1 m is "told" where something is loose, and SILENT otherwise. Same arguments, same logs.
"""
import json
import os
import random
import re
import subprocess
import sys
import tempfile

KINDS = {"every": (2, 3, 4, 5), "noise": (0.02, 0.03, 0.05), "steps": (0.05, 0.1), "spikes": (0.05, 0.1, 0.2), "holes": (0.2, 0.4, 0.5),
         "near": (4, 6, 8), "beams": (2, 3, 4), "long": (1.01, 0.99), "offset": (0.05, -0.03), "askew": (1.5, -3), "drift": (1, -2),
         "slip": (5, 10), "wheels": (0.2, 0.4), "late": (1, 2), "mirror": (0,), "reverse": (0,)}
VARY = os.path.join(os.path.dirname(os.path.abspath(__file__)), "vary.py")
SILENT_FROM = 0.1


def run(*words):
    return subprocess.run(words, check=True, capture_output=True, text=True).stdout


def figures(text, kind):
    return re.search(kind + r" error +\S+ +mean +([\d.]+).*?max +([\d.]+)", text).groups()


def main():
    arguments = [a for a in sys.argv[1:] if not a.startswith("--")]
    options = dict(a[2:].split("=", 1) for a in sys.argv[1:] if a.startswith("--"))
    if len(arguments) != 3 or not set(options) <= {"seed", "bin"}:
        sys.exit(__doc__)
    folder, logs, count = arguments[0], arguments[1].split(","), int(arguments[2])
    seed, binaries = options.get("seed", "1"), options.get("bin", "build/bin")
    silent = 0
    for i in range(count):
        rnd = random.Random("%s %d" % (seed, i))
        log = rnd.choice(logs)
        first, second = rnd.sample(sorted(KINDS), 2)
        values = rnd.choice(KINDS[first]), rnd.choice(KINDS[second])
        with tempfile.TemporaryDirectory() as work:
            a, b, out = (os.path.join(work, name) for name in ("a", "b", "out"))
            run(VARY, f"{folder}/{log}.clf.bz2", f"{folder}/{log}.relations", a + ".clf", a + ".relations", first, str(values[0]), f"--seed={i + 1}")
            run(VARY, a + ".clf", a + ".relations", b + ".clf", b + ".relations", second, str(values[1]), f"--seed={i + 1}")
            run(f"{binaries}/plumbline_solve", f"--input={b}.clf", f"--output_dir={out}", "--quiet", "--outputs=trajectory.tum")
            text = run(f"{binaries}/plumbline_evaluate", f"--trajectory={out}/trajectory.tum", f"--relations={b}.relations")
            with open(f"{out}/summary.json") as file:
                tracking = json.load(file)["tracking"]
        mean, largest = figures(text, "translational")
        verdict = "" if float(mean) <= SILENT_FROM else " told" if tracking["loose"] else " SILENT"
        silent += verdict == " SILENT"
        print(f"{log} {first} {values[0]} {second} {values[1]}: {mean} ({largest}) m, {figures(text, 'rotational')[0]} degrees, "
              f"{tracking['pieces']} pieces, {len(tracking['loose'])} loose{verdict}", flush=True)
    print(f"{count} logs, {silent} silent")


if __name__ == "__main__":
    main()
