"""Runs many independent jobs in this process or in several; the results do not depend on how many."""

from __future__ import annotations

import os
import pickle
import sys
import threading
import traceback
from collections.abc import Callable, Generator, Iterator, Sequence
from contextlib import closing, contextmanager
from multiprocessing import get_context, parent_process, resource_tracker
from multiprocessing.connection import Connection, wait
from types import ModuleType
from typing import Any, TypeVar

from advpipe.pipeline.core import signals
from advpipe.pipeline.core.errors import AdvpipeError, UsageError, os_error_line
from advpipe.pipeline.core.missing_library import missing_library_line
from advpipe.pipeline.core.option_names import is_command_line, option_name, use_flags
from advpipe.pipeline.core.progress import track
from advpipe.pipeline.core.verbosity import Verbosity, detail, silence_warnings, use_verbosity

Work = Callable[[int], None]
T = TypeVar("T")

JOBS_WORTH_A_WORKER = 4
"""A worker takes seconds to load its libraries: with fewer jobs each, fewer workers are faster."""


class UnexpectedInWorkerError(Exception):
    """An unexpected error in a worker process, with the traceback of that process."""

    def __init__(self, summary: str, traceback: str) -> None:
        super().__init__(summary, traceback)
        self.traceback = traceback

    def __str__(self) -> str:
        return f"{self.args[0]} (in a worker process)"


class WorkerTracebackError(Exception):
    """The cause of an error in this process that shows the traceback of the worker."""


def run_jobs(
    prepare: Callable[[], Work], jobs: Sequence[int], description: str, workers: int | None = None
) -> None:
    """Call `prepare()` once in each process, and the function that it returns once for each job.

    prepare: can be pickled; what it loads is loaded in every process. jobs: the numbers of the jobs.
    workers: number of processes, by default one for each of `usable_cores`. The function stores its results
    itself, such as in a file for each job. Raises the AdvpipeError of the first job that fails.
    """
    for _ in _results(prepare, jobs, description, workers):
        pass


def map_jobs(
    prepare: Callable[[], Callable[[int], T]],
    jobs: Sequence[int],
    description: str,
    workers: int | None = None,
) -> list[T]:
    """Run jobs as `run_jobs` does, and return their results in the jobs' order.

    Results must be small and picklable. Each process runs its jobs in their order.
    """
    results = dict(_results(prepare, jobs, description, workers))
    return [results[job] for job in jobs]


def results_ahead(prepare: Callable[[], Callable[[int], T]], jobs: Sequence[int]) -> Generator[T, None, None]:
    """Yield the results of jobs in their order, while another process computes the next ones.

    It is ahead by as many results as a pipe holds, some 64 kB, and one more; so memory stays flat. Close the
    generator to end that process. Raises what a job raised, in its place.
    """
    with closing(_in_processes(prepare, jobs, 1)) as results:
        for _, result in results:
            yield result


def usable_cores() -> int:
    """The cores that this process may run on: not all of the machine's under `taskset` or a batch system."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def _results(
    prepare: Callable[[], Callable[[int], T]], jobs: Sequence[int], description: str, workers: int | None
) -> Iterator[tuple[int, T]]:
    """Each job with its result, in the order in which they finish."""
    count = min(workers or usable_cores(), max(len(jobs) // JOBS_WORTH_A_WORKER, 1))
    detail(f"{description}: {len(jobs)} jobs in {count} processes")
    results = _in_processes(prepare, jobs, count) if count > 1 else _in_this_process(prepare, jobs)
    return track(results, description, len(jobs))


def _in_this_process(
    prepare: Callable[[], Callable[[int], T]], jobs: Sequence[int]
) -> Iterator[tuple[int, T]]:
    work = prepare() if jobs else None
    for job in jobs:
        assert work is not None
        yield job, work(job)


def _in_processes(
    prepare: Callable[[], Callable[[int], T]], jobs: Sequence[int], count: int
) -> Generator[tuple[int, T], None, None]:
    context = get_context("spawn")  # a fork would inherit the threads of the libraries loaded here
    processes, pipes = [], []
    if os.name == "posix":
        resource_tracker.ensure_running()  # starting it unblocks signals
    try:
        for index in range(count):
            ours, theirs = context.Pipe(duplex=False)
            process = context.Process(
                target=_serve,
                args=(theirs, pickle.dumps(prepare), list(jobs[index::count]), is_command_line()),
                daemon=True,
            )
            with signals.blocked(), _without_main():  # until the worker has set its handlers
                process.start()
            theirs.close()  # the worker's end is the worker's alone: its death closes the pipe
            processes.append(process)
            pipes.append(ours)
        yield from _received_results(pipes)
    finally:
        for process in processes:
            process.kill()  # ends immediately and silently, even while it still loads its libraries
        for process in processes:
            process.join()


@contextmanager
def _without_main() -> Iterator[None]:
    """Keep workers started in the block from loading `__main__`: a user's script would run again."""
    main = sys.modules["__main__"]
    sys.modules["__main__"] = ModuleType("__main__")
    try:
        yield
    finally:
        sys.modules["__main__"] = main


def _received_results(pipes: list[Connection]) -> Iterator[tuple[int, Any]]:
    """Jobs and their results in the order in which they finish; a worker sends None at its end."""
    waiting = list(pipes)
    while waiting:
        for pipe in wait(waiting):
            assert isinstance(pipe, Connection)
            try:
                message: Any = pipe.recv()
            except EOFError:
                raise AdvpipeError(
                    "a worker process died (out of memory, or killed); run the command again to resume, "
                    f"with {option_name('workers', 1)} if memory is scarce"
                ) from None
            if isinstance(message, UnexpectedInWorkerError):
                raise message from WorkerTracebackError(f"\n{message.traceback}")
            if isinstance(message, BaseException):
                raise message
            if message is None:
                waiting.remove(pipe)
            else:
                yield message


def _serve(pipe: Connection, pickled: bytes, jobs: list[int], names_flags: bool) -> None:
    """Run the jobs of a worker process; the parent handles signals, and the worker ends with its parent.

    pickled: `prepare`, whose libraries take seconds to load: the thread that watches the parent starts first.
    names_flags: see `option_names.use_flags`.
    """
    signals.leave_to_parent()
    threading.Thread(target=_end_with_parent, daemon=True).start()
    silence_warnings()
    try:
        with use_flags(names_flags), use_verbosity(Verbosity(quiet=True)):
            work: Callable[[int], Any] = pickle.loads(pickled)()
            for job in jobs:
                pipe.send((job, work(job)))
        pipe.send(None)
    except BrokenPipeError:
        return
    except AdvpipeError as error:
        error_type = UsageError if isinstance(error, UsageError) else AdvpipeError
        pipe.send(error_type(str(error)))
    except Exception as error:
        pipe.send(_error_for_parent(error))


def _error_for_parent(error: Exception) -> Exception:
    """The exception that the parent raises for an error of a worker."""
    if isinstance(error, ImportError | OSError) and (line := missing_library_line(error)):
        return AdvpipeError(line)
    if isinstance(error, OSError):
        # The error of a full disk names no file: the caller that knows the output names it (`writing`).
        return AdvpipeError(os_error_line(error)) if error.filename else OSError(*error.args)
    summary = traceback.format_exception_only(error)[-1].strip()
    return UnexpectedInWorkerError(summary, traceback.format_exc())


def _end_with_parent() -> None:
    """End this worker as soon as its parent process has ended, whatever it computes."""
    parent = parent_process()
    if parent is not None:
        parent.join()
        os._exit(1)
