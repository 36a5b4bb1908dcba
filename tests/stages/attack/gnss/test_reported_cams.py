"""Stations of which a bag holds CAMs only."""

from __future__ import annotations

import numpy as np
import pytest

from advpipe.pipeline.core.errors import AdvpipeError
from advpipe.pipeline.replay.recorded_filter import read_filter
from advpipe.pipeline.replay.v2x_drive import V2xDrive
from advpipe.pipeline.scenario.attacks import attack_spec
from advpipe.pipeline.v2x.facilities.cam_tree import decode_cam
from advpipe.stages.attack.gnss.change import spoof


@pytest.fixture(scope="module")
def station(drive) -> str:
    """Who sends the most CAMs of those without instruments."""
    count: dict[str, int] = {}
    for step in V2xDrive(drive).steps():
        vehicles = {radio.station_id: radio.vehicle for radio in step.radios}
        for one in step.sent:
            name = vehicles[one.station_id]
            count[name] = count.get(name, 0) + (name not in ("ego", "other"))
    return max(sorted(count), key=lambda name: count[name])


def cams(drive, spec: dict) -> list[tuple]:
    """The victim's CAMs before and after; all others have to stay."""
    made = spoof(drive, [attack_spec(spec)], 7)
    assert made.topics == frozenset()
    assert list(made.messages()) == []
    (editor,) = made.editors()
    pairs = []
    for step in V2xDrive(drive).steps():
        ids = {radio.station_id for radio in step.radios if radio.vehicle == spec["victim"]}
        for old, new in zip(step.sent, editor.edit(step, step.sent), strict=True):
            if old.station_id in ids:
                pairs.append((decode_cam(old.payload), decode_cam(new.payload)))
            else:
                assert old == new
    assert len(pairs) > 8
    return pairs


def test_the_position_is_off_and_all_else_is_as_it_was(drive, station):
    geodesy = read_filter(drive).geodesy
    spec = {"type": "gnss-relocate", "parameters": {"least_m": 100, "most_m": 100}, "victim": station}
    offsets = []
    for before, after in cams(drive, spec):
        places = [geodesy.to_map([cam.latitude_deg, cam.longitude_deg, 0]) for cam in (before, after)]
        offsets.append(places[1] - places[0])
        kept = [name for name in before.__slots__ if name not in ("latitude_deg", "longitude_deg")]
        old, new = ([getattr(cam, name) for name in kept] for cam in (before, after))
        assert str(old) == str(new)
    assert np.allclose(np.linalg.norm(np.array(offsets)[:, :2], axis=1), 100, atol=0.03)
    assert np.allclose(offsets, offsets[0], atol=0.03)  # to the rounding of a CAM


def test_jammed_they_tell_no_place(drive, station):
    for before, after in cams(drive, {"type": "gnss-jam", "victim": station}):
        assert after.latitude_deg is after.longitude_deg is after.semi_major_m is after.altitude_m is None
        assert after.speed_mps == before.speed_mps


def test_without_a_filter_there_is_none_to_be_aware_of(drive, station):
    with pytest.raises(AdvpipeError, match="has no filter in the bag to be aware of; attack an instrumented"):
        spoof(drive, [attack_spec({"type": "gnss-drift-aware", "victim": station})], 7)
