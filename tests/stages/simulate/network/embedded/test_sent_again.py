"""The bag alone is enough: sent again from it, a drive's messages meet the same fates to the bit."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Sequence
from dataclasses import replace

import pytest
from pydantic import TypeAdapter

from advpipe.pipeline.bag.reader import BagReader
from advpipe.pipeline.bag.receptions import RecordedReception, recorded_receptions
from advpipe.pipeline.localisation.geodesy import Geodesy
from advpipe.pipeline.messages.ldm import ldm_snapshot_cdr
from advpipe.pipeline.messages.topics import V2X_SENT, V2X_STATISTICS, VehicleTopics
from advpipe.pipeline.replay.v2x_drive import V2xDrive
from advpipe.pipeline.v2x.channel import Channel, Received, Sent
from advpipe.pipeline.v2x.statistics import Statistics

Record = Callable[..., BagReader]
Change = Callable[[Sequence[Sent]], Sequence[Sent]]

RICHEST = "two listeners, all equipped, everything on"
DRIVES = {
    "one listener": ("simulation.duration_s=3",),
    RICHEST: (
        "simulation.duration_s=2",
        "simulation.step_s=0.05",
        "vehicles={ego: {}, other: {}}",
        "v2x.penetration=1",
        "v2x.cam.dcc=adaptive",
        "v2x.radio.building_loss=obstacles",
        "v2x.radio.vehicle_loss=knife_edge",
        "v2x.radio.shadowing.correlation_distance_m=20",
        "v2x.radio.processing_delay_min_s=0.02",
        "v2x.radio.processing_delay_max_s=0.15",
        "v2x.ldm.rate_hz=5",
    ),
    "a jammed channel": (
        "simulation.duration_s=3",
        "v2x.penetration=1",
        "v2x.radio.bitrate_mbps=3",
        "v2x.radio.overhead_bytes=2000",
        "v2x.radio.queue_delay_max_s=0.004",
        "v2x.cam={position_m: 0, speed_mps: 0, dcc: none}",
    ),
    "no other station": ("v2x.penetration=0",),
}


def send_again(
    reader: BagReader, change: Change = lambda sent: sent
) -> tuple[list[Received], dict[tuple[str, int], bytes], Statistics]:
    """Receptions, maps by listener and time, and the sum."""
    drive, received, maps = V2xDrive(reader), [], {}
    channel = drive.channel()
    for step in drive.steps():
        for listener in drive.listeners.values():
            maps[listener, step.begin_ns] = ldm_snapshot_cdr(channel.snapshot(listener, step.begin_ns))
        received += drive.send(channel, step, change(step.sent)).received
    return received, maps, channel.statistics()


@pytest.mark.parametrize(
    "settings",
    [
        pytest.param(settings, id=name, marks=[] if name == RICHEST else [pytest.mark.nightly])
        for name, settings in DRIVES.items()
    ],
)
def test_retransmission_gives_the_same_receptions_maps_and_statistics(
    drive: Record, settings: tuple[str, ...]
) -> None:
    reader = drive(*settings)
    received, maps, statistics = send_again(reader)
    by_listener = defaultdict(list)
    for one in received:
        sent, how = one.sent, (one.power_dbm, one.sinr_db)
        by_listener[one.listener].append(
            RecordedReception(one.arrival_ns, sent.payload, *how, sent.number, sent.station_id)
        )
    listeners = V2xDrive(reader).listeners.values()
    for listener in listeners:
        topics = VehicleTopics(listener)
        assert recorded_receptions(reader, listener) == by_listener[listener]
        recorded = list(reader.raw_messages([topics.ldm.name]))
        assert recorded
        assert all(maps[listener, raw.log_time_ns] == raw.cdr for raw in recorded)
    assert bool(received) == ("v2x.penetration=0" not in settings)
    ((_, message),) = reader.messages(V2X_STATISTICS.name)
    assert TypeAdapter(Statistics).validate_json(message.data) == statistics


def test_any_station_can_listen(drive: Record) -> None:
    """Those that record nothing hear what they would have heard; who records hears the same again."""
    reader = drive(*DRIVES[RICHEST])
    recorded = V2xDrive(reader)
    heard = defaultdict(list)
    for step, received in recorded.sent_again(recorded.stations):
        for one in received:
            assert step.end_ns is None or one.arrival_ns <= step.end_ns
            heard[one.listener].append((one.arrival_ns, one.sent.number))
    assert len(heard) == len(recorded.stations) > 10
    for listener in ("ego", "other"):
        recorded = recorded_receptions(reader, listener)
        assert heard[listener] == [(one.arrival_ns, one.number) for one in recorded]
    assert not any(received for _, received in V2xDrive(reader).sent_again(()))


def test_buildings_reduce_receptions(drive: Record) -> None:
    """Those that stand in the drive's world; without them, more arrives."""
    reader = drive(*DRIVES[RICHEST])
    with_buildings = send_again(reader)[2]
    recorded = V2xDrive(reader)
    channel = Channel(recorded.v2x, recorded.seed, Geodesy(48.1351, 11.582, 520.0), recorded.listeners, None)
    for step in recorded.steps():
        recorded.send(channel, step, step.sent)
    without = channel.statistics()
    assert without.pairs == with_buildings.pairs
    assert without.outcomes["received"] > 1.02 * with_buildings.outcomes["received"]


def test_the_jammed_channel_is_overloaded(drive: Record) -> None:
    statistics = send_again(drive(*DRIVES["a jammed channel"]))[2]
    assert statistics.dropped > 10
    assert statistics.outcomes["interference"] + statistics.outcomes["busy"] > 100
    assert max(statistics.busy_max) > 0.6


@pytest.mark.parametrize("settings", DRIVES.values(), ids=DRIVES)
def test_statistics_count_every_sent_message(drive: Record, settings: tuple[str, ...]) -> None:
    """Also those that are still waiting, or on the air, when the recording ends."""
    reader = drive(*settings)
    ((_, message),) = reader.messages(V2X_STATISTICS.name)
    statistics = TypeAdapter(Statistics).validate_json(message.data)
    assert statistics.cams + statistics.dropped == reader.topics[V2X_SENT.name].count
    numbers = [message.number for _, message in reader.messages(V2X_SENT.name)]
    assert numbers == list(range(len(numbers)))


def test_false_messages_do_not_change_outcomes_of_others(drive: Record) -> None:
    """One station sends false messages and another invalid ones: all other messages arrive as before."""
    reader = drive(*DRIVES["one listener"])
    before, _, _ = send_again(reader)
    senders = sorted({one.sent.station_id for one in before})
    attacker, broken = senders[0], senders[1]

    def change(sent: Sequence[Sent]) -> list[Sent]:
        changed = []
        for one in sent:
            if one.station_id == attacker:
                one = replace(one, payload=one.payload[:2] + bytes(4) + one.payload[6:])
            elif one.station_id == broken:
                one = replace(one, payload=b"\xff" * len(one.payload))
            changed.append(one)
        return changed

    after, _, _ = send_again(reader, change)
    assert [(one.sent.number, one.arrival_ns, one.sinr_db) for one in after] == [
        (one.sent.number, one.arrival_ns, one.sinr_db) for one in before
    ]
    kept = [(one.sent, one.verdict) for one in after if one.sent.station_id not in (attacker, broken)]
    assert kept == [
        (one.sent, one.verdict) for one in before if one.sent.station_id not in (attacker, broken)
    ]
    assert {
        one.tree["header"]["stationID"] for one in after if one.sent.station_id == attacker and one.tree
    } == {0}
    assert all(one.tree is None for one in after if one.sent.station_id == broken)
