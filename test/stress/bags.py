#!/usr/bin/env python3
"""Writes bags of lasers that are hard to read, from a simulated drive.

    plumbline_simulate --world=office --scan_rate=20 --output=d.clf --truth=d.json
    bags.py d.json hard_bag --time_increment=0 --clockwise
    plumbline_solve --input=hard_bag --output_dir=out
    plumbline_evaluate --trajectory=out/trajectory.tum --reference=hard_bag.tum

The walls and poses of the truth are seen anew, beam by beam, by a laser that
turns while the robot drives. Writes a ROS 2 bag (a folder with .db3) and the
true poses at the time stamps. Needs numpy.
"""

import argparse
import json
import os
import sqlite3
import struct

import numpy as np

EPOCH = 1.7e9  # s
# What is done to all time stamps and names of frames, by the options.
STAMP = lambda time: EPOCH + time
FRAME = lambda name: name
RECORDED = lambda time: EPOCH + time


class Cdr:
    """Fields of a message, little endian."""

    def __init__(self):
        self.data = bytearray(b"\0\1\0\0")

    def align(self, size):
        self.data += b"\0" * (-(len(self.data) - 4) % size)

    def put(self, kind, *values):
        for value in values:
            self.align(struct.calcsize(kind))
            self.data += struct.pack("<" + kind, value)
        return self

    def text(self, value):
        self.put("I", len(value) + 1)
        self.data += value.encode() + b"\0"
        return self

    def header(self, time, frame):
        stamp = round(STAMP(time) * 1e9)
        return self.put("i", stamp // 10**9).put(
            "I", stamp % 10**9).text(FRAME(frame))

    def numbers(self, kind, values):
        self.align(struct.calcsize(kind))
        self.data += np.asarray(values, "<f%d" % struct.calcsize(kind)).tobytes()
        return self


class Bag:

    def __init__(self):
        self.topics = {}
        self.messages = []

    def add(self, time, topic, kind, message):
        index = self.topics.setdefault(topic, (len(self.topics) + 1, kind))[0]
        self.messages.append((time, round(RECORDED(time) * 1e9), index,
                              bytes(message.data)))

    def write(self, folder, files):
        os.makedirs(folder, exist_ok=True)
        # As they arrive, whatever the recorder's clock says.
        self.messages.sort(key=lambda message: message[0])
        self.messages = [message[1:] for message in self.messages]
        names = [f"bag_{i}.db3" for i in range(files)]
        for i, name in enumerate(names):
            cut = [len(self.messages) * k // files for k in (i, i + 1)]
            self.write_file(os.path.join(folder, name),
                            self.messages[cut[0]:cut[1]])
        lines = ["rosbag2_bagfile_information:", "  version: 4",
                 "  storage_identifier: sqlite3", "  relative_file_paths:"]
        lines += [f"    - {name}" for name in names]
        lines += [f"  message_count: {len(self.messages)}",
                  "  topics_with_message_count:"]
        for name, (index, kind) in self.topics.items():
            count = sum(message[1] == index for message in self.messages)
            lines += ["    - topic_metadata:", f"        name: {name}",
                      f"        type: {kind}",
                      "        serialization_format: cdr",
                      f"      message_count: {count}"]
        with open(os.path.join(folder, "metadata.yaml"), "w") as out:
            out.write("\n".join(lines) + "\n")

    def write_file(self, path, messages):
        if os.path.exists(path):
            os.remove(path)
        base = sqlite3.connect(path)
        base.execute("CREATE TABLE topics(id INTEGER PRIMARY KEY, name TEXT, "
                     "type TEXT, serialization_format TEXT, "
                     "offered_qos_profiles TEXT)")
        base.execute("CREATE TABLE messages(id INTEGER PRIMARY KEY, topic_id "
                     "INTEGER, timestamp INTEGER, data BLOB)")
        for name, (index, kind) in self.topics.items():
            base.execute("INSERT INTO topics VALUES(?, ?, ?, 'cdr', '')",
                         (index, name, kind))
        base.executemany(
            "INSERT INTO messages(timestamp, topic_id, data) VALUES(?, ?, ?)",
            messages)
        base.commit()


def cast(walls, circles, x, y, dx, dy):
    """Distances to the nearest surface, one per ray."""
    side_x, side_y = walls[:, 2] - walls[:, 0], walls[:, 3] - walls[:, 1]
    to_x, to_y = walls[:, 0] - x[:, None], walls[:, 1] - y[:, None]
    with np.errstate(all="ignore"):
        cross = dx[:, None] * side_y - dy[:, None] * side_x
        distance = (to_x * side_y - to_y * side_x) / cross
        along = (to_x * dy[:, None] - to_y * dx[:, None]) / cross
        hits = (distance > 1e-6) & (along >= 0) & (along <= 1)
        nearest = np.where(hits, distance, np.inf).min(1)
        for at_x, at_y, radius in circles:
            from_x, from_y = x - at_x, y - at_y
            half = from_x * dx + from_y * dy
            root = half * half - from_x**2 - from_y**2 + radius**2
            distance = -half - np.sqrt(root)
            hits = (root > 0) & (distance > 0) & (distance < nearest)
            nearest = np.where(hits, distance, nearest)
    return nearest


def drift(poses, noise, wheel):
    """Odometry: 2 % too far or as `wheel` has it, 3 % too much turn, and noise."""
    odometry = np.zeros_like(poses)
    odometry[0] = 3.0, -2.0, 1.0
    for i in range(1, len(poses)):
        step = poses[i] - poses[i - 1]
        cos, sin = np.cos(poses[i - 1, 2]), np.sin(poses[i - 1, 2])
        ahead = wheel * (cos * step[0] + sin * step[1])
        aside = -sin * step[0] + cos * step[1]
        turn = 1.03 * step[2] + 0.002 * ahead
        turn += 0.006 * noise.normal() * np.sqrt(abs(ahead) + abs(step[2]))
        x, y, heading = odometry[i - 1]
        cos, sin = np.cos(heading), np.sin(heading)
        odometry[i] = (x + cos * ahead - sin * aside,
                       y + sin * ahead + cos * aside, heading + turn)
    return odometry


def transform(message, time, parent, child, x, y, rotation):
    message.header(time, parent).text(FRAME(child)).put("d", x, y, 0.2, *rotation)


def parse():
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("truth")
    parser.add_argument("folder")
    parser.add_argument("--rate", type=float, default=5.0, help="scans, Hz")
    parser.add_argument("--uneven", type=float, default=0.0,
                        help="share by which the time between scans varies")
    parser.add_argument("--speed", type=float, default=1.0,
                        help="factor of the drive's speed and turn rate")
    parser.add_argument("--beams", type=int, default=360)
    parser.add_argument("--start", type=float, default=0.0, help="degrees")
    parser.add_argument("--clockwise", action="store_true")
    parser.add_argument("--view", type=float, default=360.0,
                        help="angle that beams are spread over, degrees")
    parser.add_argument("--range_max", type=float,
                        help="that messages state, m; by default the reach")
    parser.add_argument("--reach", type=float, default=12.0, help="m")
    parser.add_argument("--noise", type=float, default=0.01, help="m")
    parser.add_argument("--strays", type=float, default=0.0,
                        help="share of ranges that are anything")
    parser.add_argument("--lost", type=float, default=0.02,
                        help="share of beams without a return")
    parser.add_argument("--no_return", default="inf",
                        choices=["inf", "nan", "0", "max", "beyond", "mixed"],
                        help="max: range_max itself; beyond: more")
    parser.add_argument("--sweep", type=float, default=1.0,
                        help="share of the time between scans that a sweep "
                        "takes; 0: all beams at once")
    parser.add_argument("--time_increment", type=int, default=1,
                        help="0: messages do not say it")
    parser.add_argument("--yaw", type=float, default=0.0,
                        help="of the laser on the robot, degrees")
    parser.add_argument("--upside_down", action="store_true")
    parser.add_argument("--offset", type=float, default=0.15,
                        help="of the laser in front of the centre, m")
    parser.add_argument("--odometry", default="both",
                        choices=["both", "odom", "tf", "none"])
    parser.add_argument("--imu", action="store_true")
    parser.add_argument("--no_tf_static", action="store_true")
    parser.add_argument("--two_lasers", action="store_true")
    parser.add_argument("--clock", type=float, default=0.0,
                        help="by how much odometry's clock is ahead, s")
    parser.add_argument("--scan_delay", type=float, default=0.0,
                        help="by how much scans are recorded late, s")
    parser.add_argument("--recorder_clock", type=float, default=0.0,
                        help="by how much the recorder's clock is ahead, s")
    parser.add_argument("--clock_jump", type=float, default=0.0,
                        help="by how much all clocks jump half way, s")
    parser.add_argument("--odometry_until", type=float, default=1.0,
                        help="share of the drive after which odometry is gone")
    parser.add_argument("--odometry_from", type=float, default=0.0,
                        help="share of the drive before which there is none")
    parser.add_argument("--odometry_rate", type=float, default=30.0, help="Hz")
    parser.add_argument("--wheel", type=float, default=1.02,
                        help="metres that odometry has for one")
    parser.add_argument("--bits", type=float, default=0.0,
                        help="share of scans of which two beams are left")
    parser.add_argument("--nan_odometry", type=float, default=0.0,
                        help="share of odometry whose quaternion is no number")
    parser.add_argument("--odometry_reset", type=float, default=1.0,
                        help="share after which odometry begins at zero again")
    parser.add_argument("--zero_stamps", action="store_true",
                        help="of all headers")
    parser.add_argument("--stuck_stamps", type=int, default=1,
                        help="so many scans in a row have the same stamp")
    parser.add_argument("--static_late", action="store_true",
                        help="tf_static is recorded last")
    parser.add_argument("--point_cloud", action="store_true",
                        help="scans are of type PointCloud2")
    parser.add_argument("--multi_echo", action="store_true",
                        help="scans are of type MultiEchoLaserScan, some beams "
                        "with two echoes")
    parser.add_argument("--sweep_said", type=float,
                        help="that messages state, s, in place of the true one")
    parser.add_argument("--files", type=int, default=1,
                        help="that the bag is split into")
    parser.add_argument("--out_of_order", type=float, default=0.0,
                        help="share of scans recorded after the next one")
    parser.add_argument("--twice", type=float, default=0.0,
                        help="share of scans recorded twice")
    parser.add_argument("--slashes", action="store_true",
                        help="in front of the names of frames")
    parser.add_argument("--seed", type=int, default=1)
    return parser.parse_args()


def main():
    options = parse()
    noise = np.random.default_rng(options.seed)
    noise_of_order = np.random.default_rng(options.seed + 1000)
    global STAMP, FRAME, RECORDED
    if options.slashes:
        FRAME = lambda name: "/" + name
    with open(options.truth) as source:
        truth = json.load(source)
    walls = np.array([[wall[key] for key in ("x1", "y1", "x2", "y2")]
                      for wall in truth["walls"]])
    circles = [(c["x"], c["y"], c["r"]) for c in truth["circles"]]
    drive = np.array(truth["poses"])
    drive[:, 0] = (drive[:, 0] - drive[0, 0]) / options.speed
    drive[:, 3] = np.unwrap(drive[:, 3])
    end = drive[-1, 0]

    def clock(time):
        return EPOCH + time + (options.clock_jump if time > end / 2 else 0.0)

    STAMP = (lambda time: 0.0) if options.zero_stamps else clock
    RECORDED = lambda time: clock(time) + options.recorder_clock

    def poses_at(times):
        return np.stack([np.interp(times, drive[:, 0], drive[:, i])
                         for i in (1, 2, 3)], -1)

    bag = Bag()
    period = 1.0 / options.rate
    beams = options.beams
    step = np.radians(options.view) / beams * (-1 if options.clockwise else 1)
    start, yaw = np.radians(options.start), np.radians(options.yaw)
    per_beam = options.sweep * period * 0.999 / beams
    side = -1 if options.upside_down else 1

    def add_scan(time, topic, frame, offset, direction):
        poses = poses_at(time + per_beam * np.arange(beams))
        angles = start + step * np.arange(beams)
        heading = poses[:, 2] + direction + side * angles
        ranges = cast(walls, circles,
                      poses[:, 0] + offset * np.cos(poses[:, 2]),
                      poses[:, 1] + offset * np.sin(poses[:, 2]),
                      np.cos(heading), np.sin(heading))
        ranges += noise.normal(0.0, options.noise, beams)
        is_stray = noise.random(beams) < options.strays
        ranges = np.where(is_stray, ranges * noise.uniform(0.2, 1.2, beams),
                          ranges)
        is_lost = ((ranges > options.reach) | (ranges < 0.15)
                   | (noise.random(beams) < options.lost))
        kinds = {"inf": [np.inf], "nan": [np.nan], "0": [0.0],
                 "max": [options.reach], "beyond": [options.reach + 5.0],
                 "mixed": [np.inf, np.nan, 0.0]}[options.no_return]
        ranges = np.where(is_lost, noise.choice(kinds, beams), ranges)
        number = round((time - 0.5) / period)
        stuck = number % options.stuck_stamps * period
        message = Cdr().header(time - stuck, frame)
        if options.bits > noise_of_order.random():
            ranges = ranges[:2]
        count = len(ranges)
        increment = per_beam if options.time_increment else 0.0
        if options.sweep_said is not None:
            increment = options.sweep_said / beams
        message.put("f", start, start + step * (count - 1), step,
                    increment, period, 0.15,
                    options.reach if options.range_max is None
                    else options.range_max)
        message.put("I", count)
        if options.multi_echo:
            for i, value in enumerate(ranges):
                echoes = [value, value + 0.5][:1 + (i % 5 == 0)]
                echoes = echoes if np.isfinite(value) else []
                message.put("I", len(echoes)).put("f", *echoes)
        else:
            message.numbers("f", ranges)
        message.put("I", 0)
        late = period + 0.01 + options.scan_delay
        if options.out_of_order > noise_of_order.random():
            late += 1.5 * period
        kind = ("PointCloud2" if options.point_cloud else
                "MultiEchoLaserScan" if options.multi_echo else "LaserScan")
        bag.add(time + late, topic, "sensor_msgs/msg/" + kind, message)
        if options.twice > noise_of_order.random():
            bag.add(time + late + 0.001, topic, "sensor_msgs/msg/" + kind,
                    message)

    with open(options.folder.rstrip("/") + ".tum", "w") as reference:
        time = 0.5
        while time < end - 1.0:
            x, y, heading = poses_at(time)
            stamp = (RECORDED(time + period + 0.01 + options.scan_delay)
                     if options.zero_stamps else clock(time))
            reference.write(f"{stamp:.9f} {x:.6f} {y:.6f} 0 0 0 "
                            f"{np.sin(heading / 2):.9f} "
                            f"{np.cos(heading / 2):.9f}\n")
            add_scan(time, "/scan", "laser", options.offset, yaw)
            if options.two_lasers:
                add_scan(time + 0.03, "/scan_rear", "rear", -options.offset,
                         yaw + np.pi)
            time += period * (1.0 + options.uneven * noise.uniform(-1, 1))

    times = np.arange(0.0, end, 1.0 / options.odometry_rate)
    true = poses_at(times)
    odometry = drift(true, noise, options.wheel)
    after = times > options.odometry_reset * end
    if after.any():
        first = odometry[after][0]
        cos, sin = np.cos(first[2]), np.sin(first[2])
        moved = odometry[after] - first
        odometry[after] = np.stack(
            [cos * moved[:, 0] + sin * moved[:, 1],
             -sin * moved[:, 0] + cos * moved[:, 1], moved[:, 2]], -1)
    rates = np.gradient(true[:, 2]) * options.odometry_rate
    for i, time in enumerate(times):
        x, y, heading = odometry[i]
        turn = (0.0, 0.0, np.sin(heading / 2), np.cos(heading / 2))
        if noise_of_order.random() < options.nan_odometry:
            turn = (np.nan,) * 4
        stamp = time + options.clock
        is_there = (options.odometry_from * end <= time
                    <= options.odometry_until * end)
        if is_there and options.odometry in ("both", "odom"):
            message = Cdr().header(stamp, "odom").text(FRAME("base_link"))
            message.put("d", x, y, 0.0, *turn).numbers("d", np.zeros(78))
            bag.add(time + 0.005, "/odom", "nav_msgs/msg/Odometry", message)
        if is_there and options.odometry in ("both", "tf"):
            message = Cdr().put("I", 1)
            transform(message, stamp, "odom", "base_link", x, y, turn)
            bag.add(time + 0.006, "/tf", "tf2_msgs/msg/TFMessage", message)
        if options.imu:
            message = Cdr().header(time, "imu").put("d", 0.0, 0.0, 0.0, 1.0)
            message.numbers("d", np.zeros(9))
            message.put("d", 0.0, 0.0, rates[i] + 0.05 + noise.normal(0, 0.01))
            message.numbers("d", np.zeros(9)).put("d", 0.0, 0.0, 9.8)
            message.numbers("d", np.zeros(9))
            bag.add(time + 0.004, "/imu", "sensor_msgs/msg/Imu", message)
    if not options.no_tf_static:
        roll = np.pi if options.upside_down else 0.0
        message = Cdr().put("I", 2 if options.two_lasers else 1)
        frames = [("laser", options.offset, yaw),
                  ("rear", -options.offset, yaw + np.pi)]
        for frame, offset, angle in frames[:2 if options.two_lasers else 1]:
            rotation = (np.sin(roll / 2) * np.cos(angle / 2),
                        np.sin(roll / 2) * np.sin(angle / 2),
                        np.cos(roll / 2) * np.sin(angle / 2),
                        np.cos(roll / 2) * np.cos(angle / 2))
            transform(message, 0.0, "base_link", frame, offset, 0.0, rotation)
        bag.add(end + 1.0 if options.static_late else 0.0, "/tf_static",
                "tf2_msgs/msg/TFMessage", message)
    bag.write(options.folder, options.files)


if __name__ == "__main__":
    main()
