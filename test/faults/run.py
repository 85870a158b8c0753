#!/usr/bin/env python3
"""Treats the binaries as the world does, and counts what they make of it.

  test/faults/run.py BIN_DIR [--kills=N] [--bad_inputs=N] [--interrupts=N]
      [--copies=N,N,...] [--seed=N] [--datasets=FOLDER] [--parts=PART,...]
      [--slower=FACTOR]

Kills runs of plumbline_solve at moments spread over their whole length, limits
the size of the files that they may write (a disk that is full at every file in
turn), takes the output folder away, makes it read-only, sets the clock back and
forth, interrupts runs at all of their steps, feeds inputs that are made wrong
by rule, and the bundled log many times over. With the folder of the public
logs and graphs a share of it is done with them. Ends with status 1 when
anything is found:

- a folder that holds files of two runs and does not say so, or files missing;
- a file of somebody else that is changed or gone;
- a run that was killed and gone on with, and ends with other bytes than one
  that never was;
- more than 2 s from an interrupt to the end, as processor time of the process;
- 20 copies of a log, one after the other, that take more than 25 times the
  processor time or memory of one;
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
import threading
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


def cpu_seconds(pid):
    """Processor time of a process that runs, s; None once it has ended."""
    try:
        with open("/proc/%d/stat" % pid) as file:
            fields = file.read().rsplit(")", 1)[1].split()
    except OSError:
        return None
    if fields[0] == "Z":
        return None
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


def wait_for_cpu(process, seconds):
    """False when the process ends before."""
    while True:
        spent = cpu_seconds(process.pid)
        if spent is None:
            return False
        if spent >= seconds:
            return True
        time.sleep(min(0.05, max(0.002, (seconds - spent) / 2)))


def finish(process):
    """Waits; exit status, processor time in s and peak memory in MB."""
    _, status, usage = os.wait4(process.pid, 0)
    process.returncode = os.waitstatus_to_exitcode(status)
    return (process.returncode, usage.ru_utime + usage.ru_stime,
            usage.ru_maxrss / 1024)


FILES = ["map.json", "graph.g2o", "trajectory.tum", "map.svg", "floorplan.dxf",
         "occupancy.pgm"]


def contents(folder):
    """Digests of what a run has to give the same each time, by name."""
    if os.path.exists(os.path.join(folder, "sweep.json")):
        names = ["sweep.csv", "sweep.svg"]
        for run in sorted(os.listdir(os.path.join(folder, "runs"))):
            names += [os.path.join("runs", run, name) for name in FILES]
    else:
        names = FILES
    return {name: digest(os.path.join(folder, name)) if
            os.path.exists(os.path.join(folder, name)) else "missing"
            for name in names}


class Victims:
    """Commands that are killed: each a function of the output folder."""

    def __init__(self, solve, datasets):
        log_flags = ["--checkpoint_every=1e-9", "--quiet"]
        self.commands = {"log": lambda folder: solve.command(folder, *log_flags)}
        source = new_folder(solve.root, "graph_source")
        solve.run(source, "--quiet", "--outputs=graph.g2o")
        graph = os.path.join(source, "graph.g2o")
        self.commands["graph"] = lambda folder: [
            solve.binary, "--input=" + graph, "--output_dir=" + folder,
            "--num_threads=1", "--quiet"]
        short = os.path.join(solve.root, "short.log")
        with open(short, "w") as file:
            file.write(office(60))
        self.commands["sweep"] = lambda folder: [
            os.path.join(os.path.dirname(solve.binary), "plumbline_sweep"),
            "--output_dir=" + folder, "--grid=link_radius=5,10,20", "--jobs=1",
            "--times=false", "--quiet", "--", solve.binary, "--input=" + short,
            "--num_threads=1", "--quiet"]
        if datasets:
            log = os.path.join(datasets, "fr079.clf.bz2")
            self.commands["fr079"] = lambda folder: [
                solve.binary, "--input=" + log, "--output_dir=" + folder,
                "--num_threads=1", *log_flags]

    def share(self, count):
        """How many kills of each."""
        few = min(count // 10, 5) if "fr079" in self.commands else 0
        shares = {"graph": count // 5, "sweep": count // 5}
        if few:
            shares["fr079"] = few
        shares["log"] = count - sum(shares.values())
        return shares


def kill_group(process):
    """A process and its children, as when the power goes."""
    os.killpg(process.pid, signal.SIGKILL)
    process.wait()


def resumed(solve, count, rng, datasets):
    """Killed at any moment, with a state kept at the end of every stage; the
    same command then ends with the same bytes."""
    victims = Victims(solve, datasets)
    for name, kills_of_it in sorted(victims.share(count).items()):
        folder = os.path.join(solve.root, "resumed")
        command = victims.commands[name](folder)
        shutil.rmtree(folder, ignore_errors=True)
        process = subprocess.Popen(command, stderr=subprocess.DEVNULL,
                                   stdout=subprocess.DEVNULL)
        begin = time.monotonic()
        status, length, _ = finish(process)
        wall = time.monotonic() - begin
        if status != 0:
            finding("%s: the run that is not killed: status %d" % (name, status))
            continue
        wanted = contents(folder)
        alike = with_state = with_runs = ended = 0
        for i in range(kills_of_it):
            shutil.rmtree(folder)
            fraction = (i + rng.random()) / kills_of_it
            process = subprocess.Popen(command, stderr=subprocess.DEVNULL,
                                       stdout=subprocess.DEVNULL,
                                       start_new_session=True)
            if name == "sweep":
                # Its children have the processor time.
                time.sleep(wall * fraction)
                ended += process.poll() is not None
            else:
                ended += not wait_for_cpu(process, length * fraction)
            try:
                kill_group(process)
            except ProcessLookupError:
                pass
            if not os.path.isdir(folder):
                os.makedirs(folder)
            with_state += "checkpoint.plumbline" in os.listdir(folder)
            with_runs += os.path.isdir(os.path.join(folder, "runs"))
            if name != "sweep" and state_of(folder) not in (
                    "none", "whole", "partial", "mixed"):
                finding("%s, kill %d: %s" % (name, i, state_of(folder)))
            again = subprocess.run(command, capture_output=True, text=True,
                                   errors="replace", stdin=subprocess.DEVNULL)
            left = [path for path in os.listdir(folder)
                    if ".tmp" in path or path == "checkpoint.plumbline"]
            if again.returncode != 0:
                finding("%s, gone on with: %s" % (name, again.stderr))
            elif contents(folder) != wanted:
                finding("%s, kill %d, gone on with: other bytes" % (name, i))
            elif left:
                finding("%s, gone on with: left behind: %s" %
                        (name, " ".join(left)))
            else:
                alike += 1
        print("killed and gone on with, %s (%.1f s of processor): %d, %d of "
              "them after the end, %d from a state, %d with runs of a sweep; "
              "%d ended with the same bytes" %
              (name, length, kills_of_it, ended, with_state, with_runs, alike),
              flush=True)


def full_disk(solve):
    folder = new_folder(solve.root, "full")
    solve.run(folder)
    before = {name: digest(os.path.join(folder, name))
              for name in os.listdir(folder)}
    lengths = {name: os.path.getsize(os.path.join(folder, name))
               for name in before}
    sizes = sorted(set(lengths.values()))
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
        # The trace has times in it; the grid's two files are written together.
        unnamed = [name for name in before
                   if lengths[name] > 1.05 * size + 100 and
                   name not in result.stderr and
                   name not in ("summary.json", "occupancy.yaml")]
        if "no file is replaced" in result.stderr and unnamed:
            finding("full disk, %d bytes: %s not named: %s" %
                    (size, " ".join(unnamed), result.stderr))
        if now != before:
            finding("full disk, %d bytes: the earlier run is not as it was"
                    % size)
    print("full disk: %d limits, %d runs failed, the earlier run whole after "
          "each" % (len(sizes), failed))


def full_tmpfs(solve):
    """The same with a disk that is full, of which root can make one."""
    if os.geteuid() != 0:
        print("full file system: not tried, only root can mount one")
        return
    disk = new_folder(solve.root, "disk")
    if subprocess.run(["mount", "-t", "tmpfs", "-o", "size=64M", "tmpfs", disk],
                      capture_output=True).returncode != 0:
        print("full file system: not tried, mount is refused")
        return
    try:
        folder = new_folder(disk, "out")
        flags = ["--quiet", "--checkpoint_every=1e-9"]
        solve.run(folder, *flags)
        before = {name: digest(os.path.join(folder, name))
                  for name in os.listdir(folder)}
        needed = sum(os.path.getsize(os.path.join(folder, name))
                     for name in before)
        failed = 0
        shares = 12
        for share in range(shares):
            ballast = os.path.join(disk, "ballast")
            free = os.statvfs(disk).f_bavail * os.statvfs(disk).f_frsize
            with open(ballast, "wb") as file:
                file.truncate(0)
                os.posix_fallocate(file.fileno(), 0,
                                   free - needed * share // shares)
            result = solve.run(folder, *flags)
            os.remove(ballast)
            failed += result.returncode != 0
            if result.returncode == 0:
                if state_of(folder) != "whole":
                    finding("full file system: " + state_of(folder))
                continue
            now = {name: digest(os.path.join(folder, name))
                   for name in os.listdir(folder)
                   if name != "checkpoint.plumbline"}
            if (result.returncode != 2 or
                    "No space left on device" not in result.stderr):
                finding("full file system: %d %s" %
                        (result.returncode, result.stderr))
            if now != before:
                finding("full file system: the earlier run is not as it was")
        # And what was kept is gone on with once there is room.
        again = solve.run(folder, *flags)
        if again.returncode != 0 or state_of(folder) != "whole":
            finding("full file system, after it: " + again.stderr)
        print("full file system: %d, %d runs failed, the earlier run whole "
              "after each" % (shares, failed))
    finally:
        subprocess.run(["umount", disk])


def folders(solve, rng):
    folder = new_folder(solve.root, "vanishing")
    begin = time.monotonic()
    solve.run(folder, "--quiet")
    length = time.monotonic() - begin
    vanishing = 10
    for i in range(vanishing):
        shutil.rmtree(folder, ignore_errors=True)
        os.makedirs(folder)
        process = subprocess.Popen(
            solve.command(folder, "--quiet", "--checkpoint_every=1e-9"),
            stderr=subprocess.DEVNULL)
        time.sleep(length * (i + rng.random()) / vanishing)
        # At once: removed file by file, what a run that is over has put there
        # would go in part.
        gone = folder + ".gone"
        shutil.rmtree(gone, ignore_errors=True)
        os.rename(folder, gone)
        # Files of the same run may be gone while others are put there.
        allowed = {0: ("none", "whole"), 2: ("none", "whole", "mixed")}
        status = process.wait()
        state = state_of(folder) if os.path.isdir(folder) else "none"
        if state not in allowed.get(status, ()):
            finding("vanishing folder: status %d, %s" % (status, state))
    # Root may write everywhere: then as nobody.
    other = {} if os.geteuid() != 0 else {"user": 65534, "group": 65534}
    os.chmod(solve.root, 0o755)
    locked = new_folder(solve.root, "locked")
    os.chmod(locked, 0o555)
    result = subprocess.run(solve.command(locked), capture_output=True,
                            text=True, **other)
    if result.returncode != 2 or "Permission denied" not in result.stderr:
        finding("read-only folder: %d %s" % (result.returncode, result.stderr))
    if os.listdir(locked) != ["thesis.tex"]:
        finding("read-only folder: it has changed")
    os.chmod(locked, 0o755)
    print("folders: %d that vanish, 1 that is read-only" % vanishing)


FAKETIME = "/usr/lib/x86_64-linux-gnu/faketime/libfaketime.so.1"


def clocks(solve, rng):
    """Runs under a clock that stands elsewhere and jumps by up to a year in
    both directions while they go on; the same files come out."""
    if not os.path.exists(FAKETIME):
        print("clocks: not tried, the package faketime is not installed")
        return
    folder = new_folder(solve.root, "clock")
    solve.run(folder, "--quiet")
    wanted = contents(folder)
    offsets = os.path.join(solve.root, "offset")
    count = jumps = 0
    for monotonic in ("1", "0"):
        environment = dict(os.environ, LD_PRELOAD=FAKETIME,
                           FAKETIME_TIMESTAMP_FILE=offsets, FAKETIME_NO_CACHE="1",
                           DONT_FAKE_MONOTONIC=monotonic)
        for start in (0, -20 * 365 * 86400, 10 * 365 * 86400):
            shutil.rmtree(folder)
            folder = new_folder(solve.root, "clock")

            def set_offset(seconds):
                with open(offsets + ".new", "w") as file:
                    file.write("%+d\n" % seconds)
                os.rename(offsets + ".new", offsets)

            set_offset(start)
            process = subprocess.Popen(
                solve.command(folder, "--quiet", "--checkpoint_every=0.05"),
                env=environment, stderr=subprocess.PIPE, text=True)
            while process.poll() is None:
                set_offset(start + rng.choice([-365 * 86400, -3600, -1, 1, 3600,
                                               365 * 86400]))
                jumps += 1
                time.sleep(0.02)
            count += 1
            if process.returncode != 0 or state_of(folder) != "whole":
                finding("clock: " + process.stderr.read())
            elif contents(folder) != wanted:
                finding("clock: other bytes")
            process.stderr.close()
    print("clocks: %d runs with %d jumps" % (count, jumps))


def last_step(path):
    """What --verbose has said last."""
    with open(path, "rb") as file:
        lines = file.read().decode(errors="replace").splitlines()
    steps = [line for line in lines if ", after " in line]
    return steps[-1].split(", after ")[0].split(":")[-1].strip() if steps else "begin"


def interrupts(solve, count, rng, datasets, slower):
    """SIGINT at moments spread over the run: how long until the end?"""
    inputs = {"office": os.path.join(SOURCE, "datasets/office.clf.gz")}
    if datasets:
        inputs["mit-killian"] = os.path.join(datasets, "mit-killian.clf.bz2")
        inputs["city10000"] = os.path.join(datasets, "graphs/city10000.g2o.bz2")
    said = os.path.join(solve.root, "said")
    for name, path in inputs.items():
        kept = os.path.join(solve.root, "states_" + name)
        os.makedirs(kept)

        def command(folder):
            return [solve.binary, "--input=" + path, "--output_dir=" + folder,
                    "--num_threads=1", "--verbose", "--checkpoint_every=1e-9"]

        def start(folder):
            with open(said, "w") as file:
                return subprocess.Popen(command(folder), stderr=file,
                                        stdout=subprocess.DEVNULL)

        folder = new_folder(solve.root, "interrupted_" + name)
        process = start(folder)
        # One that waits for the process would take its times.
        states = []
        waiter = threading.Thread(target=lambda: os.waitid(
            os.P_PID, process.pid, os.WEXITED | os.WNOWAIT))
        waiter.start()
        checkpoint = os.path.join(folder, "checkpoint.plumbline")
        while waiter.is_alive():
            try:
                state = os.path.join(kept, str(os.stat(checkpoint).st_mtime_ns))
                if not os.path.exists(state):
                    os.link(checkpoint, state)
                    states.append((cpu_seconds(process.pid), state))
            except OSError:
                pass
            time.sleep(0.005)
        status, length, _ = finish(process)
        if status != 0:
            finding("%s: status %d" % (name, status))
            continue
        worst = []
        times = count if name == "office" else max(1, count // 3)
        for i in range(times):
            at = length * (i + rng.random()) / times
            # A state is taken in the folder that it was made in, and nowhere
            # else.
            for entry in os.listdir(folder):
                if entry != "thesis.tex":
                    os.remove(os.path.join(folder, entry))
            # From the last state before.
            before = [state for state in states if state[0] <= at]
            if before:
                shutil.copy(before[-1][1],
                            os.path.join(folder, "checkpoint.plumbline"))
                at -= before[-1][0]
            process = start(folder)
            alive = wait_for_cpu(process, at)
            step = last_step(said)
            spent = cpu_seconds(process.pid)
            begin = time.monotonic()
            # send_signal would take the status of one that has just ended.
            os.kill(process.pid, signal.SIGINT)
            status, total, _ = finish(process)
            wall = time.monotonic() - begin
            if not alive or spent is None or status == 0:
                worst.append((0.0, 0.0, "after the end"))
            else:
                worst.append((total - spent, wall, step))
                # Before the flags are read the signal ends the process; once
                # the files are being written they come out whole.
                if (status not in (130, -signal.SIGINT) or state_of(folder)
                        not in ("none", "partial", "whole")):
                    finding("%s, interrupt %d: status %d, folder %s" %
                            (name, i, status, state_of(folder)))
                if total - spent > 2.0 * slower:
                    finding("%s, interrupt in '%s': %.2f s of processor until "
                            "the end" % (name, step, total - spent))
        worst.sort(reverse=True)
        print("interrupts, %s (%.1f s of processor, %d states): %d; longest "
              "until the end:" % (name, length, len(states), times))
        for processor, wall, step in worst[:8]:
            print("  %.2f s of processor, %.2f s by the clock, after '%s'" %
                  (processor, wall, step), flush=True)


def cpu_of_tree(pid):
    """Processor time of a process with its children, s, also of those that it
    has waited for; None once it has ended."""
    own = cpu_seconds(pid)
    if own is None:
        return None
    total = own
    try:
        with open("/proc/%d/stat" % pid) as file:
            fields = file.read().rsplit(")", 1)[1].split()
        total += (int(fields[13]) + int(fields[14])) / os.sysconf("SC_CLK_TCK")
        with open("/proc/%d/task/%d/children" % (pid, pid)) as file:
            children = file.read().split()
    except OSError:
        return total
    return total + sum(cpu_of_tree(int(child)) or 0.0 for child in children)


def wait_for_tree(process, seconds):
    """False when the process ends before."""
    while True:
        spent = cpu_of_tree(process.pid)
        if spent is None:
            return False
        if spent >= seconds:
            return True
        time.sleep(min(0.05, max(0.002, (seconds - spent) / 2)))


def interrupted_binaries(solve, count, rng, datasets, slower):
    """The same with the other binaries, SIGINT and SIGTERM by turns. What they
    were to write is there whole or as it was."""
    def binary(name):
        return os.path.join(os.path.dirname(solve.binary), "plumbline_" + name)

    folder = new_folder(solve.root, "binaries")
    log = os.path.join(folder, "input.log")
    repeated(6, True, log)
    if datasets:
        log = os.path.join(datasets, "mit-killian.clf.bz2")
    path = os.path.join(folder, "path.tum")
    with open(path, "w") as file:
        for i in range(400000):
            file.write("%d %f %f 0 0 0 0 1\n" % (i, 0.01 * i, rng.random()))
    short = os.path.join(folder, "short.log")
    with open(short, "w") as file:
        file.write(office(250))
    output = os.path.join(folder, "output")
    commands = {
        "simulate": [binary("simulate"), "--world=office", "--speed=0.2",
                     "--scan_rate=50", "--output=" + output,
                     "--truth=" + output + ".json"],
        "inspect": [binary("inspect"), log],
        "evaluate": [binary("evaluate"), "--trajectory=" + path,
                     "--reference=" + path, "--output=" + output,
                     "--pose_errors=" + output + ".csv"],
        "experiments": [binary("experiments"), "--experiment=S6", "--trials=200",
                        "--num_threads=1",
                        "--output_dir=" + os.path.join(folder, "experiments")],
        "sweep": [binary("sweep"), "--grid=link_radius=5,10,20", "--jobs=1",
                  "--quiet", "--output_dir=" + os.path.join(folder, "sweep"),
                  "--", solve.binary, "--input=" + short, "--num_threads=1",
                  "--quiet"]}
    for name, command in commands.items():
        def start():
            return subprocess.Popen(command, stdout=subprocess.DEVNULL,
                                    stderr=subprocess.DEVNULL,
                                    stdin=subprocess.DEVNULL)

        status, length, _ = finish(start())
        if status != 0:
            finding("%s: status %d" % (name, status))
            continue
        wanted = digest(output) if os.path.exists(output) else ""
        worst = 0.0
        ended = 0
        for i in range(count):
            shutil.rmtree(os.path.join(folder, "sweep"), ignore_errors=True)
            process = start()
            alive = wait_for_tree(process, length * (i + rng.random()) / count)
            spent = cpu_of_tree(process.pid)
            os.kill(process.pid, [signal.SIGINT, signal.SIGTERM][i % 2])
            status, total, _ = finish(process)
            if not alive or spent is None or status == 0:
                ended += 1
                continue
            worst = max(worst, total - spent)
            # Before the flags are read the signal ends the process.
            if status not in (130, -signal.SIGINT, -signal.SIGTERM):
                finding("%s, interrupt %d: status %d" % (name, i, status))
            if total - spent > 2.0 * slower:
                finding("%s, interrupt %d: %.2f s of processor until the end" %
                        (name, i, total - spent))
            if wanted and digest(output) != wanted:
                finding("%s, interrupt %d: another output" % (name, i))
        left = [entry for entry in os.listdir(folder) if ".tmp" in entry]
        if left or not foreign_ok(folder):
            finding("%s: left behind: %s" % (name, " ".join(left)))
        for entry in os.listdir(folder):
            if entry.startswith("output"):
                os.remove(os.path.join(folder, entry))
        print("interrupts, %s (%.1f s of processor): %d, %d of them after the "
              "end; at most %.2f s of processor until the end" %
              (name, length, count, ended, worst), flush=True)


def repeated(copies, has_jump, path):
    """The bundled log, driven so many times: over and over from its start, with
    a jump of odometry between, or there and back."""
    header, scans = [], []
    with gzip.open(os.path.join(SOURCE, "datasets/office.clf.gz"), "rt") as log:
        for line in log:
            (scans if line.startswith("FLASER") else header).append(line.split())
    stamp = 1000.0
    with open(path, "w") as file:
        for words in header:
            if words and (words[0].startswith("#") or words[0] == "PARAM"):
                file.write(" ".join(words) + "\n")
        for copy in range(copies):
            for words in scans if has_jump or copy % 2 == 0 else scans[::-1]:
                stamp += 0.2
                file.write(" ".join(words[:-3] + ["%f" % stamp, words[-2],
                                                  "%f" % stamp]) + "\n")


def copies_of_a_log(solve, numbers):
    """Time and memory grow with the length of a log, not with its square."""
    for has_jump in (False, True):
        one = None
        for copies in numbers:
            log = os.path.join(solve.root, "copies.log")
            repeated(copies, has_jump, log)
            folder = os.path.join(solve.root, "copies")
            # What all others are compared with is short: the middle of five.
            runs = []
            for _ in range(5 if one is None else 1):
                process = subprocess.Popen(
                    [solve.binary, "--input=" + log, "--output_dir=" + folder,
                     "--num_threads=1", "--quiet"], stderr=subprocess.DEVNULL)
                runs.append(finish(process))
            runs.sort(key=lambda run: run[1])
            status, seconds, memory = runs[len(runs) // 2]
            if status != 0:
                finding("%d copies: status %d" % (copies, status))
                continue
            with open(os.path.join(folder, "summary.json")) as file:
                relations = json.load(file)["counts"]["constraints"][
                    "pose_pose"]["measurement"]
            if one is None:
                one = (seconds / copies, memory)
            print("%d copies, %s: %.1f s of processor (%.1f times one), %.0f MB "
                  "(%.1f times), %d relations between poses" %
                  (copies, "with jumps" if has_jump else "without jumps",
                   seconds, seconds / one[0], memory, memory / one[1],
                   relations), flush=True)
            if copies >= 20 and max(seconds / one[0],
                                  memory / one[1]) > 1.25 * copies:
                finding("%d copies cost too much" % copies)


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
CONSTRAINTS = "# walls\nsame 1,0 3,0\ndistance 1,0 1,3 3.05 sigma=0.05 hard\n"
WORLD = "wall 0 0 10 0\nwall 10 0 10 8\nwall 10 8 0 8\nwall 0 8 0 0\npath 2 2 8 2 8 6 2 6\n"
WORDS = [b"nan", b"inf", b"-1", b"1e400", b"1e-400", b"99999999999999999999",
         b"2147483647", b"", b"x", b"\xff\xfe", b"\x00", b"{", b"[", b"\"",
         b"--", b"=", b"+0.5", b"0x10", b"1e308", b"-0"]


def drawing():
    """Three walls as DXF."""
    text = "0\nSECTION\n2\nHEADER\n9\n$INSUNITS\n70\n6\n0\nENDSEC\n0\nSECTION\n2\nENTITIES\n"
    for line in ((0, 0, 4, 0), (4, 0, 4, 3), (0, 3, 4, 3)):
        text += "0\nLINE\n8\nWALLS\n10\n%d\n20\n%d\n11\n%d\n21\n%d\n" % line
    return text + "0\nENDSEC\n0\nEOF\n"


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


def bad_inputs(binaries, root, count, rng, slower):
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
        "plan": lambda: solve("--input=" + good_log, "--plan=" + write(
            "plan.dxf", spoil(drawing(), rng))),
        "constraints": lambda: solve("--input=" + good_log, "--constraints=" + write(
            "constraints", spoil(CONSTRAINTS, rng))),
        "inspect": lambda: [os.path.join(binaries, "plumbline_inspect"),
                            write("inspected.log", spoil(log, rng))],
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
            result = subprocess.run(command, capture_output=True,
                                    timeout=60 * slower,
                                    text=True, errors="replace",
                                    stdin=subprocess.DEVNULL)
        except subprocess.TimeoutExpired:
            finding("%s %d takes more than %g s" % (name, i, 60 * slower))
            continue
        status = result.returncode
        statuses[status] = statuses.get(status, 0) + 1
        explained = status == 0 or "expected" in result.stderr + result.stdout
        if status not in (0, 1, 2) or not explained:
            shutil.copytree(folder, os.path.join(root, "found_%d" % i))
            finding("%s %d: status %d: %s" % (name, i, status, result.stderr[:300]))
    print("bad inputs: %d of %d kinds; statuses %s" %
          (count, len(kinds), dict(sorted(statuses.items()))))


PARTS = ["kills", "resumed", "full_disk", "folders", "clocks", "interrupts",
         "bad_inputs", "copies"]


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("bin_dir")
    parser.add_argument("--kills", type=int, default=100)
    parser.add_argument("--bad_inputs", type=int, default=1000)
    parser.add_argument("--interrupts", type=int, default=40,
                        help="of the bundled log; a third of it of each other")
    parser.add_argument("--copies", default="1,2,5,10,20")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--datasets", default="",
                        help="folder of the public logs and graphs")
    parser.add_argument("--slower", type=float, default=1.0,
                        help="how many times slower than those of a release "
                        "build the binaries are; bounds on times grow by it")
    parser.add_argument("--parts", default=",".join(PARTS))
    arguments = parser.parse_args()
    parts = arguments.parts.split(",")
    if not set(parts) <= set(PARTS):
        parser.error("--parts: expected some of " + ", ".join(PARTS))
    rng = random.Random(arguments.seed)
    root = tempfile.mkdtemp(prefix="plumbline_faults_")
    solve = Solve(os.path.abspath(arguments.bin_dir), root)
    if "kills" in parts:
        kills(solve, arguments.kills, rng)
    if "resumed" in parts:
        resumed(solve, arguments.kills, rng, arguments.datasets)
    if "full_disk" in parts:
        full_disk(solve)
        full_tmpfs(solve)
    if "folders" in parts:
        folders(solve, rng)
    if "clocks" in parts:
        clocks(solve, rng)
    if "interrupts" in parts:
        interrupts(solve, arguments.interrupts, rng, arguments.datasets,
                   arguments.slower)
        interrupted_binaries(solve, max(2, arguments.interrupts // 4), rng,
                             arguments.datasets, arguments.slower)
    if "bad_inputs" in parts:
        # The same ones whichever parts are run.
        bad_inputs(arguments.bin_dir, root, arguments.bad_inputs,
                   random.Random(arguments.seed), arguments.slower)
    if "copies" in parts:
        copies_of_a_log(solve, [int(n) for n in arguments.copies.split(",")])
    if findings:
        print("%d findings; the files are in %s" % (len(findings), root))
        return 1
    shutil.rmtree(root)
    print("nothing found")
    return 0


if __name__ == "__main__":
    sys.exit(main())
