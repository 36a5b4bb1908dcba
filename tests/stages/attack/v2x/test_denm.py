"""Attacks on warnings (DENMs), in a drive of messages alone."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow.parquet as pq
import pytest

from advpipe.pipeline.bag.reader import BagReader
from advpipe.pipeline.core.errors import UsageError
from advpipe.pipeline.labels.messages import FILE
from advpipe.pipeline.messages.v2x import sent_of_message
from advpipe.pipeline.replay.v2x_drive import V2xDrive
from advpipe.pipeline.scenario import load_scenario
from advpipe.pipeline.scenario.attacks import attack_spec
from advpipe.pipeline.v2x.channel import Sent
from advpipe.pipeline.v2x.facilities.denm import Denm, EventKind, Termination, decode_denm
from advpipe.pipeline.v2x.message_type import is_cam
from advpipe.stages.attack.v2x.change import forge
from advpipe.stages.simulate.run import simulate


@pytest.fixture(scope="module")
def clean(tmp_path_factory: pytest.TempPathFactory) -> BagReader:
    settings = [
        "vehicles={}",
        "simulation.duration_s=3",
        "v2x.penetration=1",
        "v2x.denm={stopped_s: 0.3, braking_mps2: 2.0, time_to_collision_s: 3}",
    ]
    out = tmp_path_factory.mktemp("denm") / "drive"
    return BagReader(simulate(load_scenario("smoke", settings), out).bag)


def denms_of(messages: Sequence[Sent]) -> dict[int, Denm]:
    return {one.number: decode_denm(one.payload) for one in messages if not is_cam(one.payload)}


def attacked(
    clean: BagReader, folder: Path, name: str, **parameters: Any
) -> tuple[dict[int, Sent], dict[int, Sent], list[dict[str, Any]]]:
    """The messages before and after an attack, by number, and the labels."""
    spec = attack_spec({"type": name, "attackers": {"share": 0.2}, "parameters": parameters})
    change = forge(clean, [spec], 1)
    after = [sent_of_message(clean.decode(raw)) for raw in change.messages() if raw.topic.name == "/v2x/sent"]
    change.write_labels(folder)
    before = [sent_of_message(message) for _, message in clean.messages("/v2x/sent")]
    labels = pq.read_table(folder / FILE).to_pylist()
    return {one.number: one for one in before}, {one.number: one for one in after}, labels


def test_the_recorded_drive_has_events_of_several_kinds(clean: BagReader) -> None:
    messages = [sent_of_message(message) for _, message in clean.messages("/v2x/sent")]
    kinds = {denm.kind for denm in denms_of(messages).values()}
    assert len(kinds - {None}) >= 2


def test_false_events_are_announced_beside_the_true_messages(clean: BagReader, tmp_path: Path) -> None:
    before, after, labels = attacked(clean, tmp_path, "denm-false", distance_m=40, rate_hz=5)
    added = [after[number] for number in after.keys() - before.keys()]
    assert {number: after[number] for number in before} == before
    assert len(added) > 20
    assert {row["number"] for row in labels} == {one.number for one in added}
    assert {(row["action"], row["mattered"]) for row in labels} == {("added", True)}
    origin = V2xDrive(clean).origin
    for one in added:
        denm = decode_denm(one.payload)
        assert denm.kind is EventKind.BRAKING
        assert denm.action.station_id == denm.station_id == one.station_id
        assert abs((denm.latitude_deg or 0) - origin.latitude_deg) < 0.05
    times_ns = sorted(one.request_ns for one in added if one.station_id == added[0].station_id)
    assert set(np.diff(times_ns)) == {200_000_000}


@pytest.mark.parametrize("mode", ["negate", "cancel"])
def test_events_of_others_are_ended(clean: BagReader, tmp_path: Path, mode: str) -> None:
    before, after, labels = attacked(clean, tmp_path, "denm-suppress", mode=mode)
    added = [after[number] for number in after.keys() - before.keys()]
    assert len(added) > 20
    assert {number: after[number] for number in before} == before
    true_events = {denm.action for denm in denms_of(list(before.values())).values()}
    for one in added:
        denm = decode_denm(one.payload)
        assert denm.action in true_events
        assert denm.action.station_id != one.station_id
        own = denm.station_id == one.station_id
        assert (denm.termination is Termination.NEGATION) == own == (mode == "negate")
    assert len(labels) == len(added)
    assert len({one.station_id for one in added}) > 3


def test_stations_do_not_warn_at_the_same_nanosecond(clean: BagReader, tmp_path: Path) -> None:
    for name in ("denm-false", "denm-suppress"):
        folder = tmp_path / name
        folder.mkdir()
        _, after, labels = attacked(clean, folder, name)
        senders: dict[int, set[int]] = {}
        for number in denms_of(list(after.values())):
            senders.setdefault(after[number].request_ns, set()).add(after[number].station_id)
        assert len(labels) > 20
        assert not [time_ns for time_ns, stations in senders.items() if len(stations) > 1]


def test_baselines_send_as_many_denms_elsewhere(clean: BagReader, tmp_path: Path) -> None:
    added = {}
    for name, parameters in (
        ("denm-false", {}),
        ("denm-false", {"place": "random"}),
        ("denm-suppress", {}),
        ("denm-suppress", {"choice": "random"}),
    ):
        folder = tmp_path / str(len(added))
        folder.mkdir()
        before, after, _ = attacked(clean, folder, name, **parameters)
        new = sorted((after[number] for number in after.keys() - before.keys()), key=lambda one: one.number)
        added[name, bool(parameters)] = [(one.request_ns, decode_denm(one.payload)) for one in new]
    for name in ("denm-false", "denm-suppress"):
        aimed, blind = added[name, False], added[name, True]
        assert [time_ns for time_ns, _ in aimed] == [time_ns for time_ns, _ in blind]
    places = [
        [(denm.latitude_deg, denm.longitude_deg) for _, denm in added["denm-false", one]] for one in (0, 1)
    ]
    assert not set(places[0]) & set(places[1])
    ended = [[denm.action for _, denm in added["denm-suppress", one]] for one in (0, 1)]
    assert ended[0] != ended[1]
    assert set(ended[1]) <= {denm.action for denm in denms_of(list(before.values())).values()}
    with pytest.raises(UsageError, match="mode 'drop' ends none"):
        attacked(clean, tmp_path, "denm-suppress", choice="random", mode="drop")


def test_an_attacker_keeps_its_own_warnings_to_itself(clean: BagReader, tmp_path: Path) -> None:
    before, after, labels = attacked(clean, tmp_path, "denm-suppress", mode="drop")
    dropped = before.keys() - after.keys()
    attackers = {row["station_id"] for row in labels}
    assert dropped == {row["number"] for row in labels}
    assert dropped == {
        number for number in denms_of(list(before.values())) if before[number].station_id in attackers
    }
    assert {row["action"] for row in labels} == {"dropped"}


def test_attacks_on_cams_leave_denms_alone(clean: BagReader, tmp_path: Path) -> None:
    before, after, labels = attacked(clean, tmp_path, "cam-drop")
    denms = denms_of(list(before.values()))
    assert len(labels) > 20
    assert not {row["number"] for row in labels} & denms.keys()
    assert {number: after[number] for number in denms} == {number: before[number] for number in denms}


def test_an_unknown_kind_is_refused(clean: BagReader) -> None:
    with pytest.raises(UsageError, match="kind"):
        forge(clean, [attack_spec({"type": "denm-false", "parameters": {"kind": "flood"}})], 1)
