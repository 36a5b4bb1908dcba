"""Measures the memory of `advpipe import files` at two lengths of a drive: it has to be the same.

    python benchmarks/import_memory.py [--frames 200 2000] [--points 60000] [--folder FOLDER]

The clouds are random, 16 bytes a point, and are links to ten files, so that 2,000 of them take little room;
what is imported of them is written in full. Exit code 1 where the peak of the longest drive is more than
MOST_MB above that of the shortest.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

MOST_MB = 50
FILES = 10
MEASURED = """
import json, resource, sys
from advpipe.pipeline.cli import app
try:
    app(sys.argv[1:])
finally:
    print(json.dumps(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024), file=sys.stderr)
"""


def make_drive(folder: Path, frames: int, points: int) -> None:
    """A folder of so many clouds."""
    rng = np.random.default_rng(0)
    (folder / "drive").mkdir(parents=True)
    for index in range(FILES):
        table = rng.uniform((-60, -60, -2, 0), (60, 60, 0, 1), (points, 4)).astype("<f4")
        table.tofile(folder / f"{index}.cloud")
    for index in range(frames):
        os.link(folder / f"{index % FILES}.cloud", folder / "drive" / f"{index:06d}.bin")


def peak_mb(folder: Path) -> float:
    """The peak of resident memory of an import, in a process of its own."""
    command = [sys.executable, "-c", MEASURED, "import", "files", str(folder / "drive")]
    done = subprocess.run(
        [*command, "--out", str(folder / "out"), "--quiet"], check=True, capture_output=True, text=True
    )
    return float(json.loads(done.stderr.splitlines()[-1]))


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--frames", type=int, nargs="+", default=[200, 2000])
    parser.add_argument("--points", type=int, default=60_000)
    parser.add_argument("--folder", type=Path, help="where to work; the system's folder for temporary files")
    options = parser.parse_args()
    peaks = []
    for frames in options.frames:
        with tempfile.TemporaryDirectory(dir=options.folder) as name:
            folder = Path(name)
            make_drive(folder, frames, options.points)
            begin_s = time.monotonic()
            peaks.append(peak_mb(folder))
            elapsed_s = time.monotonic() - begin_s
            written = sum(file.stat().st_size for file in (folder / "out").rglob("*.mcap")) / 1e6
            gigabytes = frames * options.points * 16 / 1e9
            print(
                f"{frames:6} clouds, {gigabytes:5.2f} GB: peak {peaks[-1]:6.0f} MB, {elapsed_s:6.1f} s, "
                f"{written:,.0f} MB written",
                flush=True,
            )
    return int(peaks[-1] > peaks[0] + MOST_MB)


if __name__ == "__main__":
    sys.exit(main())
