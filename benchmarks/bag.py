"""Measures how fast bags are written and read, relative to the bare MCAP library with the same checks.

    python benchmarks/bag.py [--frames 120] [--rounds 7]

Exit code 1 where writing is below 0.9 or reading clouds below 0.8 of the library's speed.
"""

from __future__ import annotations

import argparse
import shutil
from functools import partial
from pathlib import Path
from types import SimpleNamespace
from typing import NamedTuple

import mcap.writer
import numpy as np
import zstandard
from common import compare, finish, machine, scratch, steady_memory
from mcap.reader import make_reader
from mcap.writer import CompressionType

from advpipe.pipeline.bag.frames import read_frames
from advpipe.pipeline.bag.reader import BagReader
from advpipe.pipeline.bag.writer import BagWriter
from advpipe.pipeline.geometry.boxes import Boxes
from advpipe.pipeline.mcap.channel import Topic
from advpipe.pipeline.mcap.writer import ZSTD_LEVEL
from advpipe.pipeline.messages import build, topics
from advpipe.pipeline.messages.cloud import POINT_DTYPE, Cloud, cloud_to_cdr
from advpipe.pipeline.messages.types import schema_text, serialise

WRITE_MARK, READ_MARK = 0.9, 0.8
CHANNELS, COLUMNS, ROAD_USERS = 64, 1800, 60
EGO = topics.VehicleTopics()
COMPRESSIONS = {"none": CompressionType.NONE, "lz4": CompressionType.LZ4, "zstd": CompressionType.ZSTD}


class Message(NamedTuple):
    topic: Topic
    cdr: bytes
    stamp_ns: int


def cloud(rng: np.random.Generator) -> Cloud:
    """A sweep from 2 m above a plane with walls 8 to 40 m away, with 2 cm of noise."""
    elevation = np.radians(np.linspace(-24.8, 2.0, CHANNELS))[:, None]
    azimuth = np.linspace(-np.pi, np.pi, COLUMNS, endpoint=False)[None, :]
    wall_m = (24 + 16 * np.sign(np.sin(7 * azimuth + rng.uniform(0, 6)))) / np.cos(elevation)
    ground_m = np.where(elevation < 0, 2.0 / np.maximum(-np.sin(elevation), 1e-6), np.inf)
    range_m = np.minimum(wall_m, ground_m) + rng.normal(0, 0.02, (CHANNELS, COLUMNS))
    points = np.zeros((CHANNELS, COLUMNS), POINT_DTYPE)
    points["x"] = range_m * np.cos(elevation) * np.cos(azimuth)
    points["y"] = range_m * np.cos(elevation) * np.sin(azimuth)
    points["z"] = range_m * np.sin(elevation)
    points["intensity"] = np.exp(-0.004 * range_m)
    points["ring"] = np.arange(CHANNELS)[:, None]
    points["time"] = np.linspace(0, 0.1, COLUMNS, endpoint=False)[None, :]
    return points.T.ravel()  # in the order of firing


def drive(frames: int) -> list[Message]:
    """Clouds and the small messages beside them, serialised."""
    rng = np.random.default_rng(0)
    clouds = [cloud(rng) for _ in range(8)]
    found = []
    for frame in range(frames):
        stamp_ns = 1_700_000_000_000_000_000 + frame * 100_000_000
        geometry = np.column_stack(
            [rng.uniform(-50, 50, (ROAD_USERS, 3)), rng.uniform(1, 5, (ROAD_USERS, 4))]
        )
        names = tuple(f"user{number}" for number in range(ROAD_USERS))
        boxes = Boxes(geometry, np.zeros(ROAD_USERS, np.int64), names, np.zeros((ROAD_USERS, 3)))
        pose = np.eye(4)
        small = {
            topics.CLOCK: build.clock(stamp_ns),
            topics.TF: build.transforms(stamp_ns, [("map", EGO.base_frame, pose)]),
            EGO.true_odometry: build.odometry(stamp_ns, pose, np.zeros(3), np.zeros(3)),
            EGO.gnss_fix: build.nav_sat_fix(stamp_ns, 48.0, 11.0, 500.0),
            EGO.objects: build.detections_message(stamp_ns, EGO.lidar_frame, boxes),
        }
        found += [Message(topic, serialise(item, topic.type), stamp_ns) for topic, item in small.items()]
        cdr = cloud_to_cdr(clouds[frame % len(clouds)], stamp_ns, EGO.lidar_frame)
        found.append(Message(EGO.lidar_points, cdr, stamp_ns))
    return found


def remove(*paths: Path) -> None:
    for path in paths:
        shutil.rmtree(path, ignore_errors=True) if path.is_dir() else path.unlink(missing_ok=True)


def write(path: Path, items: list[Message], compression: str) -> None:
    with BagWriter(path, provenance={}, compression=compression) as bag:
        for topic, cdr, stamp_ns in items:
            bag.write_cdr(topic, cdr, stamp_ns)


def write_bare(path: Path, items: list[Message], compression: str) -> None:
    with path.open("wb") as stream:
        writer = mcap.writer.Writer(stream, compression=COMPRESSIONS[compression], enable_data_crcs=True)
        writer.start("ros2")
        channels: dict[str, int] = {}
        for sequence, (topic, cdr, stamp_ns) in enumerate(items):
            if topic.name not in channels:
                schema = writer.register_schema(topic.type, "ros2msg", schema_text(topic.type).encode())
                channels[topic.name] = writer.register_channel(topic.name, "cdr", schema)
            writer.add_message(channels[topic.name], stamp_ns, cdr, stamp_ns, sequence)
        writer.finish()


def read(path: Path) -> float:
    reader = BagReader(path)
    return sum(touched(reader.cloud(raw).cloud) for raw in reader.raw_messages([EGO.lidar_points.name]))


def read_as_frames(path: Path) -> float:
    return sum(touched(frame.cloud) for frame in read_frames(path))


def read_bare(path: Path, offset: int) -> float:
    """`offset`: where in the message the points start."""
    with path.open("rb") as stream:
        return sum(
            touched(np.frombuffer(message.data, POINT_DTYPE, CHANNELS * COLUMNS, offset))
            for _, _, message in make_reader(stream, validate_crcs=True).iter_messages(
                [EGO.lidar_points.name]
            )
        )


def touched(points: Cloud) -> float:
    return float(points["x"][::100].sum())


def main() -> None:
    parser = argparse.ArgumentParser(description="Bags beside the bare MCAP library.")
    parser.add_argument("--frames", type=int, default=120)
    parser.add_argument("--rounds", type=int, default=7)
    options = parser.parse_args()
    steady_memory()
    # The library knows zstd's usual level only; both sides write the same bytes.
    mcap.writer.zstandard = SimpleNamespace(compress=partial(zstandard.compress, level=ZSTD_LEVEL))
    items = drive(options.frames)
    megabytes = sum(len(item.cdr) for item in items) / 1e6
    clouds = [item.cdr for item in items if item.topic == EGO.lidar_points]
    offset = len(clouds[0]) - 1 - CHANNELS * COLUMNS * POINT_DTYPE.itemsize
    print(machine())
    print(f"{len(items)} messages, {megabytes:.0f} MB; {len(clouds)} clouds of {CHANNELS} x {COLUMNS} points")
    passed = True
    with scratch() as folder:
        for compression in COMPRESSIONS:
            bag, bare, untold = (Path(folder) / name for name in ("bag", "bare.mcap", "untold"))
            result = compare(
                f"write, {compression}",
                partial(write, bag, items, compression),
                partial(write_bare, bare, items, compression),
                options.rounds,
                partial(remove, bag, bare),
            )
            print(result.line(megabytes, "MB/s", WRITE_MARK), flush=True)
            passed &= result.ratio >= WRITE_MARK
            remove(bag, bare, untold)
            write(bag, items, compression)
            path = bag / "bag_0.mcap"
            print(f"{'':<34} {megabytes * 1e6 / path.stat().st_size:.2f} times smaller than the messages")
            write(untold, [item for item in items if item.topic != EGO.objects], compression)
            for name, way, mark in (
                ("BagReader", partial(read, bag), READ_MARK),
                ("read_frames", partial(read_as_frames, untold), READ_MARK),
                (f"read_frames, {ROAD_USERS} boxes each", partial(read_as_frames, bag), 0.0),
            ):
                peer = partial(read_bare, path, offset)
                result = compare(f"{name}, {compression}", way, peer, options.rounds)
                print(result.line(sum(map(len, clouds)) / 1e6, "MB/s", mark), flush=True)
                passed &= result.ratio >= mark
    finish(passed)


if __name__ == "__main__":
    main()
