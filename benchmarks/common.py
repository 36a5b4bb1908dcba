"""Timing on a shared machine: two implementations in one process, in alternating rounds."""

from __future__ import annotations

import ctypes
import os
import platform
import statistics
import sys
import tempfile
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path


@dataclass(frozen=True)
class Comparison:
    """Times in seconds of the same work done two ways, one of each per round."""

    name: str
    ours_s: tuple[float, ...]
    peer_s: tuple[float, ...]

    @property
    def ratio(self) -> float:
        """How many times as fast as the peer we are: the median over the rounds."""
        return statistics.median(peer / ours for ours, peer in zip(self.ours_s, self.peer_s, strict=True))

    def line(self, amount: float, unit: str, mark: float) -> str:
        """One line: both rates, as medians of `amount` a run, the ratio and whether it reaches the mark.

        mark: the required ratio; 0 for none.
        """
        ours, peer = (amount / statistics.median(times) for times in (self.ours_s, self.peer_s))
        verdict = f"mark {mark:.2f}  {'ok' if self.ratio >= mark else 'BELOW'}" if mark else ""
        return (
            f"{self.name:<34} ours {ours:9,.1f}  peer {peer:9,.1f} {unit}  ratio {self.ratio:5.2f}  {verdict}"
        ).rstrip()


def compare(
    name: str,
    ours: Callable[[], object],
    peer: Callable[[], object],
    rounds: int,
    tidy: Callable[[], object] = lambda: None,
) -> Comparison:
    """Times both once a round; who goes first changes. A round before them warms up and does not count.

    tidy: called before each, and not timed.
    """
    times: dict[Callable[[], object], list[float]] = {ours: [], peer: []}
    for number in range(rounds + 1):
        for work in (ours, peer) if number % 2 else (peer, ours):
            tidy()
            start_s = time.perf_counter()
            work()
            if number:
                times[work].append(time.perf_counter() - start_s)
    return Comparison(name, tuple(times[ours]), tuple(times[peer]))


def machine() -> str:
    """The machine of the measurements, in one line."""
    load = f", load {os.getloadavg()[0]:.1f}" if hasattr(os, "getloadavg") else ""
    return (
        f"{_processor()}, {os.cpu_count()} cores{load}; {platform.system()} {platform.machine()}, "
        f"Python {platform.python_version()}"
    )


def _processor() -> str:
    try:
        with open("/proc/cpuinfo", encoding="utf-8") as lines:
            names = [line.partition(":")[2].strip() for line in lines if line.startswith("model name")]
    except OSError:
        names = []
    return names[0] if names else platform.processor() or "unknown processor"


def scratch() -> tempfile.TemporaryDirectory[str]:
    """A folder in memory where there is one: a disk that others use makes figures of its own."""
    memory = Path("/dev/shm")
    return tempfile.TemporaryDirectory(dir=memory if memory.is_dir() else None)


def steady_memory() -> None:
    """Keep glibc from returning large blocks and fetching them again, which may hit one side only.

    The heap's layout decides when it does, and then a page fault for each 4 kB takes longer than the
    work that is timed.
    """
    mmap_threshold, trim_threshold = -3, -1  # as malloc.h has them
    mallopt = getattr(ctypes.CDLL(None), "mallopt", None) if sys.platform == "linux" else None
    if mallopt is not None:
        mallopt(mmap_threshold, 1 << 25)  # the most that it takes
        mallopt(trim_threshold, 1 << 30)


def finish(passed: bool) -> None:
    """Ends the program: exit code 1 where a mark was missed."""
    sys.exit(0 if passed else 1)
