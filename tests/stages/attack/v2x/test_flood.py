from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from v2x_lane import context, decoded, edited, lane, radio, time_s

from advpipe.pipeline.core.errors import AdvpipeError
from advpipe.stages.attack.v2x.base import v2x_traits
from advpipe.stages.attack.v2x.flood import Dos, DosDisruptive, DosDisruptiveSybil, DosRandom, DosRandomSybil

DRIVE = lane({1: 0.0, 2: 50.0}, 40)
OWN = {one.number for step in DRIVE for one in step.sent}
ATTACK_CLASSES = (Dos, DosRandom, DosDisruptive, DosRandomSybil, DosDisruptiveSybil)


def added(attack, drive=DRIVE):
    return [one for one in edited(attack, drive) if one.number not in OWN]


@pytest.mark.parametrize("attack_class", ATTACK_CLASSES)
def test_flood_messages_are_evenly_spaced_beside_genuine_ones(attack_class):
    """50 Hz for 4 s: 200, of which those before anything was heard are missing."""
    after = edited(attack_class(context("cam-dos"), rate_hz=50.0), DRIVE)
    poured = [one for one in after if one.number not in OWN]
    assert [one for one in after if one.number in OWN] == [one for step in DRIVE for one in step.sent]
    assert {one.station_id for one in poured} == {1}
    assert set(np.diff([one.request_ns for one in poured]).tolist()) == {20_000_000}
    assert len(poured) == (200 if issubclass(attack_class, DosRandom) else 195)
    ids = {decoded(one)[0].station_id for one in poured}
    assert (len(ids) == len(poured) and not ids & {1, 2}) if attack_class.sybil else ids == {1}
    for one in poured:
        report = decoded(one)[1]
        assert -0.12 <= (report.generation_ns - one.request_ns) / 1e9 <= 0.001


def test_the_plausible_flood_extrapolates_the_motion():
    """Where it would be, had it driven on at 10 m/s since its last message, 10 ms after its state."""
    for one in added(Dos(context("cam-dos"), rate_hz=50.0)):
        report = decoded(one)[1]
        assert report.front_m[0] == pytest.approx(2.25 + 10 * (time_s(one.request_ns) - 0.01), abs=0.02)
        assert report.front_m[1] == pytest.approx(0, abs=0.02)
        assert (one.request_ns - report.generation_ns) / 1e6 == pytest.approx(10, abs=0.6)


def test_random_contents_are_within_their_limits():
    attack = DosRandom(context("cam-dos-random"), rate_hz=500.0, extent_m=100.0, speed_max_mps=20.0)
    offsets_m, speeds_mps, yaws_rad = [], [], []
    for one in added(attack):
        report = decoded(one)[1]
        step = DRIVE[int(time_s(one.request_ns) * 10 + 1e-6)]
        offsets_m.append(np.array(report.front_m[:2]) - step.radios[0].map_SE3_base[:2, 3])
        speeds_mps.append(report.speed_mps)
        yaws_rad.append(report.yaw_rad)
    assert np.abs(offsets_m).max() == pytest.approx(100, abs=1)
    assert np.abs(np.mean(offsets_m, axis=0)).max() < 4 * 100 / np.sqrt(3 * 2000)
    assert 0 <= min(speeds_mps) < 0.1
    assert 19.9 < max(speeds_mps) <= 20.01
    assert np.histogram(yaws_rad, 4, (-np.pi, np.pi))[0].min() > 400


def test_disruptive_contents_come_from_other_stations():
    for one in added(DosDisruptive(context("cam-dos-disruptive"), rate_hz=50.0)):
        front_m = decoded(one)[1].front_m[0] - 52.25
        assert front_m == pytest.approx(round(front_m), abs=0.02)
        assert 0 <= front_m < 10 * time_s(one.request_ns)


def test_it_floods_only_while_active_and_on_the_road():
    active = context("cam-dos", active=lambda time_ns: 1.0 <= time_s(time_ns) < 3.0)
    drive = lane({1: 0.0, 2: 50.0}, 40, leaves={1: 20})
    poured = added(DosRandom(active, rate_hz=50.0), drive)
    assert len(poured) == 50
    assert time_s(poured[0].request_ns) >= 1.0
    assert time_s(poured[-1].request_ns) < 2.0


def test_a_roadside_unit_floods_without_genuine_messages():
    unit = radio(3, 30.0, speed_mps=0.0)
    drive = [step._replace(radios=(*step.radios, unit)) for step in DRIVE]
    for attack_class in (DosRandom, DosDisruptive):
        assert not v2x_traits(attack_class).needs_traffic
        assert {one.station_id for one in added(attack_class(context("cam-dos", attackers=(3,))), drive)} == {
            3
        }


def test_a_flood_with_dcc_respects_the_interval():
    """On a free channel 60 ms: 66 or 67 in 4 s. What it sends itself keeps it at that, far below 19 %."""
    poured = added(DosRandom(context("cam-dos"), rate_hz=1000.0, dcc=True))
    assert set(np.diff([one.request_ns for one in poured]).tolist()) == {60_000_000}
    assert len(poured) in (66, 67)


def test_a_flood_with_dcc_slows_down_on_a_busy_channel():
    """A neighbour is on the air nine tenths of the time: after a second, one message each 0.46 s at most.

    Its CAMs of 48 bytes, with 82 around them, are 1040 bits and 22 more: 23 symbols of 48, and 5 ahead of
    them, each of 8 us: 224 us, which four thousand times a second take 0.896 of the time.
    """
    attack, times_s = DosRandom(context("cam-dos"), rate_hz=1000.0, dcc=True), []
    for step in lane({1: 0.0, 2: 50.0}, 30):
        cam = replace(step.sent[1], payload=bytes(48))
        loud = [replace(cam, request_ns=step.begin_ns + 250_000 * index) for index in range(400)]
        times_s += [time_s(one.request_ns) for one in attack.edit(step, loud) if one.station_id == 1]
    gaps_s = np.diff(times_s)
    assert gaps_s[0] == pytest.approx(0.06)
    assert gaps_s[-1] == pytest.approx(0.46)
    assert 15 <= sum(gaps_s < 0.061) <= 18


@pytest.mark.parametrize("rate_hz", [0, -1, 1e5, float("nan")])
def test_bad_parameters(rate_hz):
    with pytest.raises(AdvpipeError, match="cam-dos: rate_hz is"):
        Dos(context("cam-dos"), rate_hz=rate_hz)
