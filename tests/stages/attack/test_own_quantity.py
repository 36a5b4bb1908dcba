"""A LiDAR attack of a user's own with a budget of a quantity of its own: bounded, carried, verified.

Written as a newcomer would: one file with the attack, and this test.
"""

from __future__ import annotations

import json
import shutil
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from typer.testing import CliRunner

from advpipe.pipeline.bag.reader import BagReader
from advpipe.pipeline.bag.writer import BagWriter
from advpipe.pipeline.cli import app
from advpipe.pipeline.core.errors import AdvpipeError
from advpipe.pipeline.scenario.attacks import AttackSpec
from advpipe.stages.attack.run import AttackRequest, attack
from advpipe.stages.verify.run import verify

OWN = '''\
import numpy as np

from advpipe import Budget, CloudQuantity, LidarAttack, LidarResult, LidarTraits, PointLabels

HEIGHT_CHANGE = CloudQuantity(
    name="max_height_change_m",
    unit="m",
    meaning="largest vertical displacement of a point",
    column="z_displacement_m",
    aggregate="max",
)
MEAN = CloudQuantity(
    name="mean_displacement_m", meaning="mean displacement", column="displacement_m", aggregate="mean"
)


class Lift(LidarAttack):
    """Lifts every point; how far is bounded."""

    traits = LidarTraits(
        budget=Budget(title="Height in m", parameter="height_m", unit="m", default=0.02),
        quantities=(HEIGHT_CHANGE, MEAN),
    )

    def __init__(self, *, height_m: float, excess: float = 1.0) -> None:
        self.height_m, self.excess = height_m, excess

    @property
    def bounds(self):
        return {"max_height_change_m": (0.0, self.height_m), "points_removed": (0, 0)}

    def __call__(self, cloud, boxes, detector, rng):
        lifted = cloud.copy()
        lifted["z"] += np.float32(self.excess * self.height_m * 0.99)
        length_m = np.abs(lifted["z"].astype(float) - cloud["z"])
        touched = np.flatnonzero(length_m > 0)
        return LidarResult(lifted, PointLabels(touched, np.full(len(touched), "moved"), length_m[touched]))


class Unmeasurable(Lift):
    traits = LidarTraits(
        budget=Lift.traits.budget, quantities=(HEIGHT_CHANGE.model_copy(update={"column": "height"}),)
    )


class Taken(Lift):
    traits = LidarTraits(
        budget=Lift.traits.budget, quantities=(HEIGHT_CHANGE.model_copy(update={"name": "points_moved"}),)
    )
'''


@pytest.fixture(autouse=True)
def _their_module(tmp_path, monkeypatch):
    (tmp_path / "own_lift.py").write_text(OWN)
    monkeypatch.chdir(tmp_path)
    monkeypatch.syspath_prepend(str(tmp_path))
    yield
    sys.modules.pop("own_lift", None)


@pytest.fixture
def lifted(clean_bag: Path, tmp_path: Path) -> Path:
    """The adversarial bag, made by the command, beside a copy of the clean bag."""
    data_set = tmp_path / "data"
    shutil.copytree(clean_bag, data_set / "clean")
    arguments = ["--type", "own_lift:Lift", "--detector", "linear_detector:Shipped", "--frames", "0:2"]
    done = CliRunner().invoke(
        app, ["attack", str(data_set / "clean"), *arguments, "--out", str(data_set / "lift")]
    )
    assert done.exit_code == 0, done.output
    sys.modules.pop("own_lift", None)
    (tmp_path / "own_lift.py").unlink()  # to verify a bag, nobody's code is needed
    return data_set / "lift"


def rewritten(bag: Path, change: Callable[[dict[str, Any]], None]) -> Path:
    """The bag with another declaration."""
    record = dict(BagReader(bag).provenance)
    attacks = json.loads(record["attacks"])
    change(attacks[0]["declared"])
    out = bag.with_name("rewritten")
    with BagWriter(out, provenance={**record, "attacks": json.dumps(attacks)}) as writer:
        for raw in BagReader(bag).raw_messages():
            writer.copy(raw)
    for name in ("labels.parquet", "frames.parquet", "attack.yaml"):
        shutil.copy(bag / name, out / name)
    return out


def test_the_bag_carries_it_and_verify_measures_it(lifted: Path) -> None:
    """The quantity that no bound names is not in the bag."""
    (record,) = BagReader(lifted).provenance.fields.attacks
    assert record.declared is not None
    assert record.declared.bounds["max_height_change_m"] == (0.0, 0.02)
    assert [each.name for each in record.declared.quantities] == ["max_height_change_m"]
    found = verify(lifted)
    assert found.findings == []
    assert not [gap for gap in found.unchecked if "max_height_change_m" in gap.what]


def test_a_cloud_beyond_the_declared_bound_is_found(lifted: Path) -> None:
    def lower(declared: dict[str, Any]) -> None:
        declared["bounds"]["max_height_change_m"] = [0.0, 0.01]

    whats = [found.what for found in verify(rewritten(lifted, lower)).findings]
    assert any(
        "frame 1: largest vertical displacement of a point: 0.0198" in what
        and "but the attack declares 0 to 0.01 m (max_height_change_m)" in what
        for what in whats
    ), whats


def test_what_a_newer_version_declares_is_not_checked(lifted: Path) -> None:
    def newer(declared: dict[str, Any]) -> None:
        declared["quantities"][0]["column"] = "curl"

    gaps = [gap.what for gap in verify(rewritten(lifted, newer)).unchecked]
    assert "max_height_change_m of own_lift:Lift not checked: unknown quantity in this version" in gaps


@pytest.mark.parametrize(
    ("name", "parameters", "line"),
    [
        (
            "Lift",
            {"height_m": 0.02, "excess": 1.5},
            r"Lift went beyond its bounds: largest vertical displacement of a point: 0\.0297\d* m, "
            r"but the attack declares 0 to 0\.02 m \(max_height_change_m\)",
        ),
        ("Unmeasurable", {}, r"Unmeasurable: max_height_change_m is the max of height; known columns: displ"),
        ("Taken", {}, r"Taken: there is another quantity points_moved; rename this one"),
    ],
)
def test_refused(clean_bag: Path, tmp_path: Path, name: str, parameters: dict[str, float], line: str) -> None:
    given = {"height_m": 0.02, **parameters}
    spec = AttackSpec(type=f"own_lift:{name}", parameters=given, detector="linear_detector:Shipped")
    with pytest.raises(AdvpipeError, match=line):
        attack(clean_bag, tmp_path / "out", AttackRequest((spec,)), workers=1)
    assert not (tmp_path / "out").exists()
