"""Everything that is said about attacks on clouds, measured on one drive and detector, many frames at once.

    python benchmarks/attack_study.py prepare BAG --out DRIVE.npz [--frames 30] [--slice 0:600:10]
    python benchmarks/attack_study.py run DRIVE --out ROWS.jsonl [--detector FILE] [--device cuda]
                                      [--frames 30] [--processes 15] [--batch 2] [--seconds 240]
                                      [--only TEXT ...] [--seeds 2] [--list]
    python benchmarks/attack_study.py report ROWS.jsonl

`run` attacks frames under the conditions of `attack_study_plan.py`, the most important first, and writes a
line for each frame as it comes: what is left at strict and at loose overlap, without and under each defence;
how much was changed; what attack checks say; the time. It ends after `--seconds`: frames under way may take
`--grace` seconds more, and are then given up. Started again with the same file, it does what is missing, and
the conditions may be others. Each process works on one chunk of `--batch` frames at a time, as one batch of
the detector; all processes share the device.

For the temporal check of attack detection, prepare 30 or more consecutive frames (--slice 100:140), and run
these with --only clean best/0 stealthy.

DRIVE is a clean bag or a file of `prepare`, of about a megabyte for each frame. `report` prints tables in
Markdown (`attack_study_tables.py`): mAP ratios with paired intervals by a bootstrap over blocks of 5 s,
differences that decide something, ratios under defences, rates of attack detection, spread over seeds.

Beside PyTorch, numpy, scipy and pydantic it imports rosbags (with apsw, lz4, ruamel.yaml, backports.zstd),
mcap, zstandard, PyYAML and safetensors; with these, PYTHONPATH=typings stands for an installed advpipe.
"""

from __future__ import annotations

import argparse
import json
import multiprocessing
import os
import sys
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from queue import Empty
from typing import Any

from attack_study_drive import identity, opened, read_bag, store
from attack_study_frame import Row, Study
from attack_study_plan import Condition, chosen, plan
from common import machine

from advpipe.pipeline.core.atomic_file import write_atomically
from advpipe.pipeline.core.errors import AdvpipeError, UsageError
from advpipe.pipeline.detector.adaptation import Adaptation
from advpipe.pipeline.detector.device import CPU
from advpipe.pipeline.detector.registry import detector_sha256, load_detector
from advpipe.pipeline.detector.threads import fixed_torch_threads

Item = tuple[Condition, tuple[int, ...]]


@dataclass(frozen=True)
class Job:
    """What every process is told. deadline_s: no chunk begins later, in seconds of `time.time`."""

    drive: Path
    frames: int
    detector: str
    device: str
    deadline_s: float
    lidar_height_m: float | None = None


def work(job: Job, items: Any, results: Any) -> None:
    """One process: chunks from a queue until it has none or time is over. Sends rows, texts of errors, and
    None at its end."""
    with fixed_torch_threads():
        study = Study(
            opened(job.drive, job.frames),
            load_detector(job.detector, job.device),
            Adaptation(job.lidar_height_m),
        )
        while time.time() < job.deadline_s:
            item: Item | None = items.get()
            if item is None:
                break
            condition, numbers = item
            try:
                results.put(study.rows(condition, numbers))
            except Exception as error:
                results.put(f"{condition.key} frames {numbers}: {type(error).__name__}: {error}")
    results.put(None)


def run_all(job: Job, todo: Sequence[Item], processes: int, grace_s: float) -> Iterator[list[Row] | str]:
    """What the processes find, as it comes; ends with them, or when time and grace are over."""
    context = multiprocessing.get_context("spawn")
    items, results = context.Queue(), context.Queue()
    for item in (*todo, *[None] * processes):
        items.put(item)
    workers = [
        context.Process(target=work, args=(job, items, results), daemon=True) for _ in range(processes)
    ]
    for worker in workers:
        worker.start()
    running = len(workers)
    try:
        while running and time.time() < job.deadline_s + grace_s:
            try:
                found = results.get(timeout=1.0)
            except Empty:
                if not any(worker.is_alive() for worker in workers):
                    break
                continue
            if found is None:
                running -= 1
            else:
                yield found
    finally:
        for worker in workers:
            worker.terminate()
        for queue in (items, results):
            queue.cancel_join_thread()


def remaining(
    conditions: Sequence[Condition], frames: int, batch: int, done: set[tuple[str, int]]
) -> list[Item]:
    """The chunks of frames that have no row yet, in order."""
    items = []
    for condition in conditions:
        left = [number for number in range(frames) if (condition.key, number) not in done]
        items += [(condition, tuple(left[first : first + batch])) for first in range(0, len(left), batch)]
    return items


def rows_of(path: Path) -> tuple[dict[str, Any], list[Row]]:
    """The first line, and those of frames; a last line that is cut off is left out. Raises UsageError for
    another file."""
    lines = path.read_text(encoding="utf-8").splitlines(keepends=True)
    try:
        head, *rows = [json.loads(line) for line in lines if line.endswith("\n")]
    except ValueError:
        head, rows = None, []
    if not isinstance(head, dict) or "study" not in head:
        raise UsageError(f"{path} holds no rows of this benchmark; give another file, or remove it")
    return head, rows


def header(given: argparse.Namespace) -> dict[str, Any]:
    frames = opened(given.drive, given.frames)
    import torch

    device = torch.cuda.get_device_name(0) if given.device != CPU else CPU
    return {
        "study": 1,
        "frames_sha256": identity(frames),
        "detector_sha256": detector_sha256(given.detector),
        "stamps_ns": [frame.stamp_ns for frame in frames],
        "drive": given.drive.stem,
        "machine": f"{machine()}; {device}; PyTorch {torch.__version__}",
        "processes": given.processes,
        "batch": given.batch,
    }


def run(given: argparse.Namespace) -> None:
    """Measure what is missing until the time is over."""
    start_s = time.time()
    conditions = chosen(plan(given.seeds), given.only)
    head, rows = header(given), []
    if given.out.exists():
        known, rows = rows_of(given.out)
        for what in ("frames_sha256", "detector_sha256"):
            if known[what] != head[what]:
                raise UsageError(f"{given.out} is of other {what.partition('_')[0]}; give another --out")
    lines = [json.dumps(each, separators=(",", ":")) + "\n" for each in (head, *rows)]
    write_atomically(given.out, "".join(lines).encode())  # without a line that was cut off
    todo = remaining(
        conditions, len(head["stamps_ns"]), given.batch, {(row["condition"], row["frame"]) for row in rows}
    )
    print(f"{head['machine']}; {len(rows)} rows there, {len(todo)} chunks to do", flush=True)
    deadline_s = start_s + given.seconds
    job = Job(given.drive, given.frames, given.detector, given.device, deadline_s, given.lidar_height)
    added, errors = 0, 0
    with given.out.open("a", encoding="utf-8") as file:
        for found in run_all(job, todo, min(given.processes, max(1, len(todo))), given.grace):
            if isinstance(found, str):
                errors += 1
                print(found[:400], file=sys.stderr, flush=True)
                continue
            file.writelines(json.dumps(row, separators=(",", ":")) + "\n" for row in found)
            file.flush()
            added += len(found)
    spent_s = time.time() - start_s
    print(f"{added} rows in {spent_s:.0f} s, {errors} errors; {given.out}", flush=True)


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n")[0])
    commands = parser.add_subparsers(dest="command", required=True)
    prepare = commands.add_parser("prepare")
    prepare.add_argument("bag", type=Path)
    prepare.add_argument("--out", type=Path, required=True)
    prepare.add_argument("--frames", type=int, default=30)
    prepare.add_argument("--slice", help="start:stop:step instead of evenly spread frames")
    running = commands.add_parser("run")
    running.add_argument("drive", type=Path)
    running.add_argument("--out", type=Path, required=True)
    running.add_argument("--detector", default="small")
    running.add_argument("--device", default=CPU)
    running.add_argument(
        "--lidar-height", type=float, help="of the drive, where the detector expects another"
    )
    running.add_argument("--frames", type=int, default=30)
    running.add_argument("--processes", type=int, default=max(1, (os.cpu_count() or 1) - 1))
    running.add_argument("--batch", type=int, default=2)
    running.add_argument("--seconds", type=float, default=240)
    running.add_argument("--grace", type=float, default=20)
    running.add_argument(
        "--only", nargs="*", default=[], help="conditions with one of these texts in the name"
    )
    running.add_argument("--seeds", type=int, default=2)
    running.add_argument("--list", action="store_true", help="print the conditions, and do nothing")
    reporting = commands.add_parser("report")
    reporting.add_argument("rows", type=Path)
    given = parser.parse_args()
    try:
        if given.command == "prepare":
            store(read_bag(given.bag, given.frames, given.slice), given.out)
            print(f"{given.out}: {given.out.stat().st_size / 1e6:.1f} MB")
        elif given.command == "report":
            from attack_study_tables import report

            for line in report(*rows_of(given.rows)):
                print(line, flush=True)
        elif given.list:
            print("\n".join(one.key for one in chosen(plan(given.seeds), given.only)))
        else:
            run(given)
    except AdvpipeError as error:
        parser.error(str(error))


if __name__ == "__main__":
    main()
