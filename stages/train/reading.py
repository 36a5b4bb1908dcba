"""Reads the frames of the bags to learn from: here one after the other, or as jobs on other machines."""

from __future__ import annotations

import pickle
from collections.abc import Callable, Iterator, Sequence
from contextlib import closing
from functools import partial
from pathlib import Path
from typing import NamedTuple

from advpipe.pipeline.bag.frame_reader import FrameReader
from advpipe.pipeline.bag.frames import count_frames, read_frames
from advpipe.pipeline.core.job_engine import runs_elsewhere
from advpipe.pipeline.core.jobs import stream_jobs
from advpipe.pipeline.core.progress import track
from advpipe.pipeline.core.scratch import scratch_folder
from advpipe.stages.train.frames import CroppedFrame, cropped

FRAMES_A_JOB = 16
"""A task of a cluster costs some 30 ms beside its work; a frame is read in 10."""


class _Part(NamedTuple):
    """Frames first to last - 1 of one of the bags."""

    bag: int
    first: int
    last: int


def cropped_frames(bags: Sequence[Path], radius_m: float) -> Iterator[CroppedFrame]:
    """The frames of all bags in their order, within a radius around the sensor; the same wherever they are
    read."""
    if runs_elsewhere():
        parts = _parts(bags)
        jobs = stream_jobs(partial(_reader, tuple(bags), parts, radius_m), range(len(parts)), "read the bags")
        with closing(jobs) as results:
            for frames in _in_order(results):
                yield from frames
        return
    for bag in bags:
        for frame in track(read_frames(bag), f"read {bag.name}", total=count_frames(bag)):
            yield cropped(frame, radius_m)


def _parts(bags: Sequence[Path]) -> tuple[_Part, ...]:
    counts = [count_frames(bag) for bag in bags]
    return tuple(
        _Part(number, first, min(first + FRAMES_A_JOB, count))
        for number, count in enumerate(counts)
        for first in range(0, count, FRAMES_A_JOB)
    )


def _reader(
    bags: Sequence[Path], parts: Sequence[_Part], radius_m: float
) -> Callable[[int], list[CroppedFrame]]:
    """What a worker does: it opens a bag when the first of its parts comes."""
    opened: dict[int, FrameReader] = {}

    def read(job: int) -> list[CroppedFrame]:
        part = parts[job]
        if part.bag not in opened:
            opened.clear()  # parts come bag after bag
            opened[part.bag] = FrameReader(bags[part.bag])
        reader = opened[part.bag]
        return [cropped(reader.frame(index), radius_m) for index in range(part.first, part.last)]

    return read


def _in_order(results: Iterator[tuple[int, list[CroppedFrame]]]) -> Iterator[list[CroppedFrame]]:
    """The results of jobs 0, 1, ... in this order; those that come early wait on the disk."""
    with scratch_folder() as folder:
        due = 0
        for job, result in results:
            (folder / str(job)).write_bytes(pickle.dumps(result, pickle.HIGHEST_PROTOCOL))
            while (file := folder / str(due)).exists():
                yield pickle.loads(file.read_bytes())
                file.unlink()
                due += 1
