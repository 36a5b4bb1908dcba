"""A process that tries inputs of one target; another one watches it (see `watch`).

python -m tests.fuzz.worker TARGET ENGINE SEED FOLDER [--inputs N] [--first-batch N]
python -m tests.fuzz.worker --replay FINDING FOLDER
"""

from __future__ import annotations

import argparse
import faulthandler
import hashlib
import json
import os
import resource
import signal
import sys
from collections.abc import Callable
from functools import partial
from pathlib import Path

from tests.fuzz.case import Case, Target
from tests.fuzz.engines import ENGINES, Enough, explore, explore_guided, instrumented
from tests.fuzz.status import Status

REPLAY, SEEDS = "replay", "seeds"
RECYCLED = 3
"""Exit code of a worker that has become large between two inputs; a fresh one goes on."""

LARGE_BYTES = 1 << 30
ADDRESSES_BYTES, FILE_BYTES = 24 << 30, 4 << 30
"""Limits of a worker's address space and of the size of a file, independent of its watcher."""


class Folder:
    """Where a worker finds the base documents, and leaves its status, its input and what it found.

    path: two levels below the folder that holds what all targets share.
    """

    def __init__(self, path: Path) -> None:
        self.path, self.scratch = path, path / "scratch"
        root = path.parents[1]
        self.base, self.findings = root / "base", root / ("replayed" if path.name == REPLAY else "findings")
        self.status, self.stack = path / "status", path / "stack.txt"
        self.about, self.data = path / "input.json", path / "input"
        self.deadly = path / "deadly.txt"

    def keep(self, case: Case, label: str) -> None:
        """Writes the input that is tried next, for whoever finds that it killed us."""
        self.data.write_bytes(case.data)
        about = [label, case.call, case.place, case.note]
        self.about.write_text(json.dumps(about), encoding="utf-8")

    def remember_deadly(self, case: Case) -> None:
        """An input that ended a worker is not tried by the next one: the same corpus draws it again."""
        with self.deadly.open("a", encoding="ascii") as file:
            file.write(digest_of(case) + "\n")

    def kept(self) -> tuple[str, Case]:
        """What findings are filed under, the target's name for most, and the input."""
        label, call, place, note = json.loads(self.about.read_text(encoding="utf-8"))
        return label, Case(call, place, self.data.read_bytes(), note)


def digest_of(case: Case) -> str:
    return hashlib.sha256(f"{case.call}\0{case.place}\0".encode() + case.data).hexdigest()


def rss_bytes(pid: int | str = "self") -> int:
    """Resident memory of a process; 0 for one that is gone."""
    try:
        with open(f"/proc/{pid}/statm", encoding="ascii") as file:
            return int(file.read().split()[1]) * resource.getpagesize()
    except (OSError, IndexError, ValueError):
        return 0


class Bench:
    """Tries inputs, at most so many."""

    def __init__(self, folder: Folder, most: int | None) -> None:
        self._folder, self._most = folder, most
        self.status = Status(folder.status)
        self._tried = set(folder.deadly.read_text().split()) if folder.deadly.exists() else set()

    def attempt(self, target: Target, label: str, case: Case) -> None:
        """Runs an input, and files what is wrong with how it ends under the label."""
        from tests.fuzz.findings import save
        from tests.fuzz.judge import attempt

        if self._most is not None and self.status.read().inputs >= self._most:
            raise Enough
        if (digest := digest_of(case)) in self._tried:
            return
        self._tried.add(digest)
        self._folder.keep(case, label)
        self.status.begin()
        fault = attempt(target, case, self._folder.base, self._folder.scratch)
        self.status.end()
        if fault is not None:
            print(save(self._folder.findings, label, case, fault), flush=True)
        if rss_bytes() > LARGE_BYTES:
            os._exit(RECYCLED)

    def on_batch(self, batch: int) -> None:
        self.status.write(self.status.read()._replace(batch=batch))


def limit() -> None:
    """Set limits that do not depend on the watcher, and a signal handler that dumps the stack."""
    resource.setrlimit(resource.RLIMIT_AS, (ADDRESSES_BYTES, ADDRESSES_BYTES))
    resource.setrlimit(resource.RLIMIT_FSIZE, (FILE_BYTES, FILE_BYTES))
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    signal.signal(signal.SIGXFSZ, signal.SIG_IGN)


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("target")
    parser.add_argument("engine", choices=(*ENGINES, REPLAY, SEEDS))
    parser.add_argument("seed", type=int)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--inputs", type=int)
    parser.add_argument("--first-batch", type=int, default=0)
    options = parser.parse_args()
    limit()
    folder = Folder(options.folder)
    folder.scratch.mkdir(parents=True, exist_ok=True)
    with folder.stack.open("a", encoding="utf-8") as stack, instrumented(options.engine):
        faulthandler.enable(stack)
        faulthandler.register(signal.SIGUSR1, stack, all_threads=True)
        work(folder, Bench(folder, options.inputs), options)


def work(folder: Folder, bench: Bench, options: argparse.Namespace) -> None:
    """All that the worker was started for. Advpipe is imported here, where atheris sees it."""
    from tests.fuzz.registry import target_named

    if options.engine == SEEDS:
        from tests.fuzz import seeds

        for number, seed in list(enumerate(seeds.SEEDS))[options.first_batch :]:
            bench.on_batch(number)
            bench.attempt(target_named(seed.target), seed.name, seed.make(folder.base))
        return
    target = target_named(options.target)
    if options.engine == REPLAY:
        bench.attempt(target, *folder.kept())
        return
    cases, attempt = target.cases(folder.base / target.part), partial(bench.attempt, target, target.name)
    try:
        if options.engine == "atheris":
            explore_guided(cases, _one(attempt), options.seed, folder.path / "corpus")
        explore(cases, _one(attempt), options.seed, options.first_batch, bench.on_batch)
    except Enough:
        sys.stdout.flush()


def _one(attempt: Callable[[Case], None]) -> Callable[[Case], None]:
    """A plain function of one argument, as hypothesis wants it."""

    def one(case: Case) -> None:
        attempt(case)

    return one


if __name__ == "__main__":
    main()
