"""Points off their ray and at a voxel's face, in clouds whose counts a person can see."""

import numpy as np

from advpipe.pipeline.detector.detector_frame import DetectorFrame
from advpipe.pipeline.detector.protocol import VoxelGrid
from advpipe.pipeline.messages.cloud import POINT_DTYPE
from advpipe.pipeline.messages.cloud_difference import cloud_difference
from advpipe.stages.evaluate.detection.point_traces import PointTraces

GRID = VoxelGrid((0.0, -10.0, -10.0), (0.1, 0.1, 0.2), (200, 200, 100))


def cloud(*places):
    points = np.zeros(len(places), POINT_DTYPE)
    points["x"], points["y"], points["z"] = np.array(places, np.float32).T
    points["ring"] = np.arange(len(places))
    return points


CLEAN = cloud((4.05, 0.05, 0.1), (8.05, 6.05, 0.1), (3.0005, 0.05, 0.1), (9.05, 0.05, 0.1))


def traces(changed, grid=GRID):
    return PointTraces.of(CLEAN, changed, cloud_difference(CLEAN, changed), grid)


def test_points_on_and_off_their_ray():
    changed = CLEAN.copy()
    for name in "xyz":
        changed[name][0] *= 1.01  # along the ray: 4 cm farther away
    changed["z"][1] += 0.0005  # half a millimetre beside it
    changed["y"][3] += 0.002
    assert traces(changed).off_ray == 1
    assert traces(CLEAN) == PointTraces(0, 0, 0, 4, 1)


def test_points_at_a_face_of_their_voxel():
    changed = CLEAN.copy()
    changed["x"][0] = 4.099  # 1 mm before a face
    changed["y"][1] = 6.002  # 2 mm behind one
    changed["z"][3] = 0.2008  # 0.8 mm above one
    found = traces(changed)
    assert (found.in_grid, found.at_face) == (3, 2)
    assert (found.clean_in_grid, found.clean_at_face) == (4, 1)
    assert traces(changed, None) == PointTraces(3)


def test_added_points_have_places_and_no_ray():
    added = np.concatenate([CLEAN, cloud((5.001, 1.05, 0.1), (5.05, 1.05, 0.1), (50.0, 1.05, 0.1))])
    assert traces(added) == PointTraces(0, 2, 1, 4, 1)  # one lies beyond the grid


def test_faces_are_those_of_the_detectors_own_frame():
    lifted = VoxelGrid(GRID.low_m, GRID.size_m, GRID.shape, DetectorFrame(shift_m=0.1))
    changed = CLEAN.copy()
    changed["x"][0] = 4.06
    assert traces(changed).at_face == 0
    assert traces(changed, lifted).at_face == 1  # at a height of 0.2 m


def test_frames_add_up():
    assert PointTraces.over([]) == PointTraces()
    both = [PointTraces(1, 2, 3, 4, 5), PointTraces(10, 20, 30, 40, 50)]
    assert PointTraces.over(both) == PointTraces(11, 22, 33, 44, 55)
