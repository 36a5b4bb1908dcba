"""A provenance record that somebody wrote by hand: what is none of ours fails with a one-line error."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from advpipe.pipeline.bag.provenance_record import MOST_LOOKS, Provenance
from advpipe.pipeline.bag.reader import BagReader
from advpipe.pipeline.bag.writer import BagWriter
from advpipe.pipeline.core.errors import AdvpipeError
from advpipe.stages.evaluate.detection.baseline import USUAL_LOOKS, attack_query_budget


def test_nothing_is_said() -> None:
    nothing = Provenance({})
    assert not nothing
    assert (nothing.parameters, nothing.fields.attacks, nothing.is_attack) == ({}, (), False)
    assert attack_query_budget(nothing) == USUAL_LOOKS


def test_what_is_said() -> None:
    assert Provenance({"seed": "7"}).fields.seed == 7
    assert attack_query_budget(Provenance({"looks": "13"})) == 13
    assert Provenance({"parameters": '{"ratio": 0.01}'}).parameters == {"ratio": 0.01}
    assert Provenance({"parameters": '[{"ratio": 0.01}]'}).parameters == {}  # of a coordinated attack
    attacks = '[{"type": "cam-dos", "parameters": {"rate_hz": 20.0}, "victim": null, "newer": 1}]'
    found = Provenance({"kind": "attack", "attacks": attacks})
    assert found.is_attack
    assert found.fields.attacks[0].parameters == {"rate_hz": 20.0}
    assert found.fields.attacks[0].values == json.loads(attacks)[0]


@pytest.mark.parametrize(
    ("keys", "family"),
    [
        ({"declared": {"family": "gnss"}, "attackers": None}, "gnss"),
        ({"attackers": None, "dcc_reacts": False}, "v2x"),
        ({"recipe": "", "detector": "small"}, "lidar"),
        ({"victim": None}, "gnss"),
    ],
)
def test_the_family_of_an_attack(keys: dict[str, object], family: str) -> None:
    """Whatever its name is; in older bags by the keys of its family."""
    attacks = json.dumps([{"type": "cam-drop", "parameters": {}, **keys}])
    assert Provenance({"attacks": attacks}).fields.attacks[0].family == family


def test_it_is_the_record_too() -> None:
    record = {"kind": "clean", "newer": "x"}
    assert Provenance(record) == record
    assert {**Provenance(record)} == record


DEEP = "[" * 5000 + "]" * 5000
WRONG = {
    "looks": ("many", "0", "-1", "2.5", str(MOST_LOOKS + 1), "", "true", '"3"'),
    "parameters": ("{", "7", '"ratio"', DEEP, '{"a": NaN}', '{"a": 1, "a": 2}', '{"a": "\\ud800"}'),
    "attacks": (
        "[",
        "[3]",
        "{}",
        '[{"victim": "ego"}]',
        '[{"type": 1}]',
        '[{"type": "a", "victim": []}]',
        '[{"type": "a", "declared": {}}]',
        '[{"type": "a", "declared": {"family": "gnss", "bounds": {"m": [1]}}}]',
        DEEP,
    ),
    "lidar_topics": ("/ego/lidar/points", "[1]", "{}", '["\\u0000"]', "null"),
    "versions": ("[]", '{"numpy": 1}', "{" * 5000, "Infinity", '{"numpy": "\\ud800"}'),
    "recovered": ("[]", '{"clouds": -1}', '{"clouds": 1e400}'),
    "seed": ("", "-5", "Infinity", "1e99", "9" * 5000, "seven"),
    "kind": ("x" * 1_000_000, "a\0b"),
    "scenario_name": ("x" * 1_000_000,),
    "attack": ("x" * 1_000_000,),
}


@pytest.mark.parametrize(
    ("key", "text"),
    [(key, text) for key, texts in WRONG.items() for text in texts],
    ids=lambda text: ascii(text)[:30],
)
def test_what_is_none_of_ours(key: str, text: str) -> None:
    with pytest.raises(AdvpipeError, match=f"^bag: .*{key}.*; make the bag again$") as caught:
        Provenance({"kind": "attack", key: text}, "bag")
    assert len(str(caught.value)) < 400


def test_a_record_without_end() -> None:
    with pytest.raises(AdvpipeError, match="is too large"):
        Provenance({f"key {number}": "" for number in range(1000)})
    with pytest.raises(AdvpipeError, match="is too large"):
        Provenance({"newer": "x" * 10_000_000})


def test_it_is_checked_when_it_is_written(tmp_path: Path) -> None:
    with pytest.raises(AdvpipeError, match="parameters: not valid JSON: NaN"):
        BagWriter(tmp_path / "bag", provenance={"parameters": '{"a": NaN}'})
    with BagWriter(tmp_path / "bag", provenance={"seed": "7"}):
        pass
    assert BagReader(tmp_path / "bag").provenance.fields.seed == 7
