"""Errors of jobs that run in other processes, as the process that asked for the jobs raises them."""

from __future__ import annotations

import traceback

from advpipe.pipeline.core.errors import AdvpipeError, UsageError, os_error_line
from advpipe.pipeline.core.missing_library import missing_library_line


class UnexpectedInWorkerError(Exception):
    """An unexpected error in a worker process, with the traceback of that process."""

    def __init__(self, summary: str, traceback: str) -> None:
        super().__init__(summary, traceback)
        self.traceback = traceback

    def __str__(self) -> str:
        return f"{self.args[0]} (in a worker process)"


class WorkerTracebackError(Exception):
    """The cause of an error in this process that shows the traceback of the worker."""


def error_for_parent(error: Exception) -> Exception:
    """What a worker sends for an error in one of its jobs."""
    if isinstance(error, AdvpipeError):
        error_type = UsageError if isinstance(error, UsageError) else AdvpipeError
        return error_type(str(error))
    if isinstance(error, ImportError | OSError) and (line := missing_library_line(error)):
        return AdvpipeError(line)
    if isinstance(error, OSError):
        # The error of a full disk names no file: the caller that knows the output names it (`writing`).
        return AdvpipeError(os_error_line(error)) if error.filename else OSError(*error.args)
    summary = traceback.format_exception_only(error)[-1].strip()
    return UnexpectedInWorkerError(summary, traceback.format_exc())


def raise_error_of_worker(error: BaseException) -> None:
    """Raise what a worker sent, with its traceback as the cause where the error is unexpected."""
    if isinstance(error, UnexpectedInWorkerError):
        raise error from WorkerTracebackError(f"\n{error.traceback}")
    raise error
