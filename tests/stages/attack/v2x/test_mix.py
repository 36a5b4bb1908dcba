from __future__ import annotations

import pyarrow.parquet as pq
import pytest
from one_attacker import genuine

from advpipe.pipeline.core.errors import AdvpipeError
from advpipe.pipeline.scenario.attacks import attack_spec
from advpipe.stages.attack.v2x.change import forge
from advpipe.stages.attack.v2x.mix import MIXES


def test_each_attacker_draws_one_attack(attacked_cams):
    """Either it is longer, or it heads the other way; never both, and both occur."""
    messages = [genuine(0)]
    combinations = set()
    for seed in range(12):
        (reported,) = attacked_cams(
            "cam-mix", messages, seed=seed, attacks="cam-heading-reversed,cam-dimensions"
        )
        combinations.add((reported.length_m > 4.5, reported.heading_rad > 4))
    assert combinations == {(True, False), (False, True)}


def test_a_constant_speed_of_nextgen_is_zero(attacked_cams, monkeypatch):
    """Its zero speed report; F2MD's is drawn."""
    for name, drawn in (("nextgen", False), ("f2md", True)):
        alone = [one for one in MIXES[name]() if one.name == "cam-speed-constant"]
        monkeypatch.setitem(MIXES, name, lambda alone=alone: alone)
        (reported,) = attacked_cams("cam-mix", [genuine(0)], attacks=name)
        assert (reported.speed_mps > 0) == drawn


def test_names_that_cannot_be_mixed_are_refused(attacked_cams):
    with pytest.raises(AdvpipeError, match="'cam-mix' cannot be mixed"):
        attacked_cams("cam-mix", [genuine(0)], attacks="cam-dimensions, cam-mix")


F2MD = """
position-constant position-offset position-random position-random-offset speed-constant speed-offset
speed-random speed-random-offset eventual-stop disruptive-replay replay stale dos dos-random dos-disruptive
sybil-grid sybil-replay dos-random-sybil dos-disruptive-sybil
"""
NEXTGEN = """
position-offset position-random-offset position-mirrored speed-offset speed-random-offset speed-constant
speed-frozen heading-reversed feigned-braking acceleration delay dos sybil-congestion sudden-stop replay
"""


def test_mixes_match_the_catalogues():
    """In the order of the numbers that the data sets give them; mixing is not mixed."""
    names = {mix: [one.name for one in MIXES[mix]()] for mix in MIXES}
    assert names["f2md"] == [f"cam-{name}" for name in F2MD.split()]
    assert names["nextgen"] == [f"cam-{name}" for name in NEXTGEN.split()]
    three = ["cam-position-offset", "cam-speed-random-offset", "cam-sudden-stop"]
    assert names["three"] == three
    assert (names["f2md"][8], names["nextgen"][8]) == ("cam-eventual-stop", "cam-feigned-braking")
    assert set(names["all"]) == {*names["f2md"], *names["nextgen"]}


def test_labels_name_the_part(recorded, tmp_path):
    """Each attacker carries out one part; what it changes is what that part changes."""
    spec = attack_spec(
        {
            "type": "cam-mix",
            "parameters": {"attacks": "cam-heading-reversed, cam-dimensions, cam-drop"},
            "attackers": {"share": 1.0},
        }
    )
    change = forge(recorded(), [spec], 1)
    change.write_labels(tmp_path)
    rows = pq.read_table(tmp_path / "v2x_labels.parquet").to_pylist()
    assert {row["attack"] for row in rows} == {"cam-mix"}
    assert {row["part"] for row in rows} == {"cam-heading-reversed", "cam-dimensions", "cam-drop"}
    assert len({(row["attacker"], row["part"]) for row in rows}) == len({row["attacker"] for row in rows})
    fields = {
        "cam-heading-reversed": {"heading_rad"},
        "cam-dimensions": {"length_m", "width_m"},
        "cam-drop": set(),
    }
    for row in rows:
        assert set(filter(None, row["fields"].split(","))) <= fields[row["part"]]
        assert (row["action"] == "dropped") == (row["part"] == "cam-drop")
    counts = change.counts()
    assert counts["CAMs changed"] + counts["CAMs dropped"] == len(rows)
    assert counts["CAMs dropped"] == sum(row["part"] == "cam-drop" for row in rows) > 0
