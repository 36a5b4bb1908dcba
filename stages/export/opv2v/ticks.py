"""The numbers by which OPV2V names the files of an instant."""

from __future__ import annotations

from collections.abc import Container, Mapping

from advpipe.pipeline.core.errors import AdvpipeError

TICK_NS = 50_000_000
"""Of CARLA in OPV2V, 20 a second."""

_COARSE_NS = 1_000_000


class Ticks(Container[int]):
    """Stamps and their ticks since the first one, or those that the drive's source had. notes: sentences."""

    def __init__(self, of_source: Mapping[int, str] | None = None) -> None:
        self._of_source = of_source or {}
        self._names: dict[int, str] = {}
        self._first_ns = 0
        self.notes: set[str] = set()

    def __contains__(self, stamp_ns: object) -> bool:
        return stamp_ns in self._names

    def __len__(self) -> int:
        return len(self._names)

    def add(self, stamp_ns: int) -> None:
        """A later stamp than all before. Raises AdvpipeError if it falls into the tick of another."""
        if stamp_ns in self._of_source:
            self._names[stamp_ns] = self._of_source[stamp_ns]
            return
        if not self._names:
            self._first_ns = stamp_ns
        elapsed_ns = stamp_ns - self._first_ns
        tick = round(elapsed_ns / TICK_NS)
        if abs(elapsed_ns - tick * TICK_NS) > _COARSE_NS:
            self.notes.add("Stamps are rounded to OPV2V's ticks of 50 ms.")
        name = f"{tick:06d}"
        if self._names and name == next(reversed(self._names.values())):
            raise AdvpipeError(f"two clouds lie in one tick of {TICK_NS / 1e6:g} ms; OPV2V has one a tick")
        self._names[stamp_ns] = name

    def name(self, stamp_ns: int) -> str:
        """The name of an instant's files, such as 000068."""
        return self._names[stamp_ns]
