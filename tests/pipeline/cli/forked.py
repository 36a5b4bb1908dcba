"""Runs commands in processes of their own, and kills them at a given moment of their work on files.

A process that has loaded every library but has computed nothing forks once for each command: a run costs its
own work alone. A moment is a call that opens a file to write, makes, renames or removes; it is counted by an
audit hook, and the kill comes just before it.
"""

from __future__ import annotations

import json
import os
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
    import tempfile

    preload()
    for line in sys.stdin:
        job = json.loads(line)
        with (
            tempfile.TemporaryFile() as out,
            tempfile.TemporaryFile() as error,
            tempfile.TemporaryFile() as noted,
        ):
            if (pid := os.fork()) == 0:
                os.dup2(os.open(os.devnull, os.O_RDONLY), 0)
                os.dup2(out.fileno(), 1)
                os.dup2(error.fileno(), 2)
                code = 70
                try:
                    code = _child(job, noted.fileno())
                finally:
                    sys.stdout.flush()
                    sys.stderr.flush()
                    os._exit(code)
            _, status = os.waitpid(pid, 0)
            texts = []
            for stream in (out, error, noted):
                stream.seek(0)
                texts.append(stream.read().decode(errors="replace"))
        done = {"code": os.waitstatus_to_exitcode(status), "out": texts[0], "error": texts[1]}
        print(json.dumps({**done, "moments": texts[2].split()}), flush=True)


def preload() -> None:
    """Every module of advpipe, and with it the libraries."""
    import importlib

    for word in ("simulate", "attack", "evaluate", "train", "share", "verify"):
        importlib.import_module(f"advpipe.stages.{word}.run")
    for name in ("pipeline.cli", "pipeline.bag.recover", "stages.evaluate.v2x.veremi"):
        importlib.import_module(f"advpipe.{name}")


if __name__ == "__main__":
    _serve()
