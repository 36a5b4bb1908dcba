"""Runs independent jobs: in this process, in several, or on a cluster; results do not depend on where."""

from __future__ import annotations

from collections.abc import Callable, Generator, Sequence
from pathlib import Path
from typing import TypeVar

from advpipe.pipeline.core.job_engine import JobLimits, chosen_engine
from advpipe.pipeline.core.local_processes import LocalProcesses
from advpipe.pipeline.core.progress import track

Work = Callable[[int], None]
T = TypeVar("T")

JOBS_WORTH_A_WORKER = 4
"""A worker takes seconds to load its libraries: with fewer jobs each, fewer workers are faster."""


def stream_jobs(
    prepare: Callable[[], Callable[[int], T]],
    jobs: Sequence[int],
    description: str,
    workers: int | None = None,
    *,
    jobs_per_worker: int | None = None,
    writes: Path | None = None,
) -> Generator[tuple[int, T], None, None]:
    """Call `prepare()` in each worker, and the function that it returns once for each job; yield its results.

    prepare: can be pickled; what it loads is loaded in every worker. jobs: rising numbers of the jobs.
    workers: the most that work at a time, by default one for each of `usable_cores` or of the cluster's.
    jobs_per_worker: how many jobs are worth a process, by default `JOBS_WORTH_A_WORKER`. writes: the folder
    in which the jobs write themselves, which all workers must share.

    Yields each job with its result in the order in which they finish; results must be picklable. Raises the
    AdvpipeError of the first job that fails.
    """
    engine = chosen_engine() or LocalProcesses(description)
    limits = JobLimits(workers, jobs_per_worker or JOBS_WORTH_A_WORKER, writes)
    yield from track(engine.results(prepare, jobs, limits), description, len(jobs))


def run_jobs(
    prepare: Callable[[], Work], jobs: Sequence[int], description: str, workers: int | None = None
) -> None:
    """Run jobs as `stream_jobs` does, where their results are nothing."""
    for _ in stream_jobs(prepare, jobs, description, workers):
        pass


def map_jobs(
    prepare: Callable[[], Callable[[int], T]],
    jobs: Sequence[int],
    description: str,
    workers: int | None = None,
) -> list[T]:
    """Run jobs as `stream_jobs` does, and return their results in the jobs' order.

    Results must be small. Each process runs its jobs in their order.
    """
    results = dict(stream_jobs(prepare, jobs, description, workers))
    return [results[job] for job in jobs]
