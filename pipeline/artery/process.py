"""Artery's process: found, started, watched, and ended whatever happens."""

from __future__ import annotations

import os
import shutil
import subprocess
from pathlib import Path

from advpipe.pipeline.core.errors import AdvpipeError, UsageError
from advpipe.pipeline.core.missing_library import loader_line
from advpipe.pipeline.scenario.artery import Artery

PROGRAM, VARIABLE = "advpipe-artery", "ADVPIPE_ARTERY_BIN"
HOW = "docs/artery.md tells how to build it"
END_TIMEOUT_S = 5.0


def artery_program(settings: Artery | None = None) -> str:
    """The path of Artery with our module, by a scenario's settings or without one.

    Raises UsageError where there is none, or it cannot be run.
    """
    if settings is not None and settings.program is not None:
        where, path = "artery.program", settings.program
    elif VARIABLE in os.environ:
        where, path = VARIABLE, os.environ[VARIABLE]
    elif found := shutil.which(PROGRAM):
        return found
    else:
        names = VARIABLE if settings is None else f"artery.program or {VARIABLE}"
        raise UsageError(
            f"network artery needs the program {PROGRAM}, which is not on the PATH; name it in {names} "
            f"({HOW})"
        )
    if not os.path.isfile(path):
        raise UsageError(f"{where}: there is no file {path} ({HOW})")
    if not os.access(path, os.X_OK):
        raise UsageError(f"{where}: {path} is not executable; allow it with chmod +x")
    return os.path.abspath(path)


class ArteryProcess:
    """One run of Artery in `folder`, which has its configuration; its output goes there, too."""

    def __init__(self, program: str, folder: Path) -> None:
        self._log = folder / "artery.log"
        try:
            with self._log.open("wb") as log:
                self._process = subprocess.Popen(
                    [program, "-f", "omnetpp.ini"],
                    cwd=folder,
                    stdin=subprocess.DEVNULL,
                    stdout=log,
                    stderr=subprocess.STDOUT,
                )
        except OSError as error:
            raise AdvpipeError(f"{program} cannot be started: {error.strerror}") from None

    @property
    def is_alive(self) -> bool:
        """Whether it runs."""
        return self._process.poll() is None

    def end_reason(self) -> str:
        """Why it has ended, in its own words where it said why; waits a little for it to end."""
        try:
            code = self._process.wait(END_TIMEOUT_S)
        except subprocess.TimeoutExpired:
            return "it closed its connection to advpipe, but runs"
        lines = self._log.read_text(encoding="utf-8", errors="replace").splitlines()
        if missing := loader_line("\n".join(lines)):
            return missing
        told = [line.strip() for line in lines if line.strip()]
        errors = [line for line in told if line.startswith("<!>")]
        if code < 0:
            return f"signal {-code}" + (f": {_words(errors[-1])}" if errors else "")
        return f"exit code {code}: {_words((errors or told or ['no output'])[-1])}"

    def kill(self) -> None:
        """End it at once; it has nothing to save."""
        if self.is_alive:
            self._process.kill()
        self._process.wait()


def _words(line: str) -> str:
    return line.removeprefix("<!>").strip()
