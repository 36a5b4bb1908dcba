"""Where jobs run: the seam between `jobs`, which everything calls, and local processes or a cluster."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import ClassVar, Protocol, TypeVar

T = TypeVar("T")


@dataclass(frozen=True)
class JobLimits:
    """How jobs may be spread.

    workers: the most that work at a time, None for as many as there are. jobs_per_worker: how many jobs are
    worth a further process of this machine. writes: the folder in which the jobs write, None if they only
    return results.
    """

    workers: int | None = None
    jobs_per_worker: int = 1
    writes: Path | None = None


class JobEngine(Protocol):
    """Runs jobs somewhere."""

    is_elsewhere: ClassVar[bool]
    """Whether jobs run on other machines: this one needs no GPU of its own."""

    def results(
        self, prepare: Callable[[], Callable[[int], T]], jobs: Sequence[int], limits: JobLimits
    ) -> Iterator[tuple[int, T]]:
        """Yield each job with its result, in the order in which they finish.

        `prepare()` is called at least once in each process that runs jobs, and the function that it returns
        is called with jobs in rising order. Raises the error of the first job that fails.
        """


_engine: JobEngine | None = None


@contextmanager
def use_engine(engine: JobEngine) -> Iterator[None]:
    """Within the block, all jobs run on this engine."""
    global _engine
    before, _engine = _engine, engine
    try:
        yield
    finally:
        _engine = before


def chosen_engine() -> JobEngine | None:
    """The engine that `use_engine` chose; None for processes of this machine."""
    return _engine


def runs_elsewhere() -> bool:
    """Whether jobs run on other machines."""
    return _engine is not None and _engine.is_elsewhere
