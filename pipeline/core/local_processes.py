"""Runs jobs in this process or in several of this machine."""

from __future__ import annotations

import os
import pickle
import sys
import threading
from collections.abc import Callable, Generator, Iterator, Sequence
from contextlib import closing, contextmanager
from dataclasses import dataclass
from multiprocessing import get_context, parent_process, resource_tracker
from multiprocessing.connection import Connection, wait
from types import ModuleType
from typing import Any, ClassVar, TypeVar

from advpipe.pipeline.core import signals
from advpipe.pipeline.core.errors import AdvpipeError
from advpipe.pipeline.core.job_engine import JobLimits
from advpipe.pipeline.core.job_errors import error_for_parent, raise_error_of_worker
from advpipe.pipeline.core.option_names import is_command_line, option_name, use_flags
from advpipe.pipeline.core.verbosity import Verbosity, detail, silence_warnings, use_verbosity

T = TypeVar("T")


def usable_cores() -> int:
    """The cores that this process may run on: not all of the machine's under `taskset` or a batch system."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


@dataclass(frozen=True)
class LocalProcesses:
    """The engine of one machine; description: of the jobs, for --verbose."""

    description: str
    is_elsewhere: ClassVar[bool] = False

    def results(
        self, prepare: Callable[[], Callable[[int], T]], jobs: Sequence[int], limits: JobLimits
    ) -> Iterator[tuple[int, T]]:
        """Each job with its result, in the order in which they finish; see `JobEngine`."""
        count = min(limits.workers or usable_cores(), max(len(jobs) // limits.jobs_per_worker, 1))
        detail(f"{self.description}: {len(jobs)} jobs in {count} processes")
        return _in_processes(prepare, jobs, count) if count > 1 else _in_this_process(prepare, jobs)


def results_ahead(prepare: Callable[[], Callable[[int], T]], jobs: Sequence[int]) -> Generator[T, None, None]:
    """Yield the results of jobs in their order, while another process computes the next ones.

    It is ahead by as many results as a pipe holds, some 64 kB, and one more; so memory stays flat. Close the
    generator to end that process. Raises what a job raised, in its place.
    """
    with closing(_in_processes(prepare, jobs, 1)) as results:
        for _, result in results:
            yield result


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
            with signals.blocked(), without_main():  # until the worker has set its handlers
                process.start()
                processes.append(process)
            theirs.close()  # the worker's end is the worker's alone: its death closes the pipe
            pipes.append(ours)
        yield from _received_results(pipes)
    finally:
        for process in processes:
            process.kill()  # ends immediately and silently, even while it still loads its libraries
        for process in processes:
            process.join()


@contextmanager
def without_main() -> Iterator[None]:
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
            if isinstance(message, BaseException):
                raise_error_of_worker(message)
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
    threading.Thread(target=end_with_parent, daemon=True).start()
    silence_warnings()
    try:
        with use_flags(names_flags), use_verbosity(Verbosity(quiet=True)):
            work: Callable[[int], Any] = pickle.loads(pickled)()
            for job in jobs:
                pipe.send((job, work(job)))
        pipe.send(None)
    except BrokenPipeError:
        return
    except Exception as error:
        pipe.send(error_for_parent(error))


def end_with_parent() -> None:
    """End this worker as soon as its parent process has ended, whatever it computes."""
    parent = parent_process()
    if parent is not None:
        parent.join()
        os._exit(1)
