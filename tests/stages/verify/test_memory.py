"""Verifying takes no more memory for a longer drive."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

from advpipe.pipeline.bag.reader import BagReader
from advpipe.pipeline.bag.writer import BagWriter
from advpipe.pipeline.mcap.channel import RawMessage

SHORT, LONG = 4, 32
FLAT_MB = 6.0

MEASURE = """
import resource, sys
from pathlib import Path
from advpipe.stages.verify.run import verify
for name in sys.argv[1:]:
    found = {finding.check for finding in verify(Path(name)).findings}
    print(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024, *found)
"""


def again(reader: BagReader, times: int) -> Iterator[RawMessage]:
    """A drive of 1 s, so often."""
    for number in range(times):
        for raw in reader.raw_messages():
            late_ns = number * 10**9
            times_ns = (raw.log_time_ns + late_ns, raw.publish_time_ns + late_ns)
            yield replace(raw, log_time_ns=times_ns[0], publish_time_ns=times_ns[1])


def test_memory_stays_flat(data_set: Path, tmp_path: Path) -> None:
    """In one process, so that the peak of the longer drive is what it needs beyond the shorter one's.

    Headers keep their stamps, which `time` finds, and the IMU has gaps; every check sees all messages.
    """
    reader = BagReader(data_set / "clean")
    record = {**reader.provenance, "recovered": "{}"}
    bags = {times: tmp_path / f"bag{times}" for times in (SHORT, LONG)}
    for times, bag in bags.items():
        with BagWriter(bag, provenance=record) as writer:
            for raw in again(reader, times):
                writer.copy(raw)
    done = subprocess.run(
        [sys.executable, "-c", MEASURE, *map(str, bags.values())], capture_output=True, text=True, check=True
    )
    (first_mb, *found), (peak_mb, *_) = (line.split() for line in done.stdout.splitlines())
    content_mb = sum(len(raw.cdr) for raw in reader.raw_messages()) * (LONG - SHORT) / 1e6
    assert set(found) <= {"time", "rates"}
    assert content_mb > 4 * FLAT_MB
    assert float(peak_mb) - float(first_mb) < FLAT_MB
