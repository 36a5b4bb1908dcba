"""Radar scans and their returns as probes see them, and the probes."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from advpipe.pipeline.audit.probe import Float64, Probe
from advpipe.pipeline.messages.radar import StampedScan

_FIELDS = ("range", "azimuth", "elevation", "velocity", "amplitude")
_COUNTS = ("returns_added", "returns_removed")


@dataclass(frozen=True)
class ScanView:
    """One scan with N returns."""

    scan: StampedScan
    log_time_ns: int

    @cached_property
    def equal_values(self) -> Float64:
        """How many numbers (N,) of a return are exactly those of another."""
        total = np.zeros(len(self.scan.returns))
        for name in _FIELDS:
            _, place, count = np.unique(self.scan.returns[name], return_inverse=True, return_counts=True)
            total += count[place.reshape(-1)] > 1
        return total

    @cached_property
    def roundness(self) -> Float64:
        """How many bits at the end of a return's numbers (N,) are zero."""
        total = np.zeros(len(self.scan.returns))
        for name in _FIELDS:
            bits = np.ascontiguousarray(self.scan.returns[name]).view(np.uint32)
            low = (bits & (~bits + np.uint32(1))).astype(np.float64)
            total += np.where(bits == 0, 23.0, np.log2(np.maximum(low, 1.0)))
        return total

    @cached_property
    def out_of_order(self) -> Float64:
        """How far behind (N,) its rank by range a return stands, as a share of the scan; 0 where scans are
        sorted by range, whatever the range that an attack gives it."""
        count = len(self.scan.returns)
        rank = np.empty(count)
        rank[np.argsort(self.scan.returns["range"], kind="stable")] = np.arange(count)
        return (np.arange(count) - rank) / max(count, 1)

    @cached_property
    def steps_back(self) -> Float64:
        """Whether a return (N,) is nearer than the one before, where scans are sorted by range."""
        return np.append(0.0, (np.diff(self.scan.returns["range"]) < 0).astype(np.float64))[
            : len(self.scan.returns)
        ]


def _single(value: float) -> Float64:
    return np.array([value], np.float64)


SCAN_PROBES: tuple[Probe[ScanView], ...] = (
    Probe("returns", "scan", "number of returns", lambda v: _single(len(v.scan.returns)), _COUNTS),
    Probe("steps-back", "scan", "share of returns that are nearer than the one before",
          lambda v: _single(v.steps_back.mean() if len(v.scan.returns) else 0.0)),
    Probe("log-time", "scan", "log time after the stamp",
          lambda v: _single((v.log_time_ns - v.scan.stamp_ns) / 1e9)),
)  # fmt: skip

RETURN_PROBES: tuple[Probe[ScanView], ...] = (
    Probe("place", "return", "place in the array after its rank by range, of the length",
          lambda v: v.out_of_order),
    Probe("steps-back", "return", "nearer than the one before", lambda v: v.steps_back),
    Probe("digits", "return", "zero bits at the end of its numbers", lambda v: v.roundness),
    Probe("equal-values", "return", "numbers that are exactly those of another return",
          lambda v: v.equal_values),
)  # fmt: skip
