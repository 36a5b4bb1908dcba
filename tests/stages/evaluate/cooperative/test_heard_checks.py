"""The checks of objects heard of, on scenes that can be checked by hand."""

from __future__ import annotations

import math

import numpy as np

from advpipe.pipeline.v2x.facilities.heard_objects import HeardObject
from advpipe.stages.evaluate.cooperative.heard_checks import in_free_space, omitting, without_witnesses
from advpipe.stages.evaluate.cooperative.heard_scenes import HeardScene
from advpipe.stages.evaluate.v2x.ldm_error import Known

NOW_NS = 10**18
NO_PLACES = np.zeros((0, 2))


def heard(x_m: float, y_m: float, station: int = 1, height_m: float = 1.5) -> HeardObject:
    return HeardObject(
        *(station, int(x_m * 10) % 65536, "car", NOW_NS, NOW_NS),
        centre_m=(x_m, y_m, 0.75),
        yaw_rad=0.0,
        velocity_mps=(0.0, 0.0),
        length_m=4.5,
        width_m=1.8,
        height_m=height_m,
    )


def station(number: int, x_m: float, y_m: float) -> Known:
    return Known(number, x_m, y_m, 0.0, 0.0, 4.5, 1.8)


def scene(
    objects: list[HeardObject],
    entries: tuple[Known, ...] = (),
    users: list[tuple[float, float]] | None = None,
    cloud_m: np.ndarray | None = None,
) -> HeardScene:
    """The vehicle is at the origin, its LiDAR 1.8 m above it. users: each with 50 points of it."""
    places = np.array([[x, y, 0.75, 4.5, 1.8, 1.5, 0.0] for x, y in users or []]).reshape(-1, 7)
    lidar_SE3_map = np.eye(4)
    lidar_SE3_map[2, 3] = -1.8
    return HeardScene(
        time_ns=NOW_NS,
        at_m=np.zeros(2),
        users=places,
        points=np.full(len(places), 50.0),
        heard=tuple(objects),
        entries=entries,
        stations_m=NO_PLACES,
        cloud_m=np.zeros((0, 3)) if cloud_m is None else cloud_m,
        lidar_SE3_map=lidar_SE3_map,
    )


def wall_m(distance_m: float) -> np.ndarray:
    """Points of a wall across the x axis, in the LiDAR's frame."""
    y_m, z_m = np.meshgrid(np.linspace(-10, 10, 200), np.linspace(-1.8, 1.0, 60))
    return np.column_stack([np.full(y_m.size, distance_m), y_m.ravel(), z_m.ravel()])


def test_space_is_free_where_the_lidar_sees_through_it() -> None:
    objects = [heard(20.0, 0.0), heard(40.0, 0.0), heard(0.5, 0.0), heard(20.0, 40.0)]
    found = in_free_space(scene(objects, cloud_m=wall_m(30.0)))
    # In front of the wall, behind it, the vehicle itself, and where no ray goes.
    assert found.tolist() == [True, False, False, False]
    assert not in_free_space(scene([heard(20.0, 0.0)], cloud_m=wall_m(20.0)))[0]
    assert not in_free_space(scene([heard(20.0, 0.0, height_m=math.nan)], cloud_m=wall_m(30.0)))[0]


def test_an_object_needs_a_second_witness_where_there_are_some() -> None:
    near = (station(1, 5.0, 0.0), station(2, 10.0, 10.0))
    lone, elsewhere = heard(20.0, 0.0, 1), heard(25.0, 25.0, 2)
    assert without_witnesses(scene([lone, elsewhere], near)).tolist()[0]
    for confirming in (
        scene([lone, heard(21.0, 0.0, 2)], near),  # another report
        scene([lone, elsewhere], (*near, station(3, 20.0, 1.0))),  # a station there
        scene([lone, elsewhere], near, users=[(20.0, 0.5)]),  # the own LiDAR
    ):
        assert not without_witnesses(confirming)[0]
    assert not without_witnesses(scene([lone], near[:1]))[0]  # the vehicle itself is the only witness


def test_a_report_that_leaves_out_what_others_see_is_noticed() -> None:
    near = (station(1, 5.0, 5.0), station(2, 10.0, 10.0))
    user, other = (15.0, 0.0), heard(40.0, 5.0, 1)
    both = scene([other, heard(*user, 1), heard(*user, 2)], near, users=[user])
    assert omitting(both) == {1: False, 2: False}
    assert omitting(scene([other, heard(*user, 2)], near, users=[user])) == {1: True, 2: False}
    assert omitting(scene([other, heard(*user, 2)], near)) == {1: False, 2: False}  # the LiDAR sees nothing
