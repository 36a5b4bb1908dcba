"""What a frame costs in drives of 100 to 30,000 frames: recorded, attacked, evaluated, and read by itself.

    python benchmarks/scale_length.py [--counts 100 1000 10000 30000] [--workers 1]

The drives are those of the simulator, in files of a minute: a boulevard with 30 vehicles, CAMs, GNSS and IMU;
the LiDAR is a light one (16 rings, 3,400 points a cloud), since what grows with a drive's length is not what
grows with its clouds. 30,000 frames are 50 minutes at 10 Hz. Each command runs in a process of its own, on
every frame: `simulate`; `attack` (a tenth of the points removed at random); `evaluate` with the checks for
attacks and localisation; a random attack has no random baseline beside it, and V2X is not attacked. The
detector takes no time: what is measured is advpipe. All of it takes 40 minutes of one core; --keep FOLDER
keeps the drives, and goes on with those there: what was made before is not measured, and the mark not judged.

Printed for each command: milliseconds of processor time a frame, and the most memory that a process took; and
from one length to the next, what each further frame costs, in both. The mark: a further frame of the longest
drive costs at most 1.25 times that of the second one; memory grows by at most 20 kB a frame.

Frames of the same scenario are not of quite the same work: traffic comes and goes, and CAMs with it. So the
messages of each further frame are printed beside its cost, for the reader to judge by. The mark is of frames
all the same, and corrected for nothing.
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from pathlib import Path

import numpy as np
from common import finish, machine, scratch

from advpipe import Detections, Range
from advpipe.pipeline.bag.frame_reader import FrameReader
from advpipe.pipeline.bag.reader import BagReader

FLAT, GROWTH_KB = 1.25, 20.0
READS = 100
FEWEST_LENGTHS = 3
MADE = ("clean", "removed", "report")

SCENARIO = """
name: length
simulation: {{seed: 1, duration_s: {duration_s}, warmup_s: 5}}
map: {{sumo_net: boulevard.net.xml}}
traffic: {{vehicles: 30, pedestrians: 5, parked_per_km: 10}}
sensors: {{lidars: {{lidar: {{channels: 16, points_per_second: 36000}}}}}}
recording: {{split_s: 60}}
"""

DETECTOR = f"{Path(__file__).stem}:MiddleOfPoints"


class MiddleOfPoints:
    """One car in the middle of all points, at no cost."""

    classes = ("car",)
    range_m = Range(-51.2, -51.2, -5.0, 51.2, 51.2, 5.0)

    def detect(self, cloud: np.ndarray) -> Detections:
        """The car, always."""
        box = np.array([[cloud["x"].mean(), cloud["y"].mean(), -1.0, 4.5, 1.9, 1.6, 0.0]])
        return Detections(box, np.array([0.9]), np.zeros(1, np.int64))

    def loss(self, points: object, boxes: object, labels: object) -> object:
        """Of no use."""
        return points.sum() * 0.0  # type: ignore[attr-defined]


@dataclass(frozen=True)
class Cost:
    """Of a command on a whole drive; messages: of the drive."""

    cpu_s: float
    peak_mb: float
    messages: int = 0


def commands(drive: Path, workers: int) -> Mapping[str, Sequence[str]]:
    """By what each makes, under the drive's folder: the command that makes it."""
    attacked, some = str(drive / "removed"), ["--detector", DETECTOR, "--workers", str(workers)]
    removal = ["--type", "detach", "--recipe", "random", "--ratio", "10%"]
    return {
        "clean": ["simulate", str(drive.with_suffix(".yaml")), "--out", str(drive)],
        "removed": ["attack", str(drive), *removal, *some, "--out", attacked],
        "report": ["evaluate", str(drive / "clean"), attacked, *some, "--out", str(drive / "report")],
    }


def cost_of(command: Sequence[str]) -> Cost:
    """Run a command of advpipe; it may import the detector of this file."""
    paths = os.pathsep.join(filter(None, (str(Path(__file__).parent), os.environ.get("PYTHONPATH"))))
    running = subprocess.Popen(
        [sys.executable, "-m", "advpipe", *command, "-q"], env={**os.environ, "PYTHONPATH": paths}
    )
    _, status, used = os.wait4(running.pid, 0)
    if status:
        sys.exit(f"{' '.join(command)} ended with {status}")
    return Cost(used.ru_utime + used.ru_stime, used.ru_maxrss / 1024)


def reading(drive: Path) -> tuple[float, float]:
    """Milliseconds of processor time to open a bag, and to read one of `READS` frames all over it."""
    begin_s = time.process_time()
    reader = FrameReader(drive / "clean")
    opened_s = time.process_time() - begin_s
    frames = range(0, len(reader.times_ns), max(1, len(reader.times_ns) // READS))
    begin_s = time.process_time()
    for index in frames:
        reader.frame(index)
    return 1e3 * opened_s, 1e3 * (time.process_time() - begin_s) / len(frames)


def measured(folder: Path, count: int, workers: int) -> dict[str, Cost]:
    """The costs of a drive's commands, by what they made; without those that were made before."""
    drive = folder / f"length-{count}"
    drive.with_suffix(".yaml").write_text(SCENARIO.format(duration_s=count / 10))
    costs = {
        name: cost_of(command)
        for name, command in commands(drive, workers).items()
        if not (drive / name).exists()
    }
    opened_ms, read_ms = reading(drive)
    messages = sum(topic.count for topic in BagReader(drive / "clean").topics.values())
    said = "; ".join(
        f"{name} {1e3 * cost.cpu_s / count:.1f} ms, {cost.peak_mb:.0f} MB" for name, cost in costs.items()
    )
    print(
        f"{count:6,} frames of {messages / count:.1f} messages: {said}; "
        f"opened in {opened_ms:.1f} ms, a frame read in {read_ms:.2f} ms",
        flush=True,
    )
    return {name: replace(cost, messages=messages) for name, cost in costs.items()}


def further(name: str, shorter: tuple[int, Cost], longer: tuple[int, Cost]) -> tuple[float, float]:
    """What each further frame costs, in ms of processor time and kB; printed, too, with its messages."""
    (few, before), (many, after) = shorter, longer
    ms = 1e3 * (after.cpu_s - before.cpu_s) / (many - few)
    kb = 1e3 * (after.peak_mb - before.peak_mb) / (many - few)
    messages = (after.messages - before.messages) / (many - few)
    print(
        f"    {name:<8} {few:6,} to {many:6,} frames: {ms:6.2f} ms and {kb:6.2f} kB for each further frame, "
        f"of {messages:.1f} messages"
    )
    return ms, kb


def judged(by_count: Mapping[int, Mapping[str, Cost]]) -> str:
    """Whether the mark is met, by the costs of each length's commands: yes, NO, or not judged, and why."""
    missing, is_flat = [], True
    for name in MADE:
        costs = [(count, found[name]) for count, found in by_count.items() if name in found]
        steps = [further(name, *pair) for pair in pairwise(costs)]
        missing += [f"{name} of {count:,} frames" for count, found in by_count.items() if name not in found]
        if len(steps) > 1:
            is_flat &= steps[-1][0] <= FLAT * steps[0][0] and steps[-1][1] <= GROWTH_KB
    if missing:
        return f"not judged; made before, and so not measured: {', '.join(missing)}"
    if len(by_count) < FEWEST_LENGTHS:
        return f"not judged; that takes {FEWEST_LENGTHS} lengths"
    return "yes" if is_flat else "NO"


def main() -> None:
    """Measures all lengths; exit code 1 where a mark is missed or cannot be judged."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--counts", type=int, nargs="+", default=[100, 1000, 10_000, 30_000])
    parser.add_argument("--workers", type=int, default=1)
    parser.add_argument("--keep", type=Path)
    given = parser.parse_args()
    print(machine())
    with scratch() as temporary:
        folder = given.keep or Path(temporary)
        folder.mkdir(parents=True, exist_ok=True)
        by_count = {count: measured(folder, count, given.workers) for count in sorted(given.counts)}
    verdict = judged(by_count)
    print(f"cost a frame is flat: {verdict}")
    finish(verdict == "yes")


if __name__ == "__main__":
    main()
