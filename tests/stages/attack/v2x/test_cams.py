from __future__ import annotations

import math

import pytest
from one_attacker import genuine

from advpipe.pipeline.v2x.codec.cam_error import CamError
from advpipe.pipeline.v2x.codec.codec import decode_cam_tree
from advpipe.pipeline.v2x.facilities.cam_tree import cam_of_tree
from advpipe.pipeline.v2x.facilities.cam_values import FIELDS, values
from advpipe.stages.attack.v2x.cams import CamEditor, field_of, with_fields

OTHER = {"heading_rad": None, "speed_mps": math.inf, "acceleration_control": None, "yaw_rate_radps": 0.5}


@pytest.mark.parametrize("fields", [{}, OTHER])
def test_fields_match_the_cam(fields):
    tree = decode_cam_tree(genuine(0, **fields).payload)
    cam = cam_of_tree(tree)
    assert {name: field_of(tree, name) for name in FIELDS} == {name: getattr(cam, name) for name in FIELDS}
    assert values(tree) == {name: getattr(cam, name) for name in FIELDS}


def test_with_fields_changes_the_given_fields_only():
    tree = decode_cam_tree(genuine(0).payload)
    new = with_fields(tree, speed_mps=3.21, station_id=99, acceleration_control=64)
    assert {name for name in FIELDS if field_of(new, name) != field_of(tree, name)} == {
        "speed_mps",
        "station_id",
        "acceleration_control",
    }
    assert (
        field_of(new, "speed_mps"),
        field_of(new, "station_id"),
        field_of(new, "acceleration_control"),
    ) == (
        3.21,
        99,
        64,
    )
    assert field_of(tree, "speed_mps") == 10
    with pytest.raises(ValueError, match="unknown CAM field colour; known: station_id"):
        with_fields(tree, colour=1)
    with pytest.raises(CamError, match="speed_mps"):
        with_fields(tree, speed_mps=-1.0)


def test_invalid_bytes_open_as_none_and_closed_cams_round_trip():
    cams = CamEditor()
    assert cams.open(b"\xff" * 20) is None
    tree = with_fields(decode_cam_tree(genuine(0).payload), speed_mps=1.0)
    payload = cams.close(tree)
    assert cams.open(payload) is tree
    cams.forget()
    assert cams.open(payload) == tree
