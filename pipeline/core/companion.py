"""Another process that answers what this one asks, in order, while this one goes on."""

from __future__ import annotations

import os
import pickle
import threading
from collections import deque
from collections.abc import Callable
from concurrent.futures import Future
from contextlib import suppress
from multiprocessing import current_process, get_context, resource_tracker
from multiprocessing.connection import Connection
from typing import Any, Generic, TypeVar

from advpipe.pipeline.core import signals
from advpipe.pipeline.core.errors import AdvpipeError
from advpipe.pipeline.core.job_errors import error_for_parent, raise_error_of_worker
from advpipe.pipeline.core.local_processes import end_with_parent, without_main
from advpipe.pipeline.core.option_names import is_command_line, use_flags
from advpipe.pipeline.core.verbosity import Verbosity, silence_warnings, use_verbosity

Q = TypeVar("Q")
A = TypeVar("A")


def may_have_companion() -> bool:
    """Whether this process may start others: workers of this machine may not."""
    return not current_process().daemon


class Companion(Generic[Q, A]):
    """A process that makes an answer to each question; close it to end it.

    prepare: runs there, and returns what answers. The caller bounds the memory: it waits for old answers
    before it asks on.
    """

    def __init__(self, prepare: Callable[[], Callable[[Q], A]]) -> None:
        context = get_context("spawn")  # a fork would inherit the threads of the libraries loaded here
        if os.name == "posix":
            resource_tracker.ensure_running()  # starting it unblocks signals
        # Two pipes: one that goes both ways is a socket, at three times the processor time.
        self._answers, their_answers = context.Pipe(duplex=False)
        their_questions, self._questions = context.Pipe(duplex=False)
        self._asked: deque[Future[A]] = deque()
        self._error: BaseException | None = None
        self._process = context.Process(
            target=_serve,
            args=(their_questions, their_answers, pickle.dumps(prepare, protocol=5), is_command_line()),
            daemon=True,
        )
        try:
            with signals.blocked(), without_main():  # until the process has set its handlers
                self._process.start()
                their_answers.close()  # this end is the companion's alone: its death closes the pipe
                their_questions.close()
                threading.Thread(target=self._receive, name="answers", daemon=True).start()
        except BaseException:
            if self._process.pid is not None:
                self.close()
            raise

    def ask(self, question: Q) -> Future[A]:
        """Send a question, and return at once; the answer, or the error in its place, comes later."""
        answer: Future[A] = Future()
        self._asked.append(answer)
        if self._error is None:
            with suppress(OSError):  # it has ended: `_receive` says so
                self._questions.send(question)
        if self._error is not None:
            self._fail_all(self._error)
        return answer

    def close(self) -> None:
        """End the process, whatever it does."""
        self._process.kill()
        self._process.join()

    def _receive(self) -> None:
        """Hand out the answers. A thread does, lest both processes wait for the other one to read."""
        while True:
            try:
                message: Any = self._answers.recv()
            except (EOFError, OSError):
                message = AdvpipeError("a worker process died (out of memory, or killed)")
            if isinstance(message, BaseException):
                break
            self._asked.popleft().set_result(message)
        try:
            raise_error_of_worker(message)
        except Exception as error:
            self._error = error
            self._fail_all(error)

    def _fail_all(self, error: BaseException) -> None:
        with suppress(IndexError):  # this thread or the other has emptied it
            while True:
                self._asked.popleft().set_exception(error)


def _serve(questions: Connection, answers: Connection, pickled: bytes, names_flags: bool) -> None:
    """Answer until the parent process ends this one, or has ended; the parent handles signals."""
    signals.leave_to_parent()
    threading.Thread(target=end_with_parent, daemon=True).start()
    silence_warnings()
    try:
        with use_flags(names_flags), use_verbosity(Verbosity(quiet=True)):
            answer: Callable[[Any], Any] = pickle.loads(pickled)()
            while True:
                answers.send(answer(questions.recv()))
    except (EOFError, BrokenPipeError):
        return
    except Exception as error:
        answers.send(error_for_parent(error))
