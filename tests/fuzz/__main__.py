"""Fuzzes all targets for a given time; exit code 1 if any input was not handled. See docs/fuzzing.md."""

from __future__ import annotations

import argparse
import json
import os
import sys
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

from tests.fuzz.engines import has_atheris
from tests.fuzz.findings import ABOUT, all_of
from tests.fuzz.registry import NAMES, WITHOUT_COVERAGE
from tests.fuzz.status import Progress
from tests.fuzz.watch import Limits, Watch, WorkerError
from tests.fuzz.worker import REPLAY, Folder

TICK_S = 10.0
HEAD = f"{'target':<16}{'engine':<12}{'inputs':>8}{'a second':>10}{'edges':>8}{'findings':>10}"


class Ticker:
    """A plain line on a target's progress, every ten seconds."""

    def __init__(self, name: str, engine: str) -> None:
        self._name, self._begin_s, self._last_s = f"{name} ({engine})", time.monotonic(), time.monotonic()

    def __call__(self, progress: Progress) -> None:
        now_s = time.monotonic()
        if now_s - self._last_s >= TICK_S:
            self._last_s = now_s
            print(f"{self._name}: {progress.inputs} inputs in {now_s - self._begin_s:.0f} s", flush=True)


def fuzz(name: str, options: argparse.Namespace, seconds: float | None) -> list[str]:
    """Tries one target for so long, with each engine in turn; its lines of the table."""
    lines = []
    engines = [one for one in options.engines if one != "atheris" or name not in WITHOUT_COVERAGE]
    for engine in engines:
        folder = Folder(options.out / "work" / name)
        folder.path.mkdir(parents=True, exist_ok=True)
        begin_s = time.monotonic()
        watch = Watch(
            name,
            engine,
            options.seed,
            folder,
            Limits(options.hang, options.memory << 20),
            seconds=None if seconds is None else seconds / len(engines),
            inputs=options.inputs,
            on_tick=Ticker(name, engine),
        )
        try:
            progress = watch.run()
        except WorkerError as error:  # the others go on; the run fails at its end
            print(error, flush=True)
            lines.append(f"{name:<16}{engine:<12}{'failed':>8}")
            continue
        spent_s = max(time.monotonic() - begin_s, 1e-9)
        found = len(list((folder.findings / name).glob(f"*/{ABOUT}")))
        edges = str(watch.edges) if engine == "atheris" else "-"
        lines.append(
            f"{name:<16}{engine:<12}{progress.inputs:>8}{progress.inputs / spent_s:>10.1f}"
            f"{edges:>8}{found:>10}"
        )
        print(lines[-1], flush=True)
    return lines


def replay(path: Path, options: argparse.Namespace) -> int:
    """Runs one kept input again, within the same limits; exit code 1 if it still is not handled."""
    about_file = path if path.name == ABOUT else (path if path.is_dir() else path.parent) / ABOUT
    about = json.loads(about_file.read_text(encoding="utf-8"))
    folder = Folder(options.out / "work" / REPLAY)
    folder.path.mkdir(parents=True, exist_ok=True)
    folder.data.write_bytes((about_file.parent / Path(about["place"]).name).read_bytes())
    named = [about["target"], about["call"], about["place"], about["note"]]
    folder.about.write_text(json.dumps(named), encoding="utf-8")
    before = {finding.folder: finding.count for finding in all_of(folder.findings)}
    Watch(about["target"], REPLAY, 0, folder, Limits(options.hang, options.memory << 20), inputs=1).run()
    after = [f for f in all_of(folder.findings) if f.count != before.get(f.folder)]
    for finding in after:
        print(finding, finding.fault.trace, sep="\n")
    print("not handled" if after else "handled")
    return int(bool(after))


def main() -> int:
    parser = argparse.ArgumentParser(prog="python -m tests.fuzz", description=__doc__)
    parser.add_argument("--seconds", type=float, default=600, help="for all targets together")
    parser.add_argument("--inputs", type=int, help="instead: so many of each target, by hypothesis alone")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--targets", nargs="+", choices=NAMES, default=list(NAMES), metavar="NAME")
    parser.add_argument("--engines", nargs="+", choices=("hypothesis", "atheris"))
    parser.add_argument("--workers", type=int, default=1, help="targets at a time")
    parser.add_argument("--hang", type=float, default=30.0, help="seconds that one input may take")
    parser.add_argument("--memory", type=int, default=2048, help="MB that one input may use")
    parser.add_argument("--out", type=Path, default=Path("build/fuzz"), help="documents, corpus and findings")
    parser.add_argument("--replay", type=Path, metavar="FILE", help="run one finding's input again")
    options = parser.parse_args()
    options.out = options.out.absolute()
    os.environ.setdefault("OMP_NUM_THREADS", "1")
    from tests.fuzz.base import build

    build(options.out / "base")
    if options.replay is not None:
        return replay(options.replay, options)
    if options.engines is None:
        options.engines = (
            ["hypothesis", "atheris"] if has_atheris() and not options.inputs else ["hypothesis"]
        )
        if not has_atheris():
            print("atheris is not installed: inputs are drawn randomly, without its guidance", flush=True)
    seconds = options.seconds * options.workers / len(options.targets)
    with ThreadPoolExecutor(options.workers) as pool:
        share = None if options.inputs else seconds
        jobs = [pool.submit(fuzz, name, options, share) for name in options.targets]
        lines = [line for job in jobs for line in job.result()]
    found = list(all_of(options.out / "findings"))
    print("", HEAD, *lines, "", *found, sep="\n")
    print(f"{len(found)} findings in {options.out / 'findings'}" if found else "nothing was found")
    return 2 if any(line.endswith(" failed") for line in lines) else int(bool(found))


if __name__ == "__main__":
    sys.exit(main())
