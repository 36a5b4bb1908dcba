"""Limits a worker's time and memory, saves the input that exceeded them, and continues with a new worker."""

from __future__ import annotations

import os
import re
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

from tests.fuzz.case import Fault
from tests.fuzz.findings import save
from tests.fuzz.status import Progress, Status
from tests.fuzz.worker import RECYCLED, Folder, rss_bytes

ROOT = Path(__file__).parents[2]
CHECK_S, SESSION_CHECKS = 0.05, 10
"""How often a worker is checked, and after how many checks its child processes."""

STARTING_S = 180
"""The longest that a worker may take before and between inputs; our own fault if it takes longer."""

_FRAME = re.compile(r'File "([^"]+)", line (\d+) in (\w+)')
_COVERED = re.compile(rb"cov: (\d+)")


@dataclass(frozen=True)
class Limits:
    """Of one input."""

    hang_s: float = 30.0
    memory_bytes: int = 2 << 30


class WorkerError(RuntimeError):
    """A worker failed by itself: a mistake in the fuzzer, not in what it tries."""


@dataclass
class Watch:
    """One target and engine, for some time or a number of inputs; over as many workers as it takes."""

    target: str
    engine: str
    seed: int
    folder: Folder
    limits: Limits
    seconds: float | None = None
    inputs: int | None = None
    on_tick: Callable[[Progress], None] = lambda progress: None

    def run(self) -> Progress:
        """Raises WorkerError where a worker fails outside of an input."""
        self.folder.status.unlink(missing_ok=True)
        self._log.unlink(missing_ok=True)
        self.folder.deadly.unlink(missing_ok=True)
        status = Status(self.folder.status)
        end_s = None if self.seconds is None else time.monotonic() + self.seconds
        while True:
            self.folder.stack.unlink(missing_ok=True)
            progress = status.read()
            if self._is_done(progress, end_s):
                return progress
            fault = self._worker(status, end_s)
            progress = status.read()
            if fault is not None:
                label, case = self.folder.kept()
                self.folder.remember_deadly(case)
                print(save(self.folder.findings, label, case, fault), flush=True)
                progress = progress._replace(inputs=progress.inputs + 1, batch=progress.batch + 1)
            status.write(progress._replace(started_s=0.0))

    @property
    def edges(self) -> int:
        """Edges of advpipe's code that inputs reached, as atheris last reported; 0 for another engine."""
        found = _COVERED.findall(self._log.read_bytes()[-100_000:]) if self._log.is_file() else []
        return int(found[-1]) if found else 0

    @property
    def _log(self) -> Path:
        return self.folder.path / f"{self.target}-{self.engine}.log"

    def _is_done(self, progress: Progress, end_s: float | None) -> bool:
        has_all = self.inputs is not None and progress.inputs >= self.inputs
        return has_all or (end_s is not None and time.monotonic() >= end_s)

    def _worker(self, status: Status, end_s: float | None) -> Fault | None:
        """Starts a worker and checks after it to its end; the fault of the input that ended it, if any."""
        batch = status.read().batch
        command = [sys.executable, "-m", "tests.fuzz.worker", self.target, self.engine, str(self.seed)]
        command += [str(self.folder.path), "--first-batch", str(batch)]
        command += ["--inputs", str(self.inputs)] if self.inputs is not None else []
        with self._log.open("ab") as log:
            process = subprocess.Popen(
                command,
                cwd=ROOT,
                stdout=log,
                stderr=subprocess.STDOUT,
                stdin=subprocess.DEVNULL,
                start_new_session=True,
                env={**os.environ, "OMP_NUM_THREADS": "1", "MPLBACKEND": "agg"},
            )
        try:
            return self._supervise(process, status, end_s)
        finally:
            kill(process)

    def _supervise(
        self, process: subprocess.Popen[bytes], status: Status, end_s: float | None
    ) -> Fault | None:
        last, last_s, checks, waited_before_s = status.read(), time.monotonic(), 0, 0.0
        while process.poll() is None:
            time.sleep(CHECK_S)
            now_s, progress, checks = time.monotonic(), status.read(), checks + 1
            self.on_tick(progress)
            if end_s is not None and now_s > end_s:
                return None
            if progress.started_s != last.started_s:
                waited_before_s = waited_s(process.pid)
            if progress.started_s and now_s - progress.started_s > self.limits.hang_s:
                waited = longest_wait_s(process.pid, waited_before_s)
                if now_s - progress.started_s - waited > self.limits.hang_s:
                    return self._stopped(process, "hang", f"still busy after {self.limits.hang_s:g} s")
            used = rss_bytes(process.pid) if checks % SESSION_CHECKS else session_bytes(process.pid)
            if used > self.limits.memory_bytes:
                return self._stopped(
                    process, "memory", f"more than {self.limits.memory_bytes >> 20} MB in use"
                )
            if progress != last or progress.started_s:
                last, last_s = progress, now_s
            elif now_s - last_s > STARTING_S:
                raise WorkerError(f"the worker of {self.target} draws no input; see {self._log}")
        if process.returncode in (0, RECYCLED):
            return None
        if status.read().started_s:
            return Fault("crash", _ending(process.returncode), *self._stack())
        raise WorkerError(f"the worker of {self.target} failed; see {self._log}:\n{_tail(self._log)}")

    def _stopped(self, process: subprocess.Popen[bytes], kind: str, what: str) -> Fault:
        os.kill(process.pid, signal.SIGUSR1)
        time.sleep(0.5)  # in which it writes where it is
        kill(process)
        return Fault(kind, what, *self._stack())

    def _stack(self) -> tuple[str, str]:
        """The innermost place in advpipe's code, and the stacks of all threads."""
        text = self.folder.stack.read_text(encoding="utf-8", errors="replace")
        for path, line, name in _FRAME.findall(text):  # the innermost first
            inside = path.removeprefix(f"{ROOT}/")
            if inside.startswith(("pipeline/", "stages/")):
                return f"{inside}:{line} {name}", text
        return "outside of advpipe", text


def kill(process: subprocess.Popen[bytes]) -> None:
    """A worker and all that it started."""
    with suppress(ProcessLookupError):
        os.killpg(process.pid, signal.SIGKILL)
    process.wait()


def session_bytes(session: int) -> int:
    """Resident memory of all processes of a session."""
    return sum(rss_bytes(pid) for pid in _processes(session))


def longest_wait_s(session: int, before_s: float) -> float:
    """The longest time that a process of a session has waited for a core, which is no fault of the input.

    before_s: how long its leader had waited when the input began; the others began with it.
    """
    waits_s = [waited_s(pid) - (before_s if int(pid) == session else 0.0) for pid in _processes(session)]
    return max(waits_s, default=0.0)


def waited_s(pid: int | str) -> float:
    """How long the thread of a process that waited most has waited for a core."""
    waits_ns = [0]
    with suppress(OSError):
        for task in os.listdir(f"/proc/{pid}/task"):
            with suppress(OSError), open(f"/proc/{pid}/task/{task}/schedstat", encoding="ascii") as file:
                waits_ns.append(int(file.read().split()[1]))
    return max(waits_ns) / 1e9


def _processes(session: int) -> Iterator[str]:
    for pid in filter(str.isdigit, os.listdir("/proc")):
        try:
            with open(f"/proc/{pid}/stat", encoding="utf-8", errors="replace") as file:
                fields: Sequence[str] = file.read().rpartition(")")[2].split()
        except OSError:
            continue
        if len(fields) > 3 and int(fields[3]) == session:
            yield pid


def _ending(code: int) -> str:
    return f"ended by {signal.Signals(-code).name}" if code < 0 else f"ended with exit code {code}"


def _tail(log: Path) -> str:
    return log.read_bytes()[-1500:].decode(errors="replace")
