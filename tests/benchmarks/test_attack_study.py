"""The study of attacks: its order, its file of frames, its rows, and that it ends in time and goes on."""

from __future__ import annotations

import importlib
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest
from benchmark_modules import BENCHMARKS, benchmark_module
from small_drive import LEADER_AHEAD_M, LIDAR_HEIGHT_M, SIZE_M, cast

from advpipe.pipeline.bag.frames import Frame
from advpipe.pipeline.core.errors import UsageError
from advpipe.pipeline.detector.protocol import Detections, Range
from advpipe.pipeline.geometry.boxes import Boxes
from advpipe.pipeline.metrics.average_precision import average_precision
from advpipe.stages.evaluate.detection.scoring import ground_truth, match

EVERYWHERE = Range(-80, -80, -5, 80, 80, 5)


@pytest.fixture(scope="module")
def study() -> Iterator[dict[str, ModuleType]]:
    """The modules of the benchmark by what follows `attack_study_` in their names."""
    names = ("", "_drive", "_frame", "_plan", "_tables")
    with benchmark_module("attack_study"):
        yield {name.lstrip("_"): importlib.import_module(f"attack_study{name}") for name in names}


def leader_frame(number: int) -> Frame:
    ahead_m = LEADER_AHEAD_M + number
    box = [ahead_m, 0.0, SIZE_M[2] / 2 - LIDAR_HEIGHT_M, *SIZE_M, 0.0]
    boxes = Boxes(np.array([box]), np.zeros(1, np.int64), (f"leader.{number}",), np.full((1, 3), np.nan))
    return Frame(number, 1_000_000_000 * number, cast(ahead_m), boxes)


@pytest.fixture(scope="module")
def drive(study: dict[str, ModuleType], tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("study") / "drive.npz"
    study["drive"].store([leader_frame(number) for number in range(3)], path)
    return path


def test_a_stored_drive_comes_back(study: dict[str, ModuleType], drive: Path) -> None:
    for number, frame in enumerate(study["drive"].load(drive)):
        wanted = leader_frame(number)
        np.testing.assert_array_equal(frame.cloud, wanted.cloud)
        np.testing.assert_array_equal(frame.boxes.geometry, wanted.boxes.geometry)
        assert (frame.index, frame.stamp_ns, frame.boxes.ids) == (number, wanted.stamp_ns, wanted.boxes.ids)


def test_every_condition_can_be_built_once_and_random_best_comes_early(study: dict[str, ModuleType]) -> None:
    conditions = study["plan"].plan(2)
    keys = [one.key for one in conditions]
    assert len(set(keys)) == len(keys)
    for one in conditions[1:]:
        one.build()
    assert keys[0] == "clean/clean/0"
    assert keys.index("attach-0.5/random-best/0") < 7
    assert {one.seed for one in conditions} == {0, 1}


def test_steps_and_decoys_of_a_variant(study: dict[str, ModuleType]) -> None:
    condition = study["plan"].Condition
    plain, twice = (condition("detach-1", "best", each).build() for each in ((), ("twice",)))
    assert twice.rounds == 2 * plain.rounds
    without = condition("perturb-10", "best", ("no-decoys",)).build()
    assert not without.settings.decoys
    assert not without.settings.decoy_gradients
    with pytest.raises(UsageError, match="perturb alone"):
        condition("detach-1", "best", ("no-decoys",)).build()


def test_only_is_an_order_and_clean_clouds_stay(study: dict[str, ModuleType]) -> None:
    plan = study["plan"]
    keys = [one.key for one in plan.chosen(plan.plan(), ["detach-1/robust", "detach-1/best/0"])]
    assert keys == ["clean/clean/0", "detach-1/robust/0", "detach-1/best/0"]
    with pytest.raises(UsageError, match="--only nothing"):
        plan.chosen(plan.plan(), ["nothing"])


def test_rows_keep_what_average_precision_needs(study: dict[str, ModuleType]) -> None:
    rng, coded, whole = np.random.default_rng(3), [], []
    for number in range(4):
        frame = leader_frame(number)
        truth = ground_truth(frame, ("car",), EVERYWHERE)
        boxes = np.repeat(frame.boxes.geometry, 5, axis=0) + rng.normal(0, 0.15, (5, 7))
        found = Detections(boxes, np.sort(rng.integers(1, 99_999, 5) / 1e5)[::-1], np.zeros(5, np.int64))
        coded.append(study["frame"].matched(truth, found, ("car",)))
        whole.append(match(truth, found, ("car",)))
    for kind in ("strict", "loose"):
        ranked = study["tables"].ranked_matches([each["car"] for each in coded], kind)
        assert ranked.average_precision() == pytest.approx(
            average_precision([each[kind, "car"] for each in whole])
        )


def test_only_what_is_missing_is_done(study: dict[str, ModuleType]) -> None:
    condition = study["plan"].Condition("detach-1", "best")
    items = study[""].remaining([condition], 4, 2, {(condition.key, 1)})
    assert items == [(condition, (0, 2)), (condition, (3,))]


def run(drive: Path, out: Path, *more: str) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, BENCHMARKS / "attack_study.py", "run", drive, "--out", out, "--processes", "1"]
    return subprocess.run([*command, *more], capture_output=True, text=True, timeout=300, check=False)


@pytest.mark.nightly
def test_it_ends_in_time_goes_on_and_reports(
    study: dict[str, ModuleType], drive: Path, tmp_path: Path
) -> None:
    out, only = tmp_path / "rows.jsonl", ("--frames", "2", "--only", "detach-1/best/0")
    assert run(drive, out, *only, "--seconds", "0").returncode == 0
    assert study[""].rows_of(out)[1] == []
    ended = run(drive, out, *only, "--seconds", "200")
    assert ended.returncode == 0, ended.stderr
    head, rows = study[""].rows_of(out)
    assert {(row["condition"], row["frame"]) for row in rows} == {
        (key, number) for key in ("clean/clean/0", "detach-1/best/0") for number in (0, 1)
    }
    assert all(row["removed"] for row in rows if row["condition"] != "clean/clean/0")
    lines = list(study["tables"].report(head, rows))
    assert any(line.startswith("| detach-1/best | 2 |") for line in lines)
    # A line that was cut off counts as not written; frames of another drive are refused.
    text = out.read_text(encoding="utf-8")
    out.write_text(text[:-20], encoding="utf-8")
    assert "1 rows in" in run(drive, out, *only).stdout
    assert {(row["condition"], row["frame"]) for row in study[""].rows_of(out)[1]} == {
        (row["condition"], row["frame"]) for row in rows
    }
    refused = run(drive, out, "--frames", "3", "--only", "detach-1/best/0")
    assert refused.returncode == 2
    assert "other frames" in refused.stderr


def test_consecutive_frames_get_the_temporal_check(study: dict[str, ModuleType]) -> None:
    """One of two cars is hidden in every second of 34 frames, a tenth of a second apart."""
    rows = []
    for key in ("clean/clean/0", "detach-1/best/0"):
        for number in range(34):
            found = [[10 + 0.1 * number, 3, -1, 0.9, 0], [20, -5, -1, 0.8, 0]]
            if key != "clean/clean/0" and number % 2:
                found.pop()
            matches = [2, [90_000, 80_000][: len(found)], *["11"[: len(found)]] * 2]
            rows.append(
                {
                    **{"condition": key, "frame": number, "views": {"none": {"car": matches}}},
                    **{"objective": 0.0, "checks": {"ray": 0.0}, "found": found, "cpu_s": 1, "attack_s": 1},
                }
            )
    head = {"machine": "", "drive": "", "detector_sha256": "", "processes": 1, "batch": 1}
    lines = list(study["tables"].report(head | {"stamps_ns": [n * 100_000_000 for n in range(34)]}, rows))
    assert "| condition | frames | ray | temporal |" in lines
    (line,) = [each for each in lines if each.startswith("| detach-1/best | 34 | 0, 0.50 |")]
    detected, auc = line.split("|")[4].split(",")
    assert float(detected) > 40
    assert float(auc) > 0.7
