import numpy as np

from advpipe.pipeline.geometry.boxes import CLASSES, Boxes
from advpipe.pipeline.messages.markers import lane_markers, lanes_of_markers, markers
from advpipe.pipeline.messages.types import serialise, typestore

TYPE = "visualization_msgs/msg/MarkerArray"
CUBE, LINE_STRIP, ADD, DELETE_ALL = 1, 4, 0, 3


def test_old_markers_are_cleared_before_the_cubes() -> None:
    geometry = np.array([[1.0, 2, 3, 4, 5, 6, np.pi / 2]] * 4)
    boxes = Boxes(geometry, np.arange(4), tuple("abcd"), np.zeros((4, 3)))
    message = markers(5_000_000_001, "map", boxes)
    back = typestore().deserialize_cdr(serialise(message, TYPE), TYPE)
    clear, *cubes = back.markers
    assert clear.action == DELETE_ALL
    assert [(cube.type, cube.action, cube.ns) for cube in cubes] == [(CUBE, ADD, name) for name in CLASSES]
    assert len({(cube.color.r, cube.color.g, cube.color.b) for cube in cubes}) == 4
    first = cubes[0]
    assert (first.header.frame_id, first.header.stamp.sec, first.header.stamp.nanosec) == ("map", 5, 1)
    assert (first.pose.position.x, first.pose.position.y, first.pose.position.z) == (1, 2, 3)
    assert (first.scale.x, first.scale.y, first.scale.z) == (4, 5, 6)
    np.testing.assert_allclose([first.pose.orientation.z, first.pose.orientation.w], [0.5**0.5] * 2)


def test_an_empty_scene_is_still_cleared() -> None:
    (clear,) = markers(0, "map", Boxes()).markers
    assert clear.action == DELETE_ALL


def test_lanes_round_trip() -> None:
    lanes = [
        (np.array([[0.0, 0, 1], [10, 5, 2], [20, 5, 2]]), 3.2),
        (np.array([[7.0, 7, 7], [8, 8, 8]]), 2.5),
    ]
    message = lane_markers(5_000_000_001, "map", lanes)
    back = typestore().deserialize_cdr(serialise(message, TYPE), TYPE)
    assert [(line.type, line.id, line.scale.x) for line in back.markers] == [
        (LINE_STRIP, 0, 3.2),
        (LINE_STRIP, 1, 2.5),
    ]
    assert all(line.header.frame_id == "map" and line.pose.orientation.w == 1 for line in back.markers)
    for (middle_m, width_m), (wanted_m, wanted) in zip(lanes_of_markers(back), lanes, strict=True):
        np.testing.assert_array_equal(middle_m, wanted_m)
        assert width_m == wanted
