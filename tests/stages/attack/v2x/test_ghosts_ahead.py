from __future__ import annotations

import numpy as np
import pytest
from v2x_lane import BEGIN_NS, STEP_NS, context, decoded, edited, lane, time_s

from advpipe.pipeline.core.errors import AdvpipeError
from advpipe.stages.attack.v2x.ghosts_ahead import GhostBrake, GhostStop

GAP_M = 2 + 10 + 10**2 / (2 * 6)
"""Margin, a second of reaction, braking at 6 m/s2: 20.33 m from the victim's front to the ghost's rear."""


def ghosts(attack, drive):
    return [one for one in edited(attack, drive) if one.number >= 10**6]


def test_the_ghost_vehicle_stands_at_the_safety_distance():
    """The victim's front is at 50 + 2.25 m; the ghost vehicle's own is 4.5 m beyond its rear."""
    messages = ghosts(GhostStop(context("cam-ghost-stop", victim=2)), lane({1: 0.0, 2: 50.0}, 20))
    assert {one.station_id for one in messages} == {1}
    assert len({decoded(one)[0].station_id for one in messages} - {1, 2}) == 1
    for one in messages:
        cam, report = decoded(one)
        assert report.front_m == pytest.approx((52.25 + GAP_M + 4.5, 0, 0), abs=0.02)
        assert (cam.speed_mps, cam.longitudinal_acceleration_mps2) == (0, 0)
        assert report.yaw_rad == pytest.approx(0, abs=0.002)


def test_the_path_of_a_standing_ghost_vehicle_is_the_way_of_its_target():
    """After 5 s the victim has come from 50 to 100 m, where it switches the ghost vehicle on: that one stands
    22.58 m ahead of the victim's front, of which it has braked 1.67 s for 8.33 m, and driven 1.43 s before,
    in whole steps of 0.1 s; before that, it was where the victim was, 3.1 s earlier."""
    drive = lane({1: 0.0, 2: 50.0}, 60)
    attack = GhostStop(
        context("cam-ghost-stop", victim=2, active=lambda time_ns: time_ns >= BEGIN_NS + 5 * 10**9)
    )
    cam, report = decoded(ghosts(attack, drive)[0])
    path = cam.low_frequency.path_history
    east_m = sum(point.delta_longitude_deg for point in path) * 111_320 * np.cos(np.radians(48))
    assert east_m == pytest.approx(52.25 - (102.25 + GAP_M + 4.5), abs=0.3)
    assert sum(point.delta_latitude_deg for point in path) * 111_000 == pytest.approx(0, abs=0.1)
    assert report.generation_ns / 1e9 - sum(point.delta_time_s for point in path) == pytest.approx(
        BEGIN_NS / 1e9 - 3.1, abs=0.011 * len(path)
    )


def test_a_standing_ghost_vehicle_sends_at_the_lowest_rate():
    """First 0.1 to 0.2 s after it came; that interval holds for three CAMs more, and then the longest."""
    messages = ghosts(GhostStop(context("cam-ghost-stop", victim=2)), lane({1: 0.0, 2: 0.0}, 22))
    assert 0.1 <= time_s(messages[0].request_ns) < 0.2
    assert np.diff([one.request_ns for one in messages]).tolist() == [2 * 10**8] * 3 + [10**9]
    assert decoded(messages[0])[0].low_frequency is not None


def test_a_passed_ghost_vehicle_is_replaced_by_another_ahead():
    """The ghost vehicle's middle is 22.58 m ahead of the victim's front, which is there after 2.26 s."""
    drive = lane({1: 0.0, 2: 0.0}, 45)
    messages = ghosts(GhostStop(context("cam-ghost-stop", victim=2)), drive)
    first, second = dict.fromkeys(decoded(one)[0].station_id for one in messages)
    starts_m = {decoded(one)[0].station_id: decoded(one)[1].front_m[0] for one in messages}
    assert starts_m[second] - starts_m[first] == pytest.approx(10 * 2.3, abs=0.02)


def test_ghost_vehicles_appear_only_ahead_of_moving_targets():
    slow = [
        step._replace(
            radios=tuple(radio._replace(velocity_mps=radio.velocity_mps * 0.2) for radio in step.radios)
        )
        for step in lane({1: 0.0, 2: 50.0}, 20)
    ]
    assert ghosts(GhostStop(context("cam-ghost-stop", victim=2)), slow) == []
    assert ghosts(GhostStop(context("cam-ghost-stop", victim=2), from_speed_mps=2.0), slow)


def test_without_a_victim_each_attacker_is_a_target():
    messages = ghosts(GhostStop(context("cam-ghost-stop", attackers=(1, 2))), lane({1: 0.0, 2: 50.0}, 15))
    fronts_m = {one.station_id: decoded(one)[1].front_m[0] for one in messages}
    assert fronts_m == pytest.approx({1: 2.25 + GAP_M + 4.5, 2: 52.25 + GAP_M + 4.5}, abs=0.02)


def test_the_nearest_attacker_sends_and_another_takes_over():
    drive = lane({1: 0.0, 3: 90.0, 2: 50.0}, 40, leaves={3: 10})
    messages = ghosts(GhostStop(context("cam-ghost-stop", attackers=(1, 3), victim=2)), drive)
    senders = [one.station_id for one in messages if time_s(one.request_ns) < 2.0]
    assert (senders[0], senders[-1]) == (3, 1)
    assert len({decoded(one)[0].station_id for one in messages if time_s(one.request_ns) < 2.0}) == 1


def test_the_braking_ghost_vehicle_moves_as_claimed():
    """At the victim's 10 m/s, 10 m ahead, for 2 s; then at 8 m/s2, for 1.25 s and 6.25 m, and stands."""
    drive = lane({1: 0.0, 2: 0.0}, 34)
    messages = [decoded(one) for one in ghosts(GhostBrake(context("cam-ghost-brake", victim=2)), drive)]
    times_s = [time_s(report.generation_ns) for _, report in messages]
    fronts_m = [report.front_m[0] - (2.25 + 10 + 4.5) for _, report in messages]
    for (cam, _), at_s, front_m in zip(messages, times_s, fronts_m, strict=True):
        braking_s = min(max(at_s - 2, 0), 1.25)
        way_m = 10 * (min(at_s, 2) + braking_s) - 4 * braking_s**2
        assert front_m == pytest.approx(way_m, abs=0.02)
        assert cam.speed_mps == pytest.approx(10 - 8 * braking_s, abs=0.011)
        assert cam.longitudinal_acceleration_mps2 == (-8 if 2 <= at_s < 3.25 else 0)
    assert fronts_m[-1] == pytest.approx(26.25, abs=0.02)
    # 4 m at 10 m/s: in 0.4 to 0.5 s; while it brakes, it loses 0.5 m/s in less than a tenth of a second.
    cruising = np.diff([at_s for at_s in times_s if 0.8 < at_s < 2])
    assert set(np.round(cruising, 1)) <= {0.4, 0.5}
    assert set(np.round(np.diff([at_s for at_s in times_s if 2.05 < at_s < 3.25]), 1)) == {0.1}


@pytest.mark.parametrize("ahead_s", [0.0, 0.8])
def test_generation_times_ahead(ahead_s):
    messages = ghosts(
        GhostStop(context("cam-ghost-stop", victim=2), ahead_s=ahead_s), lane({1: 0.0, 2: 0.0}, 20)
    )
    for one in messages:
        begin_ns = BEGIN_NS + (one.request_ns - BEGIN_NS) // STEP_NS * STEP_NS
        assert decoded(one)[1].generation_ns - begin_ns == ahead_s * 1e9


def test_bad_parameters():
    with pytest.raises(AdvpipeError, match="cam-ghost-stop: deceleration_mps2 is 0; it takes a number"):
        GhostStop(context("cam-ghost-stop"), deceleration_mps2=0)
