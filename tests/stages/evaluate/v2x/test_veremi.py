"""The export read back: lines of the documented form, labels, and numbers that agree with the bag."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from typer.testing import CliRunner

from advpipe.pipeline.bag.provenance_record import Provenance
from advpipe.pipeline.bag.reader import BagReader
from advpipe.pipeline.cli import app
from advpipe.pipeline.core.errors import AdvpipeError
from advpipe.pipeline.labels.messages import read_labels
from advpipe.pipeline.scenario.attacks import AttackSpec
from advpipe.stages.attack.registry import ATTACKS, find_attack
from advpipe.stages.attack.request import AttackRequest
from advpipe.stages.attack.run import attack
from advpipe.stages.evaluate.v2x.receptions import read_receptions
from advpipe.stages.evaluate.v2x.veremi import FIRST_OF_OURS, attack_numbers, export_veremi

VECTORS = ["pos", "pos_noise", "spd", "spd_noise", "acl", "acl_noise", "hed", "hed_noise"]
EXTENSION = {
    2: ["type", "rcvTime", *VECTORS],
    3: ["type", "rcvTime", "sendTime", "sender", "senderPseudo", "messageID", *VECTORS],
    4: ["type", "sendTime", "sender", "senderPseudo", "messageID", *VECTORS],
}
"""Keys of the VeReMi Extension's lines, in order (as published, one message of its GridSybil traces)."""
FIRST = {
    2: ["type", "rcvTime", "pos", "noise", "spd", "spd_noise"],
    3: [
        *("type", "rcvTime", "sendTime", "sender", "messageID"),
        *("pos", "pos_noise", "spd", "spd_noise", "RSSI"),
    ],
    4: ["type", "time", "sender", "attackerType", "messageID", "pos", "pos_noise", "spd", "spd_noise"],
}
"""The same of VeReMi, 2018."""


def lines(path: Path) -> list[dict[str, Any]]:
    return [json.loads(line) for line in path.read_text().splitlines()]


@pytest.fixture(scope="module")
def exported(offset: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    out = tmp_path_factory.mktemp("veremi") / "out"
    export_veremi(offset, out)
    return out


def test_form_of_the_extension(exported: Path) -> None:
    for path in (exported / "trace").iterdir():
        for line in lines(path):
            expected = EXTENSION[line["type"]] + {2: [], 3: ["RSSI"], 4: ["attackerType"]}[line["type"]]
            assert list(line) == expected
            assert all(len(line[name]) == 3 for name in VECTORS)


def test_labels(offset: Path, exported: Path) -> None:
    """The attackers' files are named so, and just the messages that matter carry the number 2."""
    labels = read_labels(offset)
    attackers = {str(label.station_id) for label in labels}
    names = [path.name.split("-") for path in (exported / "trace").glob("traceJSON-*")]
    assert {parts[1] for parts in names if parts[3] == "A2"} == attackers
    assert {parts[3] for parts in names} == {"A0", "A2"}
    truth = lines(exported / "trace" / "traceGroundTruthJSON-0.json")
    assert {line["messageID"] for line in truth if line["attackerType"] == 2} == {
        label.number for label in labels if label.mattered
    }
    assert json.loads((exported / "attacks.json").read_text()) == {"cam-position-offset": 2}


def test_receptions_and_truth(offset: Path, exported: Path) -> None:
    (ego,) = read_receptions(BagReader(offset))
    (path,) = (exported / "trace").glob(f"traceJSON-{ego.receivers[0].station_id}-*")
    received = [line for line in lines(path) if line["type"] == 3]
    assert [line["messageID"] for line in received] == ego.numbers
    truth = {line["messageID"]: line for line in lines(exported / "trace" / "traceGroundTruthJSON-0.json")}
    lied = {label.number for label in read_labels(offset)}
    for line, one, claim in zip(received, ego.received, ego.claims, strict=True):
        assert line["sender"] == one.station_id
        assert line["senderPseudo"] == claim.station_id
        assert line["sendTime"] <= line["rcvTime"]
        assert line["rcvTime"] == pytest.approx((one.arrival_ns % 86_400_000_000_000) / 1e9, abs=1e-6)
        np.testing.assert_allclose(line["pos"][:2], [claim.x_m, claim.y_m], atol=1e-3)
        assert math.hypot(*line["spd"]) == pytest.approx(abs(claim.speed_mps), abs=1e-9)
        assert math.hypot(*line["hed"]) == pytest.approx(1.0)
        assert 10 * math.log10(line["RSSI"]) == pytest.approx(one.power_dbm)
        off_m = math.dist(line["pos"], truth[line["messageID"]]["pos"])
        assert off_m > 15 if line["messageID"] in lied else off_m < 6


def test_a_mix_is_labelled_by_its_parts(smoke: Path, tmp_path: Path) -> None:
    """Constant speeds are number 5 of the Extension, reversed headings are none of its own."""
    attacks = "cam-speed-constant, cam-heading-reversed"
    spec = AttackSpec(type="cam-mix", parameters={"attacks": attacks}, attackers={"share": 0.6})
    attack(smoke, tmp_path / "mix", AttackRequest((spec,)))
    export_veremi(tmp_path / "mix", tmp_path / "out")
    kinds = {"cam-heading-reversed": FIRST_OF_OURS, "cam-speed-constant": 5}
    assert json.loads((tmp_path / "out" / "attacks.json").read_text()) == kinds
    of_message = {label.number: label for label in read_labels(tmp_path / "mix")}
    stated = lines(tmp_path / "out" / "trace" / "traceGroundTruthJSON-0.json")
    assert {line["attackerType"] for line in stated} == {0, 5, FIRST_OF_OURS}
    for line in stated:
        if line["attackerType"]:
            assert kinds[of_message[line["messageID"]].part] == line["attackerType"]


def test_form_of_2018(offset: Path, tmp_path: Path) -> None:
    export_veremi(offset, tmp_path / "out", form="2018")
    trace = tmp_path / "out" / "trace"
    assert any(path.name.endswith("-A2.json") for path in trace.glob("JSONlog-*"))
    for path in trace.iterdir():
        for line in lines(path):
            assert list(line) == FIRST[line["type"]]


def test_numbers() -> None:
    """All 19 of the Extension and those of 2018 are attacks of ours; others count from 1000, by name."""
    specs = tuple(AttackSpec(type=attack) for attack in ATTACKS if find_attack(attack).family != "lidar")
    attacks = AttackRequest(specs).resolved()
    bag = Provenance({"attacks": json.dumps(attacks)})
    names = [spec.type for spec in specs]
    for form, known in (("extension", set(range(1, 20))), ("2018", {1, 2, 4, 8, 16, 32, 64})):
        assert {n for n in attack_numbers(names, bag, form).values() if n < FIRST_OF_OURS} == known
    numbers = attack_numbers(["cam-dos", "cam-drop", "gnss-drift"], bag, "extension")
    assert numbers == {"cam-dos": 13, "cam-drop": FIRST_OF_OURS, "gnss-drift": FIRST_OF_OURS + 1}
    older = Provenance({"attacks": '[{"type": "cam-dos", "attackers": null}]'})
    assert attack_numbers(["cam-dos"], older, "extension") == {"cam-dos": FIRST_OF_OURS}


def test_a_clean_drive_has_no_attackers(smoke: Path, tmp_path: Path) -> None:
    result = CliRunner().invoke(app, ["export", str(smoke), "--out", str(tmp_path / "out")])
    assert result.exit_code == 0, result.output
    truth = lines(tmp_path / "out" / "trace" / "traceGroundTruthJSON-0.json")
    assert {line["attackerType"] for line in truth} == {0}
    again = CliRunner().invoke(app, ["export", str(smoke), "--out", str(tmp_path / "out")])
    assert again.exit_code == 2
    assert "exists" in again.output


def test_what_is_refused(smoke: Path, tmp_path: Path) -> None:
    unknown = CliRunner().invoke(app, ["export", str(smoke), "--format", "csv"])
    assert unknown.exit_code == 2
    assert "unknown format 'csv'; known: kitti," in unknown.output
    with pytest.raises(AdvpipeError, match="no form of VeReMi is named csv"):
        export_veremi(smoke, tmp_path / "out", form="csv")
