"""Meshes of people who stay in one place: they stand, sit or bend down."""

from __future__ import annotations

import numpy as np

from advpipe.stages.simulate.world.raycast.mesh import Mesh, box_mesh, ellipsoid, merge, tube

Point = tuple[float, float, float]


def standing(length_m: float, width_m: float, height_m: float, paint: str, pose: float) -> Mesh:
    """Somebody who waits; `pose` in [0, 1]: above 0.5 a hand holds a telephone before the face."""
    limb = height_m / 1.75
    hip, shoulder = 0.5 * height_m, 0.82 * height_m
    parts = [*_torso((0, 0, hip), (0, 0, shoulder), limb), _head((0.03, 0, 0.925 * height_m), height_m)]
    for side in (-1, 1):
        y_m = 0.1 * side * limb
        knee = (0.04, y_m, 0.27 * height_m)
        parts += _leg((0, y_m, hip), knee, (0, y_m, 0), limb)
        elbow, hand = (
            (-0.04, 0.26 * side * limb, 0.63 * height_m),
            (0.05, 0.25 * side * limb, 0.48 * height_m),
        )
        if side > 0 and pose > 0.5:
            elbow, hand = (0.06, 0.25 * limb, 0.63 * height_m), (0.22, 0.1, 0.8 * height_m)
        parts += _arm((0, 0.2 * side * limb, shoulder), elbow, hand, limb)
    return merge(parts)


def sitting(length_m: float, width_m: float, height_m: float, paint: str, pose: float) -> Mesh:
    """Somebody on a stone block; `pose` in [0, 1]: how far the trunk leans forward."""
    limb = height_m / 1.3
    seat, shoulder = 0.45 * limb, 1.02 * limb
    lean = 0.25 * pose
    block = box_mesh((0.42 * limb, 0.5 * limb, seat), "kerbstone").moved(-0.06, 0, 0)
    trunk = _torso((-0.1, 0, seat + 0.04), (-0.1 + lean, 0, shoulder), limb)
    parts = [block, *trunk, _head((-0.06 + 1.2 * lean, 0, 1.17 * limb), 1.72 * limb)]
    for side in (-1, 1):
        y_m = 0.12 * side * limb
        knee = (0.4 * limb, y_m, seat + 0.06)
        parts += _leg((-0.08, y_m, seat + 0.08), knee, (0.42 * limb, y_m, 0), limb)
        elbow = (0.05 + 0.8 * lean, 0.27 * side * limb, 0.72 * limb)
        parts += _arm(
            (-0.08 + lean, 0.2 * side * limb, shoulder), elbow, (0.32, 0.12 * side, 0.62 * limb), limb
        )
    return merge(parts)


def bending(length_m: float, width_m: float, height_m: float, paint: str, pose: float) -> Mesh:
    """Somebody who bends down to a bag on the ground; `pose` in [0, 1]: how low the hands are."""
    limb = height_m / 1.22
    hip, shoulder = (-0.12, 0.0, 0.86 * limb), (0.36, 0.0, 1.02 * limb)
    parts = [*_torso(hip, shoulder, limb), _head((0.56, 0, 1.08 * limb), 1.72 * limb)]
    parts.append(box_mesh((0.24, 0.36, 0.3), "cloth_dark").moved(0.5, 0, 0))
    for side in (-1, 1):
        y_m = 0.11 * side * limb
        parts += _leg((-0.12, y_m, 0.86 * limb), (0.02, y_m, 0.46 * limb), (-0.06, y_m, 0), limb)
        elbow = (0.42, 0.22 * side * limb, 0.74 * limb)
        hand = (0.5, 0.16 * side, (0.5 - 0.18 * pose) * limb)
        parts += _arm((0.36, 0.18 * side * limb, 1.0 * limb), elbow, hand, limb)
    return merge(parts)


def _leg(hip: Point, knee: Point, foot: Point, limb: float) -> list[Mesh]:
    return [
        tube(hip, knee, 0.085 * limb, "cloth_dark", 6),
        tube(knee, foot, 0.06 * limb, "cloth_dark", 6),
        box_mesh((0.24 * limb, 0.09 * limb, 0.08 * limb), "rubber").moved(foot[0] + 0.05, foot[1], 0.0),
    ]


def _arm(shoulder: Point, elbow: Point, hand: Point, limb: float) -> list[Mesh]:
    return [
        tube(shoulder, elbow, 0.052 * limb, "cloth", 6),
        tube(elbow, hand, 0.042 * limb, "skin", 5),
    ]


def _torso(hip: Point, shoulder: Point, limb: float) -> list[Mesh]:
    """The trunk along the line from the hips to the shoulders, flatter from front to back."""
    low, high = np.array(hip), np.array(shoulder)
    centres = [low + share * (high - low) for share in (0.12, 0.45, 0.82)]
    radii = [(0.14, 0.17, 0.16), (0.13, 0.17, 0.2), (0.13, 0.21, 0.18)]
    return [
        ellipsoid(centre.tolist(), [limb * r for r in radius], "cloth", 4)
        for centre, radius in zip(centres, radii, strict=True)
    ]


def _head(centre: Point, height_m: float) -> Mesh:
    return ellipsoid(centre, (0.1, 0.08, 0.075 * height_m), "skin", 4)
