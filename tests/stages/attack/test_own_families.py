"""Attacks of a user's own of each family, written from the docstrings of their bases alone.

They go all the way from the command line and a scenario file through labels and provenance to `evaluate` and
`verify`.
"""

from __future__ import annotations

import hashlib
import json
import sys
from pathlib import Path

import pyarrow.parquet as pq
import pytest
from typer.testing import CliRunner

from advpipe.pipeline.bag.reader import BagReader
from advpipe.pipeline.cli import app
from advpipe.pipeline.core.errors import AdvpipeError
from advpipe.pipeline.labels.messages import read_labels
from advpipe.pipeline.scenario.attacks import AttackSpec
from advpipe.pipeline.scenario.load import load_scenario
from advpipe.stages.attack.run import AttackRequest, attack
from advpipe.stages.evaluate.v2x.detection import detect
from advpipe.stages.evaluate.v2x.receptions import read_receptions
from advpipe.stages.simulate.run import simulate
from advpipe.stages.verify.run import verify

COARSE = ("sensors.lidars.lidar.channels=4", "sensors.lidars.lidar.points_per_second=4000")

OWN = '''\
from dataclasses import replace

import numpy as np

from advpipe.pipeline.labels.points import PointLabels
from advpipe.stages.attack.gnss.base import GnssAttack, GnssTraits
from advpipe.stages.attack.lidar.base import Budget, LidarAttack, LidarResult, LidarTraits
from advpipe.stages.attack.v2x.base import V2xAttack, V2xTraits
from advpipe.stages.attack.v2x.cams import with_fields


class Shiver(LidarAttack):
    """Moves every point along x, with a mean square that is bounded: a new kind of budget."""

    traits = LidarTraits(
        budget=Budget(title="Mean square in m²", parameter="mean_m2", unit="m²", default=0.01)
    )

    def __init__(self, *, mean_m2: float, told: float = 1.0) -> None:
        self.mean_m2, self.told = mean_m2, told

    @property
    def bounds(self):
        return {"mean_square_displacement_m2": (0.0, self.told * self.mean_m2), "points_removed": (0, 0)}

    def __call__(self, cloud, boxes, detector, rng):
        moved = cloud.copy()
        moved["x"] += np.float32(np.sqrt(self.mean_m2) * 0.999)
        length_m = np.abs(moved["x"].astype(float) - cloud["x"])
        touched = np.flatnonzero(length_m > 0)
        return LidarResult(moved, PointLabels(touched, np.full(len(touched), "moved"), length_m[touched]))


class Rush(V2xAttack):
    """All attackers tell one speed, which is no more than so far from the true one."""

    traits = V2xTraits(untrue=("speed",))

    @classmethod
    def bounds(cls, parameters):
        return {"speed_offset_mps": (0, parameters["speed_mps"] + parameters["told_mps"])}

    def __init__(self, context, *, speed_mps: float = 60.0, told_mps: float = 0.0) -> None:
        super().__init__(context)
        self.speed_mps = speed_mps

    def edit(self, step, sent):
        return [self._lie(one) if self.context.acts(one) else one for one in sent]

    def _lie(self, one):
        cams = self.context.cams
        tree = cams.open(one.payload)
        if tree is None:
            return one
        return replace(one, payload=cams.close(with_fields(tree, speed_mps=self.speed_mps)))


class Broken(Rush):
    traits = V2xTraits()

    def edit(self, step, sent):
        raise KeyError("mine")


class Burst(V2xAttack):
    """Each message twice, a moment later: as many more as parameters tell."""

    traits = V2xTraits()

    def __init__(self, context, *, told_per_s: float = 100.0) -> None:
        super().__init__(context)

    @classmethod
    def bounds(cls, parameters):
        return {"messages_added_per_s": (0, parameters["told_per_s"])}

    def edit(self, step, sent):
        acting = [one for one in sent if self.context.acts(one)]
        again = [self.context.message(one.station_id, one.request_ns, one.payload) for one in acting]
        return [*sent, *again]


class Unmeasured(Rush):
    traits = V2xTraits(untrue=("speed",))

    @classmethod
    def bounds(cls, parameters):
        return {"smell": (0, 1)}


class North(GnssAttack):
    """The victim is so far north of where it is."""

    traits = GnssTraits()

    def __init__(self, *, offset_m: float = 30.0, told_m: float = 0.0) -> None:
        self.offset_m, self.told_m = offset_m, told_m

    @property
    def bounds(self):
        return {"fix_displacement_m": (0, self.offset_m + self.told_m)}

    def begin(self, rng):
        return lambda sight: sight.position_m + np.array([0.0, self.offset_m, 0.0])
'''


@pytest.fixture(scope="module")
def data_set(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A drive of 2 s, in which everybody sends."""
    out = tmp_path_factory.mktemp("own") / "smoke"
    settings = ["simulation.duration_s=2", "v2x.penetration=1", "recording.markers=false"]
    simulate(load_scenario("smoke", [*COARSE, *settings]), out)
    return out


@pytest.fixture(autouse=True)
def _their_module(tmp_path, monkeypatch):
    (tmp_path / "own_attacks.py").write_text(OWN)
    monkeypatch.chdir(tmp_path)
    monkeypatch.syspath_prepend(str(tmp_path))
    yield
    sys.modules.pop("own_attacks", None)


def by_command(data_set: Path, name: str, *arguments: str) -> Path:
    """The bag that the command makes, its provenance compared, and verified."""
    bag = data_set / name.lower()
    command = ["attack", str(data_set), "--type", f"own_attacks:{name}", "--out", str(bag), *arguments]
    done = CliRunner().invoke(app, command)
    assert done.exit_code == 0, done.output
    (record,) = BagReader(bag).provenance.fields.attacks
    assert record.values["attack_sha256"] == hashlib.sha256(OWN.encode()).hexdigest()
    assert verified(bag) == []
    return bag


def verified(bag: Path) -> list[str]:
    return [str(one) for one in verify(bag).findings]


def test_of_clouds(data_set: Path) -> None:
    """With its usual budget; a bound that is not kept is found out, as is one that nobody measures."""
    bag = by_command(data_set, "Shiver", "--frames", "0:2", "--detector", "linear_detector:Shipped")
    frames = pq.read_table(bag / "frames.parquet").to_pylist()
    assert {row["attack"] for row in frames} == {"own_attacks:Shiver"}
    assert BagReader(bag).provenance.parameters["mean_m2"] == 0.01


def test_a_cloud_beyond_its_own_bounds_is_refused(clean_bag: Path, tmp_path: Path) -> None:
    parameters = {"mean_m2": 0.01, "told": 0.9}
    spec = AttackSpec(type="own_attacks:Shiver", parameters=parameters, detector="linear_detector:Shipped")
    with pytest.raises(
        AdvpipeError, match=r"beyond its bounds: mean squared displacement .*: 0\.00\d+ m², but"
    ):
        attack(clean_bag, tmp_path / "out", AttackRequest((spec,)), workers=1)
    assert not (tmp_path / "out").exists()


def test_of_messages(data_set: Path) -> None:
    bag = by_command(data_set, "Rush", "--set", "speed_mps=70")
    rows = pq.read_table(bag / "v2x_labels.parquet").to_pylist()
    assert {(row["attack"], row["action"], row["fields"]) for row in rows} == {
        ("own_attacks:Rush", "changed", "speed_mps")
    }
    found = detect(read_receptions(BagReader(bag)), read_labels(bag))
    assert found.attack == "own_attacks:Rush"
    assert found.false_messages > 0


def test_of_fixes(data_set: Path) -> None:
    bag = by_command(data_set, "North")
    rows = pq.read_table(bag / "gnss_labels.parquet").to_pylist()
    assert {row["attack"] for row in rows} == {"own_attacks:North"}
    assert {round(row["offset_north_m"], 6) for row in rows} == {30.0}


def test_several_in_a_scenario_file(data_set: Path, tmp_path: Path) -> None:
    """The section `attacks` takes their names."""
    both = [
        "attacks.both=[{type: 'own_attacks:North', parameters: {offset_m: 12}}, {type: 'own_attacks:Rush'}]"
    ]
    request = AttackRequest(load_scenario("smoke", both).attacks["both"])
    request.check()
    bag = data_set / "both"
    attack(data_set / "clean", bag, request, workers=1)
    assert verified(bag) == []
    attacks = json.loads(BagReader(bag).provenance["attacks"])
    assert [one["declared"]["family"] for one in attacks] == ["gnss", "v2x"]


def test_a_mistake_in_one_on_messages_is_one_line(data_set: Path, tmp_path: Path) -> None:
    request = AttackRequest((AttackSpec(type="own_attacks:Broken"),))
    with pytest.raises(
        AdvpipeError, match=r"own_attacks:Broken failed: KeyError: 'mine' \(own_attacks\.py, "
    ):
        attack(data_set / "clean", tmp_path / "out", request)
    assert not (tmp_path / "out").exists()


def test_bounds_of_ones_own_are_declared_and_kept(data_set: Path) -> None:
    bag = by_command(data_set, "Burst")
    (record,) = BagReader(bag).provenance.fields.attacks
    assert record.declared is not None
    assert record.declared.bounds == {"messages_added_per_s": (0, 100)}


@pytest.mark.parametrize(
    ("name", "parameters", "line"),
    [
        (
            "Rush",
            {"speed_mps": 60.0, "told_mps": -55.0},
            r"Rush went beyond its bounds: .* reported speed: .* m/s, but .* 0 to 5 m/s",
        ),
        (
            "North",
            {"told_m": -1.0},
            r"North went beyond its bounds: distance .*: 30 m, but the attack declares 0 to 29 m",
        ),
        (
            "Burst",
            {"told_per_s": 1},
            r"Burst went .*: messages an attacker added within one second: 2, but the attack declares 0 to 1",
        ),
        ("Unmeasured", {}, r"Unmeasured bounds 'smell', which is not measured; known: position_offset_m, "),
    ],
)
def test_what_goes_beyond_its_own_bounds_is_refused(
    data_set: Path, tmp_path: Path, name: str, parameters: dict[str, float], line: str
) -> None:
    request = AttackRequest((AttackSpec(type=f"own_attacks:{name}", parameters=parameters),))
    with pytest.raises(AdvpipeError, match=line):
        attack(data_set / "clean", tmp_path / "out", request)
    assert not (tmp_path / "out").exists()
