#!/usr/bin/env python3
"""How the solver fares on logs that were made hard: a row for each kind and seed.

run.py LOG RELATIONS --stress=STRESS.py [--bin=build/bin] [--kinds=none,turns,...] [--seeds=1-10] [--output=TABLE.csv] [-- FLAGS...]

STRESS.py LOG OUT --kind=KIND --seed=N makes the hard log; the kind "none" is the log as it is. A row has

  mean    mean translational error over all relations, m
  sure    the same over the relations that do not cross a part that was reported as loose, m
  pieces  tracking.pieces of summary.json
  loose   entries of tracking.loose
  verdict good (mean under twice that of the log as it is), loose (worse, but reported), worse (worse without a word, 0.2 m at
          most), SILENT (over 0.2 m without a word); FALSE where the log as it is reports something

The last lines count the verdicts. FLAGS go to plumbline_solve.
"""
import argparse, csv, json, os, subprocess, sys, tempfile, time

KINDS = "turns stale dead scale jump blind people carried".split()


def seeds_of(text):
    seeds = []
    for part in text.split(","):
        first, _, last = part.partition("-")
        seeds += range(int(first), int(last or first) + 1)
    return seeds


def is_sure(begin, end, loose):
    """False where exactly one end lies in a loose part, or one that was found again lies between them."""
    for part in loose:
        inside = [part["begin"] <= t <= part["end"] for t in (begin, end)]
        if inside[0] != inside[1]:
            return False
        low, high = min(begin, end), max(begin, end)
        if not all(inside) and low < part["begin"] and part["end"] < high:
            return False
    return True


def solve(log, args, folder):
    out = os.path.join(folder, "out")
    start = time.time()
    done = subprocess.run([os.path.join(args.bin, "plumbline_solve"), "--input=" + log, "--output_dir=" + out,
                           "--outputs=none,trajectory.tum"] + args.flags, capture_output=True, text=True)
    if done.returncode != 0:
        sys.exit("plumbline_solve: " + done.stderr)
    seconds = time.time() - start
    errors = os.path.join(folder, "errors.csv")
    done = subprocess.run([os.path.join(args.bin, "plumbline_evaluate"), "--trajectory=" + os.path.join(out, "trajectory.tum"),
                           "--relations=" + args.relations, "--relation_errors=" + errors], capture_output=True, text=True)
    if done.returncode != 0:
        sys.exit("plumbline_evaluate: " + done.stderr)
    with open(os.path.join(out, "summary.json")) as f:
        tracking = json.load(f)["tracking"]
    with open(errors) as f:
        rows = list(csv.DictReader(f))
    all_errors = [float(r["translation_m"]) for r in rows]
    sure = [float(r["translation_m"]) for r in rows if is_sure(float(r["t1"]), float(r["t2"]), tracking["loose"])]
    return {"mean": sum(all_errors) / len(all_errors), "max": max(all_errors), "sure": sum(sure) / max(1, len(sure)),
            "share": len(sure) / len(all_errors), "pieces": tracking["pieces"], "loose": tracking["loose"], "seconds": seconds}


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("log"); parser.add_argument("relations")
    parser.add_argument("--stress", required=True); parser.add_argument("--bin", default="build/bin")
    parser.add_argument("--kinds", default=",".join(["none"] + KINDS)); parser.add_argument("--seeds", default="1-10")
    parser.add_argument("--plain", type=float, help="mean error of the log as it is, m, where it is not among the kinds")
    parser.add_argument("--output", help="CSV with a row for each run")
    own = sys.argv[1:]
    flags = own[own.index("--") + 1:] if "--" in own else []
    args = parser.parse_args(own[:own.index("--")] if "--" in own else own)
    args.flags = flags
    plain, counts, table = args.plain, {}, []
    for kind in args.kinds.split(","):
        for seed in [0] if kind == "none" else seeds_of(args.seeds):
            with tempfile.TemporaryDirectory() as folder:
                log = args.log
                if kind != "none":
                    log = os.path.join(folder, "hard.clf")
                    subprocess.run([sys.executable, args.stress, args.log, log, "--kind=" + kind, "--seed=%d" % seed],
                                   check=True, stdout=subprocess.DEVNULL)
                row = solve(log, args, folder)
            if kind == "none":
                plain = row["mean"]
                verdict = "FALSE" if row["loose"] else "good"
            elif plain is None:
                sys.exit("--plain, or the kind none first")
            else:
                verdict = ("good" if row["mean"] < 2 * plain else "loose" if row["loose"] else
                           "worse" if row["mean"] <= 0.2 else "SILENT")
            counts.setdefault(kind, {}).setdefault(verdict, 0)
            counts[kind][verdict] += 1
            print("%-8s %3d mean %.4f max %.2f sure %.4f (%3.0f %%) pieces %d loose %d %s %.0f s" % (
                kind, seed, row["mean"], row["max"], row["sure"], 100 * row["share"], row["pieces"], len(row["loose"]), verdict,
                row["seconds"]), flush=True)
            table.append([kind, seed, "%.4f" % row["mean"], "%.3f" % row["max"], "%.4f" % row["sure"], "%.3f" % row["share"],
                          row["pieces"], len(row["loose"]), verdict])
    if args.output:
        with open(args.output, "w", newline="") as f:
            writer = csv.writer(f)
            writer.writerow("kind seed mean max sure share pieces loose verdict".split())
            writer.writerows(table)
    for kind, verdicts in counts.items():
        print(kind, ", ".join("%d %s" % (n, v) for v, n in sorted(verdicts.items())))
    hard = {}
    for kind, verdicts in counts.items():
        for verdict, n in verdicts.items() if kind != "none" else ():
            hard[verdict] = hard.get(verdict, 0) + n
    print("hard logs:", ", ".join("%d %s" % (n, v) for v, n in sorted(hard.items())) or "none")


main()
