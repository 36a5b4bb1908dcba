"""Frames to learn from: the same, and in the same order, wherever they are read."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any, ClassVar

import pytest
from two_nodes import ray_cluster

from advpipe.pipeline.cluster.connect import use_cluster
from advpipe.pipeline.core.job_engine import JobLimits, use_engine
from advpipe.stages.train import reading
from advpipe.stages.train.frames import CroppedFrame, FrameStore
from advpipe.stages.train.reading import cropped_frames


class Backwards:
    """An engine whose results come in the reverse order."""

    is_elsewhere: ClassVar[bool] = True

    def results(
        self, prepare: Callable[[], Callable[[int], Any]], jobs: Sequence[int], limits: JobLimits
    ) -> Iterator[tuple[int, Any]]:
        work = prepare()
        yield from reversed([(job, work(job)) for job in jobs])


def stored(frames: Iterator[CroppedFrame], folder: Path) -> dict[str, bytes]:
    FrameStore.build(frames, folder, "key")
    return {path.name: path.read_bytes() for path in folder.iterdir()}


def test_results_that_come_out_of_order(drive: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(reading, "FRAMES_A_JOB", 4)
    here = stored(cropped_frames([drive, drive], 5.0), tmp_path / "here")
    with use_engine(Backwards()):
        there = stored(cropped_frames([drive, drive], 5.0), tmp_path / "there")
    assert here == there
    assert sorted(path.name for path in tmp_path.iterdir() if path.is_dir()) == ["here", "there"]
    assert len(here["points.bin"]) > 10_000


@pytest.mark.nightly
def test_a_cluster_reads_the_same_bytes(drive: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(reading, "FRAMES_A_JOB", 1)
    here = stored(cropped_frames([drive, drive], 5.0), tmp_path / "here")
    with ray_cluster(2) as cluster, use_cluster(cluster.address):
        there = stored(cropped_frames([drive, drive], 5.0), tmp_path / "there")
    assert here == there
