"""What a spoofed vehicle tells others."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from advpipe.pipeline.bag.reader import BagReader
from advpipe.pipeline.replay.v2x_drive import V2xDrive
from advpipe.pipeline.scenario.attacks import attack_spec
from advpipe.pipeline.v2x.codec.codec import decode_cam_tree, encode_cam_tree
from advpipe.pipeline.v2x.facilities.cam_tree import decode_cam
from advpipe.pipeline.v2x.facilities.ellipsoid import east_north_m
from advpipe.stages.attack.gnss.change import spoof
from advpipe.stages.attack.v2x.cams import with_fields


def edited(reader: BagReader, **spec) -> list[tuple]:
    """Each message before and after, the vehicle that sends it, and its step's begin."""
    made = spoof(reader, [attack_spec(spec)], 7)
    (editor,) = made.editors()
    assert editor.name == spec["type"]
    pairs = []
    for step in V2xDrive(reader).steps():
        vehicles = {radio.station_id: radio.vehicle for radio in step.radios}
        after = editor.edit(step, step.sent)
        pairs += [
            (old, new, vehicles[old.station_id], step.begin_ns)
            for old, new in zip(step.sent, after, strict=True)
        ]
    return pairs


def test_without_a_false_fix_they_come_out_to_the_bit(drive):
    """Filled anew from the first step on, path history included, and yet the bytes of the simulator."""
    pairs = edited(drive, type="gnss-drift", parameters={"rate_mps": 0}, victim="ego")
    own = [decode_cam(old.payload) for old, _, vehicle, _ in pairs if vehicle == "ego"]
    assert len(own) > 10
    assert sum(bool(cam.low_frequency and len(cam.low_frequency.path_history) > 1) for cam in own) >= 2
    assert all(old == new for old, new, _, _ in pairs)


def test_they_tell_the_false_estimate(drive):
    """Far away, with the bag's own odometry; others, and times of sending, stay."""
    spec = {
        "type": "gnss-relocate",
        "parameters": {"least_m": 100, "most_m": 100},
        "schedule": {"from_s": 4},
    }
    pairs = edited(drive, **spec, victim="ego")
    begin_ns = next(V2xDrive(drive).steps()).begin_ns
    changed = 0
    for old, new, vehicle, step_ns in pairs:
        assert (new.number, new.request_ns, new.key) == (old.number, old.request_ns, old.key)
        if vehicle != "ego" or step_ns < begin_ns + 4_000_000_000:
            assert new == old
            continue
        changed += 1
        before, after = decode_cam(old.payload), decode_cam(new.payload)
        fixed = ("station_id", "station_type", "generation_delta_time_ms", "length_m", "width_m")
        assert [getattr(before, name) for name in fixed] == [getattr(after, name) for name in fixed]
        assert (before.low_frequency is None) == (after.low_frequency is None)
    assert changed > 5
    last = [pair for pair in pairs if pair[2] == "ego"][-1]
    places = [decode_cam(one.payload) for one in last[:2]]
    away = east_north_m(*(value for cam in places for value in (cam.latitude_deg, cam.longitude_deg)))
    assert math.hypot(*away) > 60


def test_position_speed_and_heading_are_those_of_the_estimate(drive):
    made = spoof(drive, [attack_spec({"type": "gnss-drift", "parameters": {"rate_mps": 8}})], 7)
    (editor,), (victim,) = made.editors(), made.vehicles
    seen = 0
    for step in V2xDrive(drive).steps():
        (ego,) = (radio for radio in step.radios if radio.vehicle == "ego")
        for one in editor.edit(step, step.sent):
            if one.station_id != ego.station_id:
                continue
            cam, estimate = decode_cam(one.payload), victim.estimates[step.begin_ns]
            forward = estimate.map_SE3_base[:3, 0]
            front = estimate.map_SE3_base[:3, 3] + forward * ego.size_m[0] / 2
            geodesy = editor._geodesy
            spoofed = geodesy.to_map([cam.latitude_deg, cam.longitude_deg, cam.altitude_m])
            assert np.allclose(spoofed, front, atol=0.02)
            assert cam.speed_mps == pytest.approx(abs(estimate.base_velocity_mps[0]), abs=0.011)
            clockwise = math.pi / 2 - math.atan2(forward[1], forward[0])
            assert math.remainder(cam.heading_rad - clockwise, math.tau) == pytest.approx(0, abs=0.003)
            seen += 1
    assert seen > 10


def test_others_are_deceived(drive):
    """The map of `other` has `ego` where its CAMs say, through the scenario's radio."""

    def believed(editors) -> np.ndarray:
        recorded = V2xDrive(drive)
        channel, ids = recorded.channel(), {name: number for number, name in recorded.listeners.items()}
        for step in recorded.steps():
            sent = step.sent
            for editor in editors:
                sent = editor.edit(step, sent)
            recorded.send(channel, step, sent)
            end_ns = step.begin_ns
        entries = {one.report.station_id: one for one in channel.snapshot("other", end_ns).entries}
        return np.array(entries[ids["ego"]].report.centre_m)

    spec = {"type": "gnss-relocate", "parameters": {"least_m": 100, "most_m": 100}, "victim": "ego"}
    made = spoof(drive, [attack_spec({**spec, "schedule": {"from_s": 4}})], 7)
    assert np.linalg.norm(believed(made.editors()) - believed(())) > 60


def test_a_station_type_that_no_standard_names_stays(drive):
    """Of a bag in which the victim lies about other fields already."""
    (editor,) = spoof(drive, [attack_spec({"type": "gnss-drift", "victim": "ego"})], 7).editors()
    seen = 0
    for step in V2xDrive(drive).steps():
        odd = [
            replace(one, payload=encode_cam_tree(with_fields(decode_cam_tree(one.payload), station_type=200)))
            for one in step.sent
        ]
        for new in editor.edit(step, odd):
            seen += 1
            assert decode_cam(new.payload).station_type == 200
    assert seen > 10
