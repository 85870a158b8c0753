#!/usr/bin/env python3
"""Makes of a CARMEN log what a sensor with a narrower view would have seen.

    narrow.py IN.clf[.gz|.bz2] OUT.clf DEGREES METRES [EVERY]

keeps the beams within DEGREES / 2 of ahead, of these one in EVERY (1), as
ROBOTLASER1 messages; what lies METRES away or farther returns nothing.
"""

import bz2
import gzip
import math
import sys

NO_RETURN = 81.83


def main():
    if len(sys.argv) not in (5, 6):
        sys.exit(__doc__)
    source, target = sys.argv[1:3]
    view, reach = float(sys.argv[3]), float(sys.argv[4])
    every = int(sys.argv[5]) if len(sys.argv) == 6 else 1
    opener = {"bz2": bz2.open, ".gz": gzip.open}.get(source[-3:], open)
    with opener(source, "rt") as log, open(target, "w") as out:
        for line in log:
            words = line.split()
            if not words or words[0] != "FLASER":
                continue
            count = int(words[1])
            ranges = [float(word) for word in words[2:2 + count]]
            pose = words[2 + count:8 + count]
            stamp, host, logged = words[8 + count:11 + count]
            step = 180.0 / (count if count in (180, 360) else count - 1)
            kept = [i for i in range(count)
                    if abs(-90.0 + i * step) <= 0.5 * view][::every]
            seen = [ranges[i] if ranges[i] < reach else NO_RETURN for i in kept]
            start = math.radians(-90.0 + kept[0] * step)
            out.write(
                f"ROBOTLASER1 0 {start:.8f} "
                f"{math.radians(step * every) * (len(kept) - 1):.8f} "
                f"{math.radians(step * every):.8f} {reach} 0.01 0 {len(kept)} "
                + " ".join(f"{r:.3f}" for r in seen)
                + f" 0 {' '.join(pose)} 0 0 0 0 0 {stamp} {host} {logged}\n")


if __name__ == "__main__":
    main()
