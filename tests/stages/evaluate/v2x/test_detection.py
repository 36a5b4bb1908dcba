"""Detection on real drives: honest messages pass, lies are found out, and the labels say which is which."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from advpipe.pipeline.bag.provenance_record import Provenance
from advpipe.pipeline.bag.reader import BagReader
from advpipe.pipeline.core.errors import AdvpipeError
from advpipe.pipeline.labels.messages import FILE, MessageLabel, are_false, read_labels
from advpipe.pipeline.misbehaviour.claim import Claim
from advpipe.pipeline.replay.v2x_drive import V2xDrive
from advpipe.pipeline.scenario.attacks import AttackSpec
from advpipe.stages.attack.request import AttackRequest
from advpipe.stages.evaluate.v2x.detection import detect, published_f1
from advpipe.stages.evaluate.v2x.receptions import read_receptions


def test_fewer_than_one_honest_message_in_a_hundred_is_flagged(boulevard: Path) -> None:
    receptions = read_receptions(BagReader(boulevard))
    found = detect(receptions)
    assert found.messages > 1000
    assert found.false_messages == 0
    assert found.ours.false_positive_rate < 0.01


def test_receptions_are_those_in_the_bag(smoke: Path) -> None:
    """Claims say where the true senders are, up to what they know of themselves."""
    (ego,) = read_receptions(BagReader(smoke))
    assert ego.listener == "ego"
    of_message = {}
    for step in V2xDrive(BagReader(smoke)).steps():
        radios = {radio.station_id: radio.map_SE3_base[:2, 3] for radio in step.radios}
        of_message |= {one.number: radios[one.station_id] for one in step.sent}
    off_m = [
        np.hypot(*(of_message[number] - (claim.x_m, claim.y_m)))
        for claim, number in zip(ego.claims, ego.numbers, strict=True)
    ]
    assert len(off_m) > 50
    assert np.median(off_m) < 2.0  # 0.5 m on each axis, and up to 0.2 s of driving
    own_m = [(r.x_m, r.y_m) for r in ego.receivers]
    assert len(set(own_m)) > 10


def test_offsets_are_found_out(smoke: Path, offset: Path) -> None:
    labels = read_labels(offset)
    reader = BagReader(offset)
    found = detect(read_receptions(reader), labels, published=published_f1(reader.provenance))
    assert found.attack == "cam-position-offset"
    assert 0 < found.false_messages < found.messages
    assert found.ours.recall > 0.7
    assert found.ours.precision > 0.7
    (part,) = found.parts
    assert (part.attack, part.false_messages, part.ours) == (
        "cam-position-offset",
        found.false_messages,
        found.ours,
    )
    assert part.published == 0.846
    assert found.ours.latency_s < 1.0
    assert sum(found.flagged_by_check.values()) >= found.ours.true_positives
    assert read_labels(smoke) == []


def test_a_false_message_is_one_that_mattered_and_was_sent() -> None:
    labels = [
        MessageLabel(1, "cam-speed-constant", "car", "changed", True, 0, 7),
        MessageLabel(2, "cam-speed-constant", "car", "changed", False, 0, 7),
        MessageLabel(3, "cam-drop", "car", "dropped", True, 0, 7),
    ]
    assert are_false([0, 1, 2, 3], labels).tolist() == [False, True, False, False]


def test_what_is_no_cam_is_found_by_the_decoder(smoke: Path) -> None:
    """An attacker's is a lie that is found; anybody else's is dropped, and counts for nothing."""
    (ego,) = read_receptions(BagReader(smoke))
    claims = list(ego.claims)
    for place in (5, 8):
        claims[place] = Claim(-1, claims[place].arrival_ns, claims[place].arrival_ns)
    label = MessageLabel(ego.numbers[5], "cam-speed-offset", "car", "corrupt", False, 0, 7)
    found = detect([replace(ego, claims=tuple(claims))], [label])
    assert (found.false_messages, found.undecoded) == (1, 1)
    assert found.flagged_by_check == {"decoding": 1}
    for each in (found.ours, found.baseline):
        assert each.true_positives == 1
        assert each.true_positives + each.false_positives + each.true_negatives == len(claims) - 1


def test_the_true_messages_of_attackers_are_not_those_of_innocent_stations(smoke: Path) -> None:
    """Of the messages of an attacker, one is false; of a station whose GPS is spoofed, all are innocent."""
    (ego,) = read_receptions(BagReader(smoke))
    of_station: dict[int, list[int]] = {}
    for one in ego.received:
        assert one.number is not None
        of_station.setdefault(one.station_id, []).append(one.number)
    (attacker, own), (victim, theirs) = list(of_station.items())[:2]
    labels = [
        MessageLabel(own[0], "cam-dos", "car", "added", True, 0, attacker),
        MessageLabel(theirs[0], "gnss-bias", "", "changed", False, 0, victim),
    ]
    found = detect([ego], labels)
    assert len(own) > 1
    assert found.false_messages == 1
    for each in (found.ours, found.baseline):
        assert each.innocent == len(ego.received) - len(own)
        assert each.false_positives + each.true_negatives == each.innocent + len(own) - 1


def test_each_attack_is_scored_without_the_false_messages_of_others(offset: Path) -> None:
    """A spoofed GPS in the same bag: one liar's messages are said to be its."""
    receptions, labels = read_receptions(BagReader(offset)), read_labels(offset)
    one = labels[0].station_id
    shared = [replace(label, attack="gnss-bias") if label.station_id == one else label for label in labels]
    whole, found = detect(receptions, labels), detect(receptions, shared)
    assert found.attack == "cam-position-offset + gnss-bias"
    assert (found.ours, found.baseline, found.false_messages) == (
        whole.ours,
        whole.baseline,
        whole.false_messages,
    )
    cam, gnss = found.parts
    assert (cam.attack, gnss.attack) == ("cam-position-offset", "gnss-bias")
    assert cam.false_messages + gnss.false_messages == whole.false_messages
    assert cam.ours.true_positives + gnss.ours.true_positives == whole.ours.true_positives
    assert cam.ours.false_positives == gnss.ours.false_positives == whole.ours.false_positives
    assert np.isnan(gnss.published)


def test_parts_of_a_mix_have_lines_of_their_own(offset: Path, tmp_path: Path) -> None:
    """The column `part` of the labels; without it there are none."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    table = pq.read_table(offset / FILE)
    parts = ["cam-position-offset" if number % 2 else "cam-delay" for number in range(len(table))]
    columns = dict(zip(table.column_names, table.columns, strict=True))
    mixed = pa.table(columns | {"attack": ["cam-mix"] * len(table), "part": parts})
    pq.write_table(mixed, tmp_path / FILE)
    published = {"cam-position-offset": 0.846, "cam-delay": 0.062}
    found = detect(read_receptions(BagReader(offset)), read_labels(tmp_path), published=published)
    parts = ["cam-mix", "cam-mix / cam-delay", "cam-mix / cam-position-offset"]
    assert [part.attack for part in found.parts] == parts
    assert [np.isnan(part.published) for part in found.parts] == [True, False, False]
    assert found.parts[0].ours == found.ours
    assert sum(part.false_messages for part in found.parts[1:]) == found.false_messages


@pytest.mark.parametrize(
    ("keys", "published"),
    [
        ({"type": "cam-speed-constant", "parameters": {"speed_mps": 0}}, {"cam-speed-constant": 0.907}),
        ({"type": "cam-speed-constant"}, {}),
        ({"type": "cam-delay"}, {}),
        ({"type": "cam-delay", "parameters": {"preset": "nextgen"}}, {"cam-delay": 0.062}),
        ({"type": "cam-dos", "parameters": {"preset": "nextgen"}}, {"cam-dos": 0.353}),
        ({"type": "cam-dos", "parameters": {"preset": "f2md"}}, {}),
        ({"type": "gnss-bias"}, {}),
        (
            {"type": "cam-mix", "parameters": {"attacks": "cam-drop,cam-speed-offset"}},
            {"cam-speed-offset": 0.637},
        ),
    ],
)
def test_published_figures(keys: dict[str, Any], published: dict[str, float]) -> None:
    """Of constant speeds, that of zero; of others that differ from ours, that of the preset.

    A bag of a version that did not declare them tells none.
    """
    attacks = AttackRequest((AttackSpec(**keys),)).resolved()
    assert published_f1(Provenance({"attacks": json.dumps(attacks)})) == published
    del attacks[0]["declared"]
    assert published_f1(Provenance({"attacks": json.dumps(attacks)})) == {}


def test_labels_that_are_none(tmp_path: Path) -> None:
    (tmp_path / FILE).write_bytes(b"no parquet")
    with pytest.raises(AdvpipeError, match="does not hold V2X message labels"):
        read_labels(tmp_path)
