"""F2MD's numbers, as `MDAttack.cc` and `F2MDParameters.h` have them."""

from __future__ import annotations

import math

import numpy as np
import pytest
from published_attacks import ADDED, MANY, claims, presets, published
from v2x_lane import decoded, edited, lane, time_s

DRIVE = lane({1: 0.0, 2: 50.0, 3: -80.0}, 40)
FLEET = lane({number: 5.0 * number for number in MANY}, 3)
FRONT_M = 2.25


def fleet_speeds_mps(name):
    """Of the last message of each of many attackers."""
    sent = edited(published(name, "f2md", attackers=MANY), FLEET)
    return np.array(list({one.station_id: decoded(one)[0].speed_mps for one in sent}.values()))


def test_every_row_of_the_catalogue_has_a_preset():
    assert len(presets("f2md")) == 19
    assert all(one.remark for one in presets("f2md").values())


@pytest.mark.parametrize(("name", "places"), [("constant", 1), ("random", 40)])
def test_places_of_the_whole_road_network(road, name, places):
    found = claims(published(f"cam-position-{name}", "f2md", roads=road), DRIVE)
    at_m = np.array([report.front_m[:2] for _, report in found])
    assert len({tuple(np.round(place_m, 1)) for place_m in at_m}) == places
    assert (at_m >= [-100.1, -0.1]).all()
    assert (at_m <= [900.1, 9.1]).all()


def test_offsets_of_70_m_and_55_percent_to_the_east_and_south():
    moved_m = []
    for one in edited(published("cam-position-offset", "f2md", attackers=MANY), FLEET[:1]):
        report = decoded(one)[1]
        moved_m.append(np.array(report.front_m[:2]) - [FRONT_M + 5.0 * one.station_id, 0.0])
    east_m, south_m = np.array(moved_m).T * [[1], [-1]]
    for offset_m in (east_m, south_m):
        assert 31.4 < offset_m.min() < 45
        assert 95 < offset_m.max() < 108.6


def test_random_offsets_of_up_to_35_m():
    found = claims(published("cam-position-random-offset", "f2md"), lane({1: 0.0}, 200))
    moved_m = [np.abs(report.front_m[0] - FRONT_M - index) for index, (_, report) in enumerate(found)]
    assert 33 < max(moved_m) <= 35.1
    assert np.mean(moved_m) == pytest.approx(17.5, abs=2.5)


def test_speeds_are_of_vectors():
    """0 to 40 m/s along both axes: up to 56.6; 3.15 to 10.85 added to 10 m/s: 13.52 to 23.51."""
    for name in ("cam-speed-constant", "cam-speed-random"):
        assert 40 < fleet_speeds_mps(name).max() <= 56.6
    offset_mps = fleet_speeds_mps("cam-speed-offset")
    assert 13.5 <= offset_mps.min() < 16
    assert 19 < offset_mps.max() <= 23.6


def test_random_speed_offsets_have_random_signs_along_both_axes():
    """|10 +- e, s|, e and s from 3.15 to 10.85 m/s: 3.15 to 12.8 m/s, or 13.5 to 23.5 m/s."""
    found = claims(published("cam-speed-random-offset", "f2md"), lane({1: 0.0}, 200))
    speeds_mps = np.array([cam.speed_mps for cam, _ in found])
    assert 3.14 < speeds_mps.min() < 6
    assert 19 < speeds_mps.max() < 23.6
    assert not ((speeds_mps > 12.9) & (speeds_mps < 13.5)).any()
    assert np.mean(speeds_mps > 13) == pytest.approx(0.5, abs=0.1)


def test_a_stop_has_a_constant_probability_of_5_percent_and_55():
    """Of 40 attackers, 1 - 0.95^20 = 64 % stop in 20 messages."""
    drive = lane({number: 5.0 * number for number in MANY}, 20)
    attack = published("cam-eventual-stop", "f2md", attackers=MANY)
    probabilities = [*attack._probabilities.values()]
    assert 0.0224 < min(probabilities) < 0.035
    assert 0.065 < max(probabilities) < 0.0776
    stopped_s = {}
    for one in edited(attack, drive):
        if decoded(one)[0].speed_mps == 0:
            stopped_s.setdefault(one.station_id, time_s(one.request_ns))
    assert 17 <= len(stopped_s) <= 33
    assert sum(at_s < 1.0 for at_s in stopped_s.values()) >= 8


def test_it_stands_from_the_message_after_the_draw_on():
    found = claims(published("cam-eventual-stop", "f2md"), lane({1: 0.0}, 100, accelerations_mps2={1: 1.0}))
    stopped = [cam.speed_mps == 0 for cam, _ in found]
    first = stopped.index(True)
    assert stopped == [False] * first + [True] * (100 - first)
    place_m = found[first - 1][1].front_m  # that of the draw, which is still true
    assert place_m[0] == pytest.approx(FRONT_M + first - 1, abs=0.02)
    for cam, report in found[first:]:
        assert report.front_m == pytest.approx(place_m, abs=1e-6)
        assert cam.longitudinal_acceleration_mps2 == 0


def test_stale_messages_come_from_61_messages_ago_and_are_empty_before(road):
    found = claims(published("cam-stale", "f2md", roads=road), lane({1: 0.0}, 70))
    for cam, report in found[:61]:
        assert report.front_m[:2] == pytest.approx([-100, 9], abs=0.02)
        assert cam.speed_mps == 0
    for index, (cam, report) in enumerate(found[61:]):
        assert report.front_m[:2] == pytest.approx([FRONT_M + index, 0], abs=0.02)
        assert cam.speed_mps == 10


@pytest.mark.parametrize(
    ("name", "multiples"),
    [
        ("cam-dos", {2, 4}),
        ("cam-dos-random", {2, 4}),
        ("cam-dos-disruptive", {2, 4}),
        ("cam-dos-random-sybil", {2}),
        ("cam-dos-disruptive-sybil", {2}),
        ("cam-sybil-grid", {2, 6}),
    ],
)
def test_floods_divide_the_own_interval(name, multiples):
    """Of 0.1 s, from the second own message on."""
    fleet = lane({number: 5.0 * number for number in range(1, 9)}, 8)
    attack = published(name, "f2md", attackers=range(1, 9))
    assert set(attack.multiples.values()) == multiples
    sent = edited(attack, fleet)
    for attacker, multiple in attack.multiples.items():
        times_s = [time_s(one.request_ns) for one in sent if one.station_id == attacker]
        late = np.array([at_s for at_s in times_s if 0.345 <= at_s - 0.01 * attacker < 0.545])
        assert len(late) == 2 * multiple
        assert np.diff(late) == pytest.approx(0.1 / multiple, abs=1e-6)


def test_all_messages_of_a_flood_are_of_the_attack():
    """None of the attacker's own is left; those of others stay."""
    for name in ("cam-dos", "cam-dos-random", "cam-dos-random-sybil"):
        sent = edited(published(name, "f2md"), DRIVE)
        true = {one.number: one for step in DRIVE for one in step.sent}
        assert not [one for one in sent if one.station_id == 1 and true.get(one.number) == one]
        assert [one for one in sent if one.station_id != 1] == [
            one for step in DRIVE for one in step.sent if one.station_id != 1
        ]


def test_a_flood_moves_on():
    for cam, report in claims(published("cam-dos", "f2md"), DRIVE):
        at_s = time_s(report.generation_ns)
        assert report.front_m[0] == pytest.approx(FRONT_M + 10 * at_s, abs=0.03)
        assert cam.station_id == 1


def test_random_floods(road):
    found = claims(published("cam-dos-random-sybil", "f2md", roads=road), lane({1: 0.0}, 150))
    assert len({cam.station_id for cam, _ in found}) == len(found) > 250
    speeds_mps = [cam.speed_mps for cam, _ in found]
    accelerations_mps2 = [cam.longitudinal_acceleration_mps2 for cam, _ in found]
    assert 45 < max(speeds_mps) <= 56.6
    assert 2 < max(accelerations_mps2) <= 2.9
    assert min(accelerations_mps2) >= 0
    assert np.histogram([report.yaw_rad for _, report in found], 4, (-np.pi, np.pi))[0].min() > 40
    at_m = np.array([report.front_m[:2] for _, report in found])
    assert (at_m >= [-100.1, -0.1]).all()
    assert (at_m <= [900.1, 9.1]).all()


def test_disruptive_messages_are_any_of_the_last_20_of_a_station():
    """Stations 2 and 3 drive 50 m ahead and 80 m behind; 20 messages are two seconds."""
    drive = lane({1: 0.0, 2: 50.0, 3: -80.0}, 150)
    ages = {52.25: [], -77.75: []}
    for index, (cam, report) in enumerate(claims(published("cam-disruptive-replay", "f2md"), drive)[50:], 50):
        assert cam.station_id == 1
        start_m = 52.25 if report.front_m[0] > 10 * (index - 21) / 10 + 20 else -77.75
        ages[start_m].append(index - round(report.front_m[0] - start_m))
    assert min(map(len, ages.values())) > 30
    for found in ages.values():
        assert (min(found), max(found)) == (1, 20)


def test_replays_follow_the_nearest_station_closely_for_two_or_six_messages():
    attacks = [published("cam-replay", "f2md", attackers=range(1, 9))]
    lengths = {sequence._length for attack in attacks for sequence in attack.sequences.values()}
    assert lengths == {2, 6}
    attack = published("cam-replay", "f2md")
    length = attack.sequences[1]._length
    found = claims(attack, DRIVE)
    for index, (cam, report) in enumerate(found[1 : 1 + length], 1):  # nothing is heard before the first
        assert cam.station_id == 1
        assert report.front_m[0] == pytest.approx(52.25 + index - 1, abs=0.02)


def test_a_replaying_sybil_has_a_pseudonym_for_each_victim():
    sent = edited(published("cam-sybil-replay", "f2md"), lane({1: 0.0, 2: 50.0, 3: -80.0}, 120))
    own = [decoded(one) for one in sent if one.station_id == 1]
    assert len(own) == 120
    stations = [cam.station_id for cam, _ in own[1:]]
    assert 1 not in stations
    assert len(set(stations)) > 3
    is_ahead = [
        report.front_m[0] > 10 * (index - 21) / 10 + 20 for index, (_, report) in enumerate(own[1:], 1)
    ]
    changes = [index for index in range(1, 119) if stations[index] != stations[index - 1]]
    assert changes == [index for index in range(1, 119) if is_ahead[index] != is_ahead[index - 1]]


def test_the_grid_is_behind_the_victim_and_to_its_left():
    """Station 2, 4.5 x 1.8 m, is nearest; its gaps are 5 and 2 m, +- 55 %, and jitter by a tenth."""
    drive = lane({1: 0.0, 2: 50.0, 3: -80.0}, 30, accelerations_mps2={2: 2.0})
    attacks = [published("cam-sybil-grid", "f2md", seed=seed) for seed in range(8)]
    attack = next(one for one in attacks if one.multiples[1] == 6)
    length_m, width_m = attack._gaps_m[1]
    assert 2.25 <= length_m <= 7.75
    assert 0.9 <= width_m <= 3.1
    ghosts = {}
    for one in edited(attack, drive):
        if one.number >= ADDED and time_s(one.request_ns) > 1:
            cam, report = decoded(one)
            ghosts.setdefault(cam.station_id, []).append((cam, report, one))
    assert len(ghosts) == 5
    for place, found in enumerate(ghosts.values(), 1):
        row, column = (place + 1) // 2, (place + 1) % 2
        for cam, report, one in found:
            heard = int(time_s(one.request_ns) * 10 + 1e-6)
            victims_m = [FRONT_M + 50.0 + heard - late for late in (0, 1)]
            behind_m = min(victims_m, key=lambda x_m: abs(report.front_m[0] - x_m + row * (4.5 + length_m)))
            back_m = behind_m - report.front_m[0]
            assert back_m == pytest.approx(row * (4.5 + length_m), abs=length_m / 10 + 0.02)
            assert report.front_m[1] == pytest.approx(column * (1.8 + width_m), abs=width_m / 10 + 0.02)
            assert 1.89 <= cam.speed_mps <= 2.11  # the acceleration stands where the speed belongs
            assert abs(report.yaw_rad) < math.radians(1.01)


def test_ghost_vehicles_off_the_lanes_have_pseudonym_1(road):
    far = type(road)(road.segments_m + [0.0, 500.0], road.widths_m)
    sent = edited(published("cam-sybil-grid", "f2md", roads=far), DRIVE)
    assert {decoded(one)[0].station_id for one in sent if one.number >= ADDED} == {1}
