"""Labels of delayed and dropped messages, and of ghost vehicles."""

from __future__ import annotations

from collections import Counter

import pyarrow.parquet as pq
import pytest

from advpipe.pipeline.labels.messages import FILE
from advpipe.pipeline.replay.v2x_drive import V2xDrive
from advpipe.pipeline.scenario.attacks import attack_spec
from advpipe.stages.attack.v2x.change import forge


def rows_of(reader, folder, name, **keys):
    change = forge(reader, [attack_spec({"type": name, **keys})], 1)
    change.write_labels(folder)
    return pq.read_table(folder / FILE).to_pylist()


def sent_by(reader, stations):
    return [one for step in V2xDrive(reader).steps() for one in step.sent if one.station_id in stations]


def test_delayed_messages_are_labelled(recorded, tmp_path):
    """Half a second late each; what would leave after the end is never sent."""
    reader = recorded()
    parameters = {"delay_min_s": 0.5, "delay_max_s": 0.5}
    rows = rows_of(reader, tmp_path, "cam-delay", parameters=parameters, attackers={"share": 0.3})
    own = sent_by(reader, {row["station_id"] for row in rows})
    assert sorted(row["number"] for row in rows) == [one.number for one in own]
    actions = Counter(row["action"] for row in rows)
    assert set(actions) == {"delayed", "dropped"}
    for row in rows:
        if row["action"] == "dropped":
            assert (row["sent_ns"], row["false_x_m"], row["mattered"]) == (None, None, True)
            continue
        assert row["sent_ns"] - row["time_ns"] == 500_000_000
        newest = [
            one for one in own if one.station_id == row["station_id"] and one.request_ns <= row["sent_ns"]
        ][-1]
        is_news = newest.number != row["number"]
        moved_m = abs(row["true_x_m"] - row["false_x_m"]) + abs(row["true_y_m"] - row["false_y_m"])
        assert is_news or moved_m == 0
        if moved_m > 1.5:  # 1.06 m along the diagonal
            assert row["mattered"]
    assert {row["mattered"] for row in rows if row["action"] == "delayed"} == {True, False}


def test_labels_of_ghost_vehicles_have_no_true_values(recorded, tmp_path):
    rows = rows_of(recorded(), tmp_path, "cam-sybil-grid", victim="ego")
    assert rows
    for row in rows:
        assert (row["action"], row["true_x_m"], row["true_speed_mps"]) == ("added", None, None)
        assert row["mattered"]
        assert row["false_station_id"] != row["station_id"]
        assert row["false_x_m"] is not None


def test_a_share_of_attackers_excludes_instrumented_vehicles(recorded, tmp_path):
    """Of 40 stations or so, three tenths are attackers: rounded, and never the ego vehicle."""
    reader = recorded()
    drive = V2xDrive(reader)
    parameters = {"length_m": 5.0}
    rows = rows_of(reader, tmp_path, "cam-dimensions", parameters=parameters, attackers={"share": 0.3})
    talking = {one.station_id for one in sent_by(reader, set(drive.stations))}
    attackers = {row["station_id"] for row in rows}
    assert not attackers & set(drive.listeners)
    assert len(attackers) == pytest.approx(
        0.3 * len(drive.stations), abs=0.5 + len(drive.stations) - len(talking)
    )
    twice = rows_of(reader, tmp_path, "cam-heading-reversed", attackers={"share": 0.3})
    assert {row["station_id"] for row in twice} == attackers  # the same for each attack
    other = rows_of(reader, tmp_path, "cam-dimensions", seed_name="b", attackers={"share": 0.3})
    assert {row["station_id"] for row in other} != attackers
