"""Implausible messages are refused when they are read, with topic, time and the reason."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from advpipe.pipeline.bag.reader import BagReader
from advpipe.pipeline.bag.writer import BagWriter
from advpipe.pipeline.core.errors import AdvpipeError
from advpipe.pipeline.messages import build
from advpipe.pipeline.messages.message_bounds import implausibility
from advpipe.pipeline.messages.topics import V2X_SENT, V2X_STATIONS, VehicleTopics
from advpipe.pipeline.messages.v2x import RadioPlace, received_messages, sent_message, stations_message
from advpipe.pipeline.v2x.channel import Received, Sent
from advpipe.pipeline.v2x.facilities.ldm import Verdict

EGO = VehicleTopics("ego")
PLACE = RadioPlace(7, "car_7", np.eye(4), (4.0, 2.0, 1.5), np.zeros(3))
ODD = [float("nan"), float("inf"), -float("inf"), 1e300]


def decoded(stamped: tuple[Any, bytes, int], path: Path) -> tuple[BagReader, Any]:
    topic, cdr, stamp_ns = stamped
    with BagWriter(path, provenance={}) as bag:
        bag.write_cdr(topic, cdr, stamp_ns)
    reader = BagReader(path)
    (raw,) = reader.raw_messages()
    return reader, reader.decode(raw)


def test_valid_messages_are_accepted(tmp_path: Path, record: Callable[..., Path]) -> None:
    decoded(stations_message(5, [PLACE]), tmp_path / "stations")
    decoded(sent_message(Sent(1, 2, 7, 5, b"abc", 23.0)), tmp_path / "sent")
    reader = BagReader(record(tmp_path / "bag"))
    assert [reader.decode(raw) for raw in reader.raw_messages()]


@pytest.mark.parametrize("value", ODD)
@pytest.mark.parametrize("field", ["x_m", "size_m", "velocity_mps", "turn"])
def test_implausible_stations_are_refused(tmp_path: Path, field: str, value: float) -> None:
    _, message = decoded(stations_message(5, [PLACE]), tmp_path / "bag")
    (station,) = message.stations
    part = {
        "x_m": station.pose.position,
        "size_m": station.size,
        "velocity_mps": station.velocity,
        "turn": station.pose.orientation,
    }[field]
    part.x = value
    assert implausibility(V2X_STATIONS.name, V2X_STATIONS.type, message)


def test_duplicate_stations_and_invalid_rotations_are_refused(tmp_path: Path) -> None:
    for places in (
        [PLACE, PLACE],
        [PLACE, PLACE._replace(station_id=8)],
        [PLACE, PLACE._replace(vehicle="x")],
    ):
        with pytest.raises(AdvpipeError, match=r"/v2x/stations at 5 ns has the station .* twice"):
            decoded(stations_message(5, places), tmp_path / f"bag{len(list(tmp_path.iterdir()))}")
    _, message = decoded(stations_message(5, [PLACE]), tmp_path / "bag")
    turn = message.stations[0].pose.orientation
    turn.x = turn.y = turn.z = turn.w = 0.0
    assert "is not a rotation" in implausibility(V2X_STATIONS.name, V2X_STATIONS.type, message)


@pytest.mark.parametrize(
    ("sent", "what"),
    [
        (Sent(2**63, 1, 7, 5, b"", 23.0), "the number 9223372036854775808"),
        (Sent(1, 1, 7, 5, b"", float("nan")), "the power nan"),
        (Sent(1, 1, 7, 5, b"", 1e9), "the power 1e"),
        (Sent(1, 1, 7, 5, bytes(70_000), 23.0), "a payload of 70000 bytes"),
    ],
)
def test_implausible_transmissions_are_refused(tmp_path: Path, sent: Sent, what: str) -> None:
    with pytest.raises(AdvpipeError, match=f"a message of /v2x/sent at 5 ns has {what}"):
        decoded(sent_message(sent), tmp_path / "bag")


def received(**changes: Any) -> list[Any]:
    """The packet, how it arrived and what it truly was."""
    sent = Sent(changes.pop("number", 1), 1, 7, 5, changes.pop("payload", b""), 23.0)
    reception = {"power_dbm": -70.0, "sinr_db": 20.0} | changes
    one = Received("ego", sent, None, 6, verdict=Verdict.CORRUPT, **reception)
    return list(received_messages(one))


@pytest.mark.parametrize(
    ("place", "changes", "what"),
    [
        (0, {"payload": bytes(70_000)}, "/ego/v2x/rx/raw at 6 ns has a payload of 70004 bytes"),
        (1, {"power_dbm": float("inf")}, "/ego/v2x/rx/info at 6 ns has the power or SINR inf"),
        (1, {"sinr_db": -1e9}, "/ego/v2x/rx/info at 6 ns has the power or SINR -1e"),
        (2, {"number": 2**63}, "/ego/ground_truth/receptions at 6 ns has the number 9223372036854775808"),
    ],
)
def test_implausible_receptions_are_refused(
    tmp_path: Path, place: int, changes: dict[str, Any], what: str
) -> None:
    with pytest.raises(AdvpipeError, match=f"a message of {what}"):
        decoded(received(**changes)[place], tmp_path / "bag")


def test_a_reception_without_power_or_sinr_is_accepted(tmp_path: Path) -> None:
    nan = float("nan")
    _, message = decoded(received(power_dbm=nan, sinr_db=nan)[1], tmp_path / "bag")
    assert np.isnan([message.power_dbm, message.sinr_db]).all()


def test_another_type_on_a_known_topic_is_refused(tmp_path: Path) -> None:
    from dataclasses import replace

    topic = replace(V2X_SENT, type="std_msgs/msg/String")
    with BagWriter(tmp_path / "bag", provenance={}) as bag:
        bag.write(topic, build.string("x"), 5)
    reader = BagReader(tmp_path / "bag")
    with pytest.raises(
        AdvpipeError, match="is a std_msgs/msg/String, not a advpipe_msgs/msg/V2xTransmission"
    ):
        list(reader.messages(V2X_SENT.name))


def test_a_fix_without_a_position_is_accepted() -> None:
    for latitude, expected in ((float("nan"), ""), (1e9, "has the latitude"), (48.0, "")):
        fix = build.nav_sat_fix(5, latitude, 11.0, 500.0)
        assert implausibility("/ego/gnss/fix", EGO.gnss_fix.type, fix).startswith(expected)
        assert bool(implausibility("/ego/gnss/fix", EGO.gnss_fix.type, fix)) == bool(expected)


def test_long_names_are_refused(tmp_path: Path) -> None:
    long = RadioPlace(7, "x" * 1_000_000, *PLACE[2:])
    with pytest.raises(AdvpipeError, match="a station's name of 1000000 characters"):
        decoded(stations_message(5, [long]), tmp_path / "long")
    with pytest.raises(AdvpipeError, match="a station's name with a NUL"):
        decoded(stations_message(5, [PLACE._replace(vehicle="a\0b")]), tmp_path / "nul")
