"""Many independent jobs, in this process or in several: the results must not hang on which."""

from __future__ import annotations

import os
import signal
from collections.abc import Callable, Iterator, Sequence
from functools import partial
from multiprocessing import get_context
from multiprocessing.connection import Connection, wait
from typing import Any, TypeVar

from advpipe.pipeline.errors import AdvpipeError, os_error_line
from advpipe.pipeline.missing_library import missing_library_line
from advpipe.pipeline.progress import track

Work = Callable[[int], None]
T = TypeVar("T")

JOBS_WORTH_A_WORKER = 4
"""A worker takes seconds to load its libraries: below this many jobs each, fewer workers are faster."""


def run_jobs(
    prepare: Callable[[], Work], jobs: Sequence[int], description: str, workers: int | None = None
) -> None:
    """Calls `prepare()` once in each process, and the work that it returns once for each job.

    prepare: can be pickled; what it loads is loaded in every process. jobs: numbers that name them.
    workers: processes, by default one for each core. Work keeps its own results, such as in a file
    for each job. Raises the AdvpipeError of the first job that fails.
    """
    for _ in _done(prepare, jobs, description, workers):
        pass


def map_jobs(
    prepare: Callable[[], Callable[[int], T]],
    jobs: Sequence[int],
    description: str,
    workers: int | None = None,
) -> list[T]:
    """As `run_jobs`, for work whose results are small and can be pickled: they come in the jobs' order.

    A process is given its jobs in their order.
    """
    results = dict(_done(prepare, jobs, description, workers))
    return [results[job] for job in jobs]


def _done(
    prepare: Callable[[], Callable[[int], T]], jobs: Sequence[int], description: str, workers: int | None
) -> Iterator[tuple[int, T]]:
    """Each job with its result, as they end."""
    count = min(workers or os.cpu_count() or 1, max(len(jobs) // JOBS_WORTH_A_WORKER, 1))
    done = _in_processes(prepare, jobs, count) if count > 1 else _here(prepare, jobs)
    return track(done, description, len(jobs))


def _here(prepare: Callable[[], Callable[[int], T]], jobs: Sequence[int]) -> Iterator[tuple[int, T]]:
    work = prepare() if jobs else None
    for job in jobs:
        assert work is not None
        yield job, work(job)


def _in_processes(
    prepare: Callable[[], Callable[[int], T]], jobs: Sequence[int], count: int
) -> Iterator[tuple[int, T]]:
    context = get_context("spawn")  # a fork would inherit the threads of the libraries loaded here
    processes, pipes = [], []
    try:
        for index in range(count):
            ours, theirs = context.Pipe(duplex=False)
            process = context.Process(
                target=_serve, args=(theirs, partial(prepare), list(jobs[index::count])), daemon=True
            )
            process.start()
            theirs.close()  # the worker's end is the worker's alone: its death closes the pipe
            processes.append(process)
            pipes.append(ours)
        yield from _finished(pipes)
    finally:
        for process in processes:
            process.terminate()
        for process in processes:
            process.join()


def _finished(pipes: list[Connection]) -> Iterator[tuple[int, Any]]:
    """Jobs and their results as they end; a worker says None when it has no more."""
    waiting = list(pipes)
    while waiting:
        for pipe in wait(waiting):
            assert isinstance(pipe, Connection)
            try:
                message: Any = pipe.recv()
            except EOFError:
                raise AdvpipeError(
                    "a worker process died (out of memory, or killed); run again to go on, "
                    "with --workers 1 if memory is short"
                ) from None
            if isinstance(message, BaseException):
                raise message
            if message is None:
                waiting.remove(pipe)
            else:
                yield message


def _serve(pipe: Connection, prepare: Callable[[], Callable[[int], Any]], jobs: list[int]) -> None:
    """A worker's life; ctrl-C is the parent's business, and a parent that is gone ends the worker."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    try:
        work = prepare()
        for job in jobs:
            pipe.send((job, work(job)))
        pipe.send(None)
    except BrokenPipeError:
        return
    except AdvpipeError as error:
        pipe.send(AdvpipeError(str(error)))
    except (ImportError, OSError) as error:
        line = missing_library_line(error)
        if line is not None:
            pipe.send(AdvpipeError(line))
            return
        if isinstance(error, ImportError):
            raise
        # A full disk has no name: whoever knows the output gives it one.
        pipe.send(AdvpipeError(os_error_line(error)) if error.filename else OSError(*error.args))
