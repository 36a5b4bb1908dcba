from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from advpipe.pipeline.adversary.constraints import Constraints, Rules, along_rays
from advpipe.pipeline.adversary.ghost_object import GhostObject
from advpipe.pipeline.core.errors import AdvpipeError
from advpipe.pipeline.geometry.boxes import Boxes


def rules(points, boxes=None, **options):
    return Rules(Constraints(**options), np.asarray(points, np.float32), boxes or Boxes())


def test_along_ray_keeps_the_component_on_it():
    # On the ray (3, 4, 0) / 5, the offset (1, 0, 0) has the length 3/5: (9, 12, 0) / 25.
    projected = along_rays(np.float32([[3, 4, 0], [0, 0, 2]]), np.array([[1.0, 0, 0], [1.0, 1.0, -0.5]]))
    assert np.allclose(projected, [[9 / 25, 12 / 25, 0], [0, 0, -0.5]])


def test_projection_never_lengthens_and_leaves_what_may_not_be_touched(make_boxes):
    points = np.random.default_rng(0).uniform(-20, 20, (500, 3)).astype(np.float32)
    offset = np.random.default_rng(1).normal(0, 0.1, (500, 3))
    box = [5.0, 5.0, 0.0, 12.0, 12.0, 20.0, 0.5]
    mine = rules(points, make_boxes(box), along_ray=True, near_objects_m=1.0)
    projected = mine.project(offset)
    assert (np.linalg.norm(projected, axis=1) <= np.linalg.norm(offset, axis=1) + 1e-12).all()
    assert 10 < mine.allowed.sum() < 200
    assert not projected[~mine.allowed].any()
    moved = points + projected
    assert np.allclose(np.cross(points, moved), 0, atol=1e-5)  # on the same ray


@pytest.mark.parametrize(("margin_m", "near"), [(0.0, [0]), (0.5, [0, 1]), (2.0, [0, 1, 2])])
def test_near_objects_counts_from_the_faces(make_boxes, margin_m, near):
    box = [10.0, 0.0, 0.0, 4.0, 2.0, 2.0, 0.0]  # its front face stands at x = 12
    points = [[10, 0, 0], [12.4, 0, 0], [13.9, 0, 0], [20, 0, 0]]
    allowed = rules(points, make_boxes(box), near_objects_m=margin_m).allowed
    assert np.flatnonzero(allowed).tolist() == near


def test_objects_by_id_or_where_there_are_none_by_place(make_boxes):
    boxes = make_boxes([0.0, 0, 0, 2, 2, 2, 0], [10.0, 0, 0, 2, 2, 2, 0], [20.0, 0, 0, 2, 2, 2, 0])
    points = np.float32([[0, 0, 0], [10, 0, 0], [20, 0, 0]])
    chosen = Constraints(objects=("car1", "2")).attacked(boxes, points)
    assert chosen.ids == ("car1",)
    numbered = replace(boxes, ids=("7", "0", "1"))
    assert Constraints(objects=("1",)).attacked(numbered, points).ids == ("1",)
    nameless = replace(boxes, ids=("",) * len(boxes))
    assert Constraints(objects=("1", "2")).attacked(nameless, points).geometry[:, 0].tolist() == [10, 20]
    assert rules(points, boxes, objects=("car1",)).allowed.tolist() == [False, True, False]
    assert len(Constraints(objects=("elsewhere",)).attacked(boxes, points)) == 0


def test_ghost_object_stands_on_the_ground():
    ground = np.float32([[x, y, -1.8] for x in range(5, 15) for y in range(-5, 5)])
    ghost = GhostObject("car", 10.0, 0.0, 0.5).boxes(ground)
    assert ghost.geometry[0].tolist() == pytest.approx([10, 0, -1.8 + 1.55 / 2, 4.5, 1.85, 1.55, 0.5])
    assert len(GhostObject("car", 60.0, 0.0).boxes(ground)) == 0  # nothing there to stand on
    assert GhostObject.parse("pedestrian:4:-2.5:1") == GhostObject("pedestrian", 4.0, -2.5, 1.0)


def wall_and_post():
    """A wall at x = 20 and, before it, a post at x = 10 that is 2 m wide; half a degree apart."""
    points = []
    for azimuth in np.radians(np.arange(-20, 20, 0.5)):
        for elevation in np.radians(np.arange(-5, 5, 0.5)):
            x = 10 if abs(10 * np.tan(azimuth)) < 1 else 20
            points.append([x, x * np.tan(azimuth), x * np.tan(elevation) / np.cos(azimuth)])
    return np.float32(points)


def test_places_behind_a_surface_are_hidden():
    mine = rules(wall_and_post())
    places = [[15, 0, 0], [9, 0, 0], [10.1, 0, 0], [25, 5, 0], [15, 5, 0], [19.9, 5, 0], [5, -40, 0]]
    #         behind post, before it, on it,       behind wall, before wall, on it, where nothing was seen
    assert mine.hidden(np.array(places)).tolist() == [True, False, False, True, False, False, False]
    assert not mine.hidden(mine.points).any()
    assert rules(np.zeros((0, 3))).hidden(np.array(places)).sum() == 0


def test_occlusion_order_stops_moves_behind_the_post_only():
    points = wall_and_post()
    edge = np.flatnonzero((points[:, 0] == 20) & (np.abs(points[:, 1]) < 2.5) & (points[:, 1] > 0))
    offset = np.zeros(points.shape)
    offset[edge, 1] = -1.5  # wall points beside the post, moved behind it
    free = np.flatnonzero((points[:, 0] == 20) & (points[:, 1] > 5))
    offset[free, 1] = 0.3
    projected = rules(points, keep_occlusion_order=True).project(offset)
    assert len(edge)
    assert not projected[edge].any()
    assert np.array_equal(projected[free], offset[free])
    kept = rules(points, keep_occlusion_order=True).permits(np.array([[15.0, 0, 0], [15.0, 5, 0]]))
    assert kept.tolist() == [False, True]


def test_limit_takes_the_most_worth():
    worth = np.array([0.0, 3.0, 1.0, 2.0, -1.0])
    points = np.zeros((5, 3))
    assert np.flatnonzero(rules(points, max_points=2).limit(worth)).tolist() == [1, 3]
    assert np.flatnonzero(rules(points).limit(worth)).tolist() == [1, 2, 3]


def test_from_plain_values():
    read = Constraints.of({"ghost": "car:12:3", "near_objects_m": 0.5})
    assert read == Constraints(ghost=GhostObject("car", 12.0, 3.0), near_objects_m=0.5)
    assert Constraints.of({"objects": "car1,car2"}).objects == ("car1", "car2")
    assert Constraints.of({"objects": [3]}).objects == ("3",)


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ({"near_objects_m": -1.0}, "near_objects_m is -1"),
        ({"near_objects_m": float("nan")}, "near_objects_m is nan"),
        ({"max_points": 0}, "max_points is 0"),
        ({"max_points": 2.5}, "max_points is 2.5"),
        ({"objects": "a", "ghost": "car:1:2"}, "two attacks"),
        ({"goal": "hide", "ghost": "car:1:2"}, "two attacks"),
        ({"goal": "misplace"}, "goal is 'misplace'; known: break, hide"),
        ({"ghost": "car:1"}, "CLASS:X:Y"),
        ({"ghost": "car:1:east"}, "CLASS:X:Y"),
        ({"ghost": "tank:1:2"}, "unknown class 'tank'"),
        ({"ghost": "car:nan:2"}, "x_m is nan"),
        ({"sideways": True}, "unknown constraint 'sideways'"),
    ],
)
def test_bad_options(options, said):
    with pytest.raises(AdvpipeError, match=said):
        Constraints.of(options)
