#!/usr/bin/env python3
"""Shows whether a change of the code changes any result, byte for byte.

  test/digests/run.py SOLVE SIMULATE --write=FILE [--cases=...] [-- FLAGS...]
  test/digests/run.py SOLVE SIMULATE --compare=FILE [-- FLAGS...]

--write runs SOLVE (a plumbline_solve) on every case and stores the SHA-256 of
what comes out; --compare runs the cases of such a file again and names every
output that is not what it was. Write with the binary of the parent commit,
compare with that of the change:

  test/digests/run.py parent/bin/plumbline_solve parent/bin/plumbline_simulate \\
      --write=before.json
  test/digests/run.py build/bin/plumbline_solve build/bin/plumbline_simulate \\
      --compare=before.json

Cases, separated by commas:

  S1 to S6    synthetic worlds, as SIMULATE writes them (--seeds of each)
  office      the bundled log
  fr079, intel, mit-killian   the public logs (PLUMBLINE_DATASETS); with office
              2 CPU minutes

Default: S1 to S6 and office. FLAGS go to SOLVE: -- --num_threads=1. The inputs
are compared as well, so that a change of SIMULATE is not taken for one of
SOLVE. Digests depend on the compiler and the mathematical library: a file of
one machine says nothing on another.

Ends with status 0 where all is the same, 1 where something differs, 2 where it
cannot be told.
"""

import argparse
import hashlib
import json
import os
import subprocess
import sys
import tempfile

SOURCE = os.path.dirname(os.path.dirname(os.path.dirname(os.path.abspath(__file__))))
WORLDS = ["S1", "S2", "S3", "S4", "S5", "S6"]
OUTPUTS = ["trajectory.tum", "map.json", "graph.g2o"]


class Failure(Exception):
    """What keeps the comparison from being made."""


def run(command):
    done = subprocess.run(command, capture_output=True, text=True, errors="replace")
    if done.returncode != 0:
        raise Failure("%s ends with status %d:\n%s" % (" ".join(command), done.returncode, done.stderr))


def digest(path):
    with open(path, "rb") as file:
        return hashlib.sha256(file.read()).hexdigest()


def inputs_of(case, seeds, simulate, folder):
    """(name, path) of the inputs that a case stands for."""
    if case in WORLDS:
        for seed in range(1, seeds + 1):
            path = os.path.join(folder, "%s_%d.g2o" % (case, seed))
            run([simulate, "--quiet", "--world=" + case, "--seed=%d" % seed, "--output=" + path])
            yield "%s seed %d" % (case, seed), path
        return
    if case == "office":
        path = os.path.join(SOURCE, "datasets", "office.clf.gz")
    else:
        datasets = os.environ.get("PLUMBLINE_DATASETS")
        if not datasets:
            raise Failure(case + " needs the folder of the public logs in PLUMBLINE_DATASETS")
        path = os.path.join(datasets, case + ".clf.bz2")
    if not os.path.exists(path):
        raise Failure("unknown case '%s': no file %s" % (case, path))
    yield case, path


def digests_of(name, path, args, folder):
    out = os.path.join(folder, "out_" + name.replace(" ", "_"))
    run([args.solve, "--quiet", "--input=" + path, "--output_dir=" + out,
         "--outputs=none," + ",".join(OUTPUTS)] + args.flags)
    digests = {"input": digest(path)}
    for output in OUTPUTS:
        # Graphs without poses have no trajectory.
        if os.path.exists(os.path.join(out, output)):
            digests[output] = digest(os.path.join(out, output))
    if "map.json" not in digests:
        raise Failure("%s wrote no map.json for %s" % (args.solve, name))
    return digests


def measure(args):
    digests = {}
    with tempfile.TemporaryDirectory(prefix="plumbline_digests_") as folder:
        for case in args.cases:
            for name, path in inputs_of(case, args.seeds, args.simulate, folder):
                digests[name] = digests_of(name, path, args, folder)
                print("%s: %s" % (name, ", ".join(
                    "%s %s" % (output, value[:12]) for output, value in digests[name].items())), flush=True)
    return digests


def differences(before, after):
    """A line for each output that is not what it was."""
    for name in before:
        for output in sorted(set(before[name]) | set(after[name])):
            was, is_now = before[name].get(output), after[name].get(output)
            if was != is_now:
                yield "%s: %s %s" % (name, output, "is missing" if is_now is None else "is new" if was is None else "differs")


def parse_arguments():
    arguments = sys.argv[1:]
    flags = []
    if "--" in arguments:
        flags = arguments[arguments.index("--") + 1:]
        arguments = arguments[:arguments.index("--")]
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("solve")
    parser.add_argument("simulate")
    what = parser.add_mutually_exclusive_group(required=True)
    what.add_argument("--write", metavar="FILE")
    what.add_argument("--compare", metavar="FILE")
    parser.add_argument("--cases", default=",".join(WORLDS + ["office"]))
    parser.add_argument("--seeds", type=int, default=3)
    args = parser.parse_args(arguments)
    args.cases = args.cases.split(",")
    args.flags = flags
    return args


def main():
    args = parse_arguments()
    if args.write:
        digests = measure(args)
        with open(args.write, "w") as file:
            json.dump({"cases": args.cases, "seeds": args.seeds, "digests": digests}, file, indent=1)
            file.write("\n")
        print("%d cases written to %s" % (len(digests), args.write))
        return 0
    with open(args.compare) as file:
        stored = json.load(file)
    args.cases, args.seeds = stored["cases"], stored["seeds"]
    found = list(differences(stored["digests"], measure(args)))
    for line in found:
        print("DIFFERS: " + line)
    print("%d outputs differ" % len(found) if found else "all the same")
    return 1 if found else 0


if __name__ == "__main__":
    try:
        sys.exit(main())
    except (Failure, OSError, ValueError, KeyError) as error:
        print("error: %s" % error, file=sys.stderr)
        sys.exit(2)
