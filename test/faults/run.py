#!/usr/bin/env python3
"""Treats the binaries as the world does, and counts what they make of it.

  test/faults/run.py BIN_DIR [--kills=N] [--bad_inputs=N] [--seed=N]

Kills runs of plumbline_solve at moments spread over their whole length, limits
the size of the files that they may write (a disk that is full at every file in
turn), takes the output folder away, makes it read-only, and feeds inputs that
are made wrong by rule. Ends with status 1 when anything is found:

- a folder that holds files of two runs and does not say so, or files missing;
- a file of somebody else that is changed or gone;
- a run that was killed and gone on with, and ends with other bytes than one
  that never was;
- an exit status other than 0, 1, 2 and 130, or an error without a message that
  says what was expected.
"""

import argparse
import gzip
import hashlib
import json
import os
import random
import resource
import shutil
import signal
import subprocess
import sys
import tempfile
import time

SOURCE = os.path.dirname(os.path.dirname(os.path.dirname(os.path.abspath(__file__))))
findings = []


def finding(text):
    findings.append(text)
    print("FOUND: " + text, flush=True)


def office(scans):
    """The first scans of the bundled log."""
    lines = []
    with gzip.open(os.path.join(SOURCE, "datasets/office.clf.gz"), "rt") as log:
        for line in log:
            lines.append(line)
            scans -= line.startswith("FLASER")
            if scans == 0:
                break
    return "".join(lines)


def digest(path):
    with open(path, "rb") as file:
        return hashlib.sha256(file.read()).hexdigest()


def state_of(folder):
    """'none', 'whole', 'partial', 'mixed', or what is wrong."""
    path = os.path.join(folder, "summary.json")
    if not os.path.exists(path):
        return "none"
    with open(path) as file:
        try:
            summary = json.load(file)
        except ValueError:
            return "summary.json is no JSON"
    if "mixed" in summary:
        return "mixed"
    for name, expected in summary["sha256"].items():
        if not os.path.exists(os.path.join(folder, name)):
            return name + " is missing"
        if digest(os.path.join(folder, name)) != expected:
            return name + " is of another run"
    return "partial" if summary["partial"] else "whole"


def foreign_ok(folder):
    with open(os.path.join(folder, "thesis.tex")) as file:
        return file.read() == "years of work"


def new_folder(root, name):
    folder = os.path.join(root, name)
    os.makedirs(folder)
    with open(os.path.join(folder, "thesis.tex"), "w") as file:
        file.write("years of work")
    return folder


class Solve:
    def __init__(self, binaries, root):
        self.binary = os.path.join(binaries, "plumbline_solve")
        self.root = root
        self.log = os.path.join(root, "office.log")
        with open(self.log, "w") as file:
            file.write(office(250))

    def command(self, folder, *flags):
        return [self.binary, "--input=" + self.log, "--output_dir=" + folder,
                "--num_threads=1", *flags]

    def run(self, folder, *flags, limit=None):
        def prepare():
            signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
            if limit is not None:
                resource.setrlimit(resource.RLIMIT_FSIZE, (limit, limit))
        return subprocess.run(self.command(folder, *flags), capture_output=True,
                              preexec_fn=prepare, text=True, errors="replace")


def kills(solve, count, rng):
    folder = new_folder(solve.root, "kills")
    begin = time.monotonic()
    reference = solve.run(folder)
    length = time.monotonic() - begin
    if reference.returncode != 0 or state_of(folder) != "whole":
        finding("the run that is not killed: " + reference.stderr)
        return
    wanted = digest(os.path.join(folder, "map.json"))
    states = {}
    ended = 0
    for i in range(count):
        signals = [signal.SIGKILL, signal.SIGKILL, signal.SIGTERM, signal.SIGINT]
        process = subprocess.Popen(solve.command(folder, "--quiet"),
                                   stderr=subprocess.DEVNULL)
        time.sleep(length * 1.1 * (i + rng.random()) / count)
        process.send_signal(signals[i % 4])
        ended += process.wait() == 0
        state = state_of(folder)
        states[state] = states.get(state, 0) + 1
        if state not in ("whole", "partial", "mixed"):
            finding("kill %d: %s" % (i, state))
        if not foreign_ok(folder):
            finding("kill %d: thesis.tex" % i)
    again = solve.run(folder)
    if again.returncode != 0 or state_of(folder) != "whole":
        finding("the run after the kills: " + again.stderr)
    elif digest(os.path.join(folder, "map.json")) != wanted:
        finding("the run after the kills has another map.json")
    left = [name for name in os.listdir(folder)
            if ".tmp" in name or name.startswith(".")]
    if left:
        finding("left behind: " + " ".join(left))
    print("kills: %d, %d of them after the end; folders %s; then whole again, "
          "same map.json, nothing left behind" % (count, ended, states))


FILES = ["map.json", "graph.g2o", "trajectory.tum", "map.svg", "floorplan.dxf",
         "occupancy.pgm"]


def resumed(solve, count, rng):
    """Killed at any moment, with a state kept at the end of every stage."""
    flags = ["--checkpoint_every=1e-9", "--quiet"]
    folder = new_folder(solve.root, "resumed")
    begin = time.monotonic()
    solve.run(folder, *flags)
    length = time.monotonic() - begin
    wanted = {name: digest(os.path.join(folder, name)) for name in FILES}
    alike = with_state = 0
    for i in range(count):
        shutil.rmtree(folder)
        os.makedirs(folder)
        process = subprocess.Popen(solve.command(folder, *flags))
        time.sleep(length * (i + rng.random()) / count)
        process.kill()
        process.wait()
        with_state += os.path.exists(
            os.path.join(folder, "checkpoint.plumbline"))
        again = solve.run(folder, *flags)
        if again.returncode != 0:
            finding("gone on with: " + again.stderr)
        elif {name: digest(os.path.join(folder, name))
              for name in FILES} != wanted:
            finding("gone on with: other bytes")
        elif "checkpoint.plumbline" in os.listdir(folder):
            finding("gone on with: the checkpoint is left")
        else:
            alike += 1
    print("killed and gone on with: %d, %d of them from a state, %d ended with "
          "the same bytes" % (count, with_state, alike))


def full_disk(solve):
    folder = new_folder(solve.root, "full")
    solve.run(folder)
    before = {name: digest(os.path.join(folder, name))
              for name in os.listdir(folder)}
    sizes = sorted({os.path.getsize(os.path.join(folder, name))
                    for name in before})
    failed = 0
    for size in sizes:
        result = solve.run(folder, limit=max(0, size - 1))
        if result.returncode == 0:
            continue
        failed += 1
        now = {name: digest(os.path.join(folder, name))
               for name in os.listdir(folder)}
        if result.returncode != 2 or "File too large" not in result.stderr:
            finding("full disk, %d bytes: %d %s" %
                    (size, result.returncode, result.stderr))
        if now != before:
            finding("full disk, %d bytes: the earlier run is not as it was"
                    % size)
    print("full disk: %d limits, %d runs failed, the earlier run whole after "
          "each" % (len(sizes), failed))


def folders(solve):
    folder = new_folder(solve.root, "vanishing")
    process = subprocess.Popen(solve.command(folder, "--quiet"))
    time.sleep(0.05)
    shutil.rmtree(folder)
    if process.wait() not in (0, 2):
        finding("vanishing folder: status %d" % process.returncode)
    if os.path.isdir(folder) and state_of(folder) not in ("none", "whole"):
        finding("vanishing folder: " + state_of(folder))
    count = 1
    if os.geteuid() != 0:
        locked = new_folder(solve.root, "locked")
        os.chmod(locked, 0o555)
        if solve.run(locked).returncode != 2:
            finding("read-only folder")
        os.chmod(locked, 0o755)
        count += 1
    print("folders that vanish or are locked: %d" % count)


GRAPH = """VERTEX_SE2 0 0 0 0
VERTEX_SE2 1 1 0 0.1
VERTEX_XY 2 1 2
FIX 0
EDGE_SE2 0 1 1 0 0.1 10 0 0 10 0 100
EDGE_SE2_XY 1 2 0.5 0.5 10 0 10
PLUMBLINE_FEATURE 2 0 0 0 0 0 0 1 g2o
"""
TRUTH = json.dumps({
    "format": "plumbline-truth", "version": 1, "orientations_deg": [0, 90],
    "walls": [{"id": 0, "x1": 0, "y1": 0, "x2": 4, "y2": 0, "orientation": 0,
               "seen": [[0, 4]]}],
    "poses": [[1, 0, 0, 0], [2, 1, 0, 0]]}, indent=1)
MAP = json.dumps({
    "features": [{"id": 0, "type": "segment", "parameters": [0, 0, 0],
                  "extent": [0, 4], "anchor": [0, 0]}],
    "constraints": []}, indent=1)
TUM = "1 0 0 0 0 0 0 1\n2 1 0 0 0 0 0 1\n"
RELATIONS = "1 2 1 0 0 0 0 0\n"
FLAGS = "# flags\n--seed=3\n--nostructure\n--link_radius=5\n"
WORLD = "wall 0 0 10 0\nwall 10 0 10 8\nwall 10 8 0 8\nwall 0 8 0 0\npath 2 2 8 2 8 6 2 6\n"
WORDS = [b"nan", b"inf", b"-1", b"1e400", b"1e-400", b"99999999999999999999",
         b"2147483647", b"", b"x", b"\xff\xfe", b"\x00", b"{", b"[", b"\"",
         b"--", b"=", b"+0.5", b"0x10", b"1e308", b"-0"]


def spoil(text, rng):
    """A text made wrong in one of several ways."""
    data = bytearray(text.encode())
    kind = rng.randrange(9)
    if kind == 0:
        del data[rng.randrange(len(data)):]
    elif kind == 1:
        for _ in range(rng.randrange(1, 20)):
            data[rng.randrange(len(data))] = rng.randrange(256)
    elif kind == 2:
        lines = data.split(b"\n")
        rng.shuffle(lines)
        data = bytearray(b"\n".join(lines))
    elif kind == 3:
        lines = data.split(b"\n")
        i = rng.randrange(len(lines))
        lines[i:i] = [lines[rng.randrange(len(lines))]] * rng.randrange(1, 4)
        data = bytearray(b"\n".join(lines))
    elif kind == 4:
        data[0:0] = rng.choice([b"\xef\xbb\xbf", b"\xff\xfe", b"\x1f\x8b\x08",
                                b"BZh9", b"\x00" * 64])
    elif kind == 5:
        data += bytes(rng.randrange(256) for _ in range(200))
    elif kind == 6:
        begin = rng.randrange(len(data))
        del data[begin:begin + rng.randrange(1, 30)]
    else:
        words = bytes(data).split(b" ")
        i = rng.randrange(len(words))
        words[i] = rng.choice(WORDS)
        data = bytearray(b" ".join(words))
    return bytes(data)


def bad_inputs(binaries, root, count, rng):
    folder = os.path.join(root, "bad")
    os.makedirs(folder)
    log = office(8)

    def write(name, data):
        path = os.path.join(folder, name)
        with open(path, "wb") as file:
            file.write(data if isinstance(data, bytes) else data.encode())
        return path

    def solve(*flags):
        return [os.path.join(binaries, "plumbline_solve"), "--num_threads=1",
                "--outputs=map.json,trajectory.tum",
                "--output_dir=" + os.path.join(folder, "out"), *flags]

    def evaluate(**texts):
        command = [os.path.join(binaries, "plumbline_evaluate")]
        for flag, text in texts.items():
            command.append("--%s=%s" % (flag, write(flag, text)))
        return command

    good_log = write("good.log", log)
    kinds = {
        "graph": lambda: solve("--input=" + write("graph.g2o", spoil(GRAPH, rng))),
        "log": lambda: solve("--input=" + write("bad.log", spoil(log, rng))),
        "flags": lambda: solve("--input=" + good_log, "--outputs=none",
                               "--flagfile=" + write("flags", spoil(FLAGS, rng))),
        "truth": lambda: evaluate(trajectory=TUM, truth=spoil(TRUTH, rng), map=MAP),
        "map": lambda: evaluate(trajectory=TUM, truth=TRUTH, map=spoil(MAP, rng)),
        "relations": lambda: evaluate(trajectory=TUM, relations=spoil(RELATIONS, rng)),
        "trajectory": lambda: evaluate(trajectory=spoil(TUM, rng), relations=RELATIONS),
        "world": lambda: [os.path.join(binaries, "plumbline_simulate"), "--quiet",
                          "--world=" + write("world", spoil(WORLD, rng)),
                          "--output=" + os.path.join(folder, "simulated.log")],
    }
    statuses = {}
    names = sorted(kinds)
    for i in range(count):
        name = names[i % len(names)]
        command = kinds[name]()
        try:
            result = subprocess.run(command, capture_output=True, timeout=60,
                                    text=True, errors="replace",
                                    stdin=subprocess.DEVNULL)
        except subprocess.TimeoutExpired:
            finding("%s %d takes more than a minute" % (name, i))
            continue
        status = result.returncode
        statuses[status] = statuses.get(status, 0) + 1
        explained = status == 0 or "expected" in result.stderr
        if status not in (0, 1, 2) or not explained:
            shutil.copytree(folder, os.path.join(root, "found_%d" % i))
            finding("%s %d: status %d: %s" % (name, i, status, result.stderr[:300]))
    print("bad inputs: %d of %d kinds; statuses %s" %
          (count, len(kinds), dict(sorted(statuses.items()))))


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("bin_dir")
    parser.add_argument("--kills", type=int, default=100)
    parser.add_argument("--bad_inputs", type=int, default=1000)
    parser.add_argument("--seed", type=int, default=1)
    arguments = parser.parse_args()
    rng = random.Random(arguments.seed)
    root = tempfile.mkdtemp(prefix="plumbline_faults_")
    solve = Solve(arguments.bin_dir, root)
    if arguments.kills > 0:
        kills(solve, arguments.kills, rng)
        resumed(solve, arguments.kills, rng)
    full_disk(solve)
    folders(solve)
    bad_inputs(arguments.bin_dir, root, arguments.bad_inputs, rng)
    if findings:
        print("%d findings; the files are in %s" % (len(findings), root))
        return 1
    shutil.rmtree(root)
    print("nothing found")
    return 0


if __name__ == "__main__":
    sys.exit(main())
