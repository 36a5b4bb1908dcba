"""Runs commands in processes of their own, and kills them at a given moment of their work on files.

A process that has loaded every library but has computed nothing forks once for each command: a run costs its
own work alone. A moment is a call that opens a file to write, makes, renames or removes; it is counted by an
audit hook, and the kill comes just before it.
"""

from __future__ import annotations

import json
import os
import select
import signal
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Any

COUNTED = ("os.rename", "os.mkdir", "os.remove", "os.rmdir", "shutil.rmtree")
WRITES = os.O_WRONLY | os.O_RDWR | os.O_CREAT


@dataclass(frozen=True)
class Done:
    """code: exit code, or minus the signal that ended it. moments: names of the calls, in their order."""

    code: int
    out: str
    error: str
    moments: tuple[str, ...]


class Forks:
    """The process that forks; `close` ends it."""

    def __init__(self, path: list[str]) -> None:
        one_thread = dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"), "1")
        environment = {  # a fork would wait for ever for its parent's threads
            **os.environ,
            **one_thread,
            "PYTHONPATH": os.pathsep.join(path),
            "PYTHONDONTWRITEBYTECODE": "1",
        }
        self._process = subprocess.Popen(
            [sys.executable, __file__],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            env=environment,
            text=True,
        )

    def run(
        self,
        folder: Path,
        *arguments: object,
        kill_at: int | None = None,
        by: int = signal.SIGKILL,
        most_bytes: int | None = None,
    ) -> Done:
        """`advpipe` with these arguments in a folder. most_bytes: of a file; more of it is refused."""
        job = {
            "folder": str(folder),
            "arguments": [str(each) for each in arguments],
            "kill_at": kill_at,
            "by": int(by),
            "most_bytes": most_bytes,
        }
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        self._process.stdin.write(json.dumps(job) + "\n")
        self._process.stdin.flush()
        done = json.loads(self._process.stdout.readline())
        return Done(done["code"], done["out"], done["error"], tuple(done["moments"]))

    def close(self) -> None:
        self._process.communicate()


def _watch(kill_at: int | None, by: int, noted: int) -> None:
    count = 0

    def hook(event: str, arguments: tuple[Any, ...]) -> None:
        nonlocal count
        if event == "open":
            path, _, flags = arguments
            if not isinstance(path, str) or not flags & WRITES or path.startswith("/dev/"):
                return
        elif event not in COUNTED:
            return
        if count == kill_at:
            os.kill(os.getpid(), by)
        count += 1
        os.write(noted, f"{event}\n".encode())

    sys.addaudithook(hook)


def _child(job: dict[str, Any], noted: int) -> int:
    import resource

    from advpipe.pipeline.cli import app

    os.chdir(job["folder"])
    if job["most_bytes"] is not None:
        resource.setrlimit(resource.RLIMIT_FSIZE, (job["most_bytes"], resource.RLIM_INFINITY))
    sys.argv = ["advpipe", *job["arguments"]]
    _watch(job["kill_at"], job["by"], noted)
    try:
        app()
    except SystemExit as end:
        return end.code if isinstance(end.code, int) else 1 if end.code else 0
    return 0


def _serve() -> None:
    preload()
    for line in sys.stdin:
        job = json.loads(line)
        pipes = [os.pipe() for _ in range(3)]  # a limit on the size of files does not bound them
        if (pid := os.fork()) == 0:
            _become(job, [theirs for _, theirs in pipes])
        for _, theirs in pipes:
            os.close(theirs)
        out, error, moments = _read_all([ours for ours, _ in pipes])
        _, status = os.waitpid(pid, 0)
        done = {"code": os.waitstatus_to_exitcode(status), "out": out, "error": error}
        print(json.dumps({**done, "moments": moments.split()}), flush=True)


def _become(job: dict[str, Any], pipes: list[int]) -> None:
    import traceback

    os.dup2(os.open(os.devnull, os.O_RDONLY), 0)
    for number, pipe in enumerate(pipes[:2], start=1):
        os.dup2(pipe, number)
        os.close(pipe)
    code = 70
    try:
        code = _child(job, pipes[2])
    except BaseException:
        traceback.print_exc()
    finally:
        sys.stdout.flush()
        sys.stderr.flush()
        os._exit(code)


def _read_all(pipes: list[int]) -> list[str]:
    """What comes out of each until its end; processes that outlive the command hold none of them for long."""
    texts = dict.fromkeys(pipes, b"")
    waiting = set(pipes)
    while waiting:
        for pipe in select.select(waiting, [], [])[0]:
            block = os.read(pipe, 1 << 16)
            texts[pipe] += block
            if not block:
                waiting.remove(pipe)
                os.close(pipe)
    return [texts[pipe].decode(errors="replace") for pipe in pipes]


def preload() -> None:
    """Every module of advpipe, and with it the libraries."""
    import importlib

    for stage in ("simulate", "attack", "evaluate", "train", "share", "verify", "import_", "export"):
        importlib.import_module(f"advpipe.stages.{stage}.run")
    for name in ("pipeline.cli", "pipeline.bag.recover", "stages.evaluate.v2x.veremi"):
        importlib.import_module(f"advpipe.{name}")


if __name__ == "__main__":
    _serve()
