"""The hidden folder of finished frames: it stays where a run can go on from it, and only there."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from advpipe.pipeline.core.errors import AdvpipeError
from advpipe.pipeline.messages.cloud import POINT_DTYPE
from advpipe.stages.attack.job import Job, open_job
from advpipe.stages.attack.lidar.base import LidarResult, unchanged


def result() -> LidarResult:
    return unchanged(np.zeros(3, POINT_DTYPE), "as it was")


def fail(out: Path, request: str, frames: int) -> Path:
    """A run that ends with an error when so many frames are done; returns its folder."""
    folder = out
    with pytest.raises(AdvpipeError, match="refused"), open_job(out, request) as job:  # noqa: PT012
        folder = job.folder
        for index in range(frames):
            job.store(index, result())
        raise AdvpipeError("refused")
    return folder


def test_a_refused_attack_leaves_nothing(tmp_path: Path) -> None:
    fail(tmp_path / "new" / "deep" / "adv", "a", frames=0)
    assert not list(tmp_path.iterdir())


def test_finished_frames_stay_until_another_request(tmp_path: Path) -> None:
    out = tmp_path / "adv"
    folder = fail(out, "a", frames=2)
    (folder / "000002.77.partial").write_bytes(b"half")
    with open_job(out, "a") as job:
        assert job.load(1) is not None
        assert job.load(2) is None
        assert not list(folder.glob("*.partial"))
        job.store(2, result())
    assert not list(tmp_path.iterdir())
    folder = fail(out, "a", frames=1)
    fail(out, "b", frames=0)
    assert not list(tmp_path.iterdir())


def test_a_frame_that_a_full_disk_refuses_leaves_no_half(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def full(stream, **arrays):
        stream.write(b"half")
        raise OSError(28, "No space left on device")

    job = Job(tmp_path)
    with monkeypatch.context() as patch:
        patch.setattr(np, "savez", full)
        with pytest.raises(OSError, match="No space"):
            job.store(0, result())
    assert not list(tmp_path.iterdir())


def test_a_worker_of_a_killed_run_is_not_in_the_way(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """It stores the same frame at the same time, from a process of its own."""
    job, savez = Job(tmp_path), np.savez

    def meanwhile(stream, **arrays):
        monkeypatch.setattr(np, "savez", savez)
        with monkeypatch.context() as patch:
            patch.setattr("os.getpid", lambda: 1)
            job.store(0, result())
        savez(stream, **arrays)

    monkeypatch.setattr(np, "savez", meanwhile)
    job.store(0, result())
    assert [path.name for path in tmp_path.iterdir()] == ["000000.npz"]
    assert job.load(0) is not None
