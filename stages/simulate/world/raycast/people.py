"""Meshes of pedestrians, in any phase of a stride and with what they carry, and of riders."""

from __future__ import annotations

import numpy as np

from advpipe.stages.simulate.world.raycast.mesh import Mesh, box_mesh, ellipsoid, merge, surface, tube


def walking(length_m: float, width_m: float, height_m: float, paint: str, pose: float) -> Mesh:
    """A pedestrian with free hands; `pose` in [0, 1] is the phase of the stride."""
    return merge(_person(height_m, pose))


def with_backpack(length_m: float, width_m: float, height_m: float, paint: str, pose: float) -> Mesh:
    """A pedestrian with a backpack."""
    pack = box_mesh((0.22, 0.34, 0.27 * height_m), "cloth_dark").moved(-0.24, 0, 0.56 * height_m)
    return merge([*_person(height_m, pose), pack])


def with_suitcase(length_m: float, width_m: float, height_m: float, paint: str, pose: float) -> Mesh:
    """A pedestrian who pulls a wheeled suitcase."""
    case = box_mesh((0.25, 0.4, 0.6), "plastic").moved(-0.62, -0.2, 0.05)
    handle = tube((-0.62, -0.2, 0.6), (-0.1, -0.25, 0.47 * height_m), 0.015, "frame", 4)
    return merge([*_person(height_m, pose), case, handle])


def with_umbrella(length_m: float, width_m: float, height_m: float, paint: str, pose: float) -> Mesh:
    """A pedestrian under an umbrella; `height_m` is the height of its tip."""
    tall_m = 0.84 * height_m
    stick = tube((0.15, 0.2, 0.6 * tall_m), (0.05, 0, height_m), 0.012, "frame", 4)
    angle = 2 * np.pi * np.arange(10) / 10
    edge = np.column_stack([0.5 * np.cos(angle), 0.5 * np.sin(angle), np.full(10, 0.88 * height_m)])
    tip = np.array([[0.0, 0.0, height_m]])
    ribs = np.column_stack([np.arange(10), (np.arange(10) + 1) % 10, np.full(10, 10)])
    canopy = surface(np.concatenate([edge, tip]), ribs, "cloth_dark")
    return merge([*_person(tall_m, pose, raised=1), stick, canopy])


def with_pushchair(length_m: float, width_m: float, height_m: float, paint: str, pose: float) -> Mesh:
    """A pedestrian who pushes a pram."""
    parts = _person(height_m, pose)
    axle, radius_m = (0.55, 1.05), 0.13
    for side in (-1, 1):
        y_m = 0.24 * side
        parts.append(tube((0.22, y_m, 0.98), (axle[0], y_m, 0.55), 0.015, "frame", 4))
        parts.append(tube((axle[0], y_m, radius_m), (1.0, y_m, 0.62), 0.015, "frame", 4))
        parts.append(tube((axle[1], y_m, radius_m), (0.6, y_m, 0.62), 0.015, "frame", 4))
        parts += [
            tube((x_m, y_m - 0.02, radius_m), (x_m, y_m + 0.02, radius_m), radius_m, "rubber", 10)
            for x_m in axle
        ]
    parts.append(tube((0.22, -0.24, 0.98), (0.22, 0.24, 0.98), 0.015, "frame", 4))
    parts.append(box_mesh((0.72, 0.38, 0.2), "cloth_dark").moved(0.8, 0, 0.55))
    parts.append(ellipsoid((0.95, 0, 0.76), (0.26, 0.19, 0.24), "cloth_dark", 4))
    return merge(parts)


def standing_rider(height_m: float, deck_m: float, grip: tuple[float, float]) -> list[Mesh]:
    """A rider who stands on a deck, one foot before the other, hands at (x, z) of the handlebar."""
    tall_m = height_m - deck_m
    limb, hip, shoulder = tall_m / 1.75, deck_m + 0.49 * tall_m, deck_m + 0.82 * tall_m
    parts = []
    for side in (-1, 1):
        foot = (0.14 * side - 0.06, 0.05 * side, deck_m)
        knee = (0.04 + 0.06 * side, 0.09 * side, deck_m + 0.27 * tall_m)
        hand = (grip[0], 0.22 * side, grip[1])
        elbow = (0.5 * grip[0], 0.26 * side, 0.5 * (shoulder + grip[1]) - 0.06)
        parts += [
            tube((-0.04, 0.09 * side, hip), knee, 0.085 * limb, "cloth_dark", 6),
            tube(knee, foot, 0.06 * limb, "cloth_dark", 6),
            tube((0, 0.19 * side, shoulder), elbow, 0.05, "cloth", 6),
            tube(elbow, hand, 0.042, "cloth", 5),
            box_mesh((0.24, 0.09, 0.08), "rubber").moved(foot[0] + 0.05, foot[1], deck_m),
        ]
    middle_m, half_m = (hip + shoulder) / 2, (shoulder - hip) / 2 + 0.05
    parts.append(ellipsoid((-0.02, 0, middle_m), (0.13, 0.2, half_m), "cloth", 5))
    parts.append(ellipsoid((0.02, 0, deck_m + 0.925 * tall_m), (0.1, 0.08, 0.075 * tall_m), "skin", 4))
    return parts


def _person(height_m: float, pose: float, raised: int = 0) -> list[Mesh]:
    """Legs with knees, arms that swing against them, a torso, a head; the side `raised` holds a hand up."""
    hip, knee, shoulder = 0.5 * height_m, 0.27 * height_m, 0.82 * height_m
    limb = height_m / 1.75
    stride_m = 0.24 * height_m * (0.6 + 0.4 * abs(np.cos(np.pi * pose)))
    parts = []
    for side in (-1, 1):
        ahead = side * stride_m / 2
        foot, bent = (ahead, 0.09 * side * limb, 0.0), (0.6 * ahead + 0.05, 0.09 * side * limb, knee)
        parts += [
            tube((0, 0.09 * side * limb, hip), bent, 0.085 * limb, "cloth_dark", 6),
            tube(bent, foot, 0.06 * limb, "cloth_dark", 6),
            box_mesh((0.24 * limb, 0.09 * limb, 0.08 * limb), "rubber").moved(foot[0] + 0.05, foot[1], 0.0),
        ]
        elbow = (-0.5 * ahead, 0.25 * side * limb, 0.64 * height_m)
        hand = (-ahead + 0.08, 0.26 * side * limb, 0.49 * height_m)
        if side == raised:
            elbow, hand = (0.1, 0.24 * side * limb, 0.62 * height_m), (0.22, 0.18 * side, 0.68 * height_m)
        parts.append(tube((0, 0.2 * side * limb, shoulder), elbow, 0.052 * limb, "cloth", 6))
        parts.append(tube(elbow, hand, 0.042 * limb, "skin", 5))
    middle_m, half_m = (hip + shoulder) / 2, (shoulder - hip) / 2 + 0.05 * limb
    parts.append(ellipsoid((0, 0, middle_m), (0.13 * limb, 0.2 * limb, half_m), "cloth", 5))
    parts.append(ellipsoid((0.02, 0, 0.925 * height_m), (0.1, 0.08, 0.075 * height_m), "skin", 4))
    return parts


def riding(seat_m: float, height_m: float, lean_m: float, reach_m: float, pose: float) -> list[Mesh]:
    """A rider of a two-wheeler: feet on the pedals, hands on the handlebar `reach_m` ahead."""
    shoulder = height_m - 0.36
    parts = []
    for side in (-1, 1):
        turn = np.pi * (pose + (side > 0))
        foot = (0.12 + 0.15 * np.cos(turn), 0.12 * side, 0.34 * seat_m + 0.13 * np.sin(turn))
        knee = (0.24, 0.13 * side, 0.5 * (seat_m + foot[2]) + 0.12)
        grip = (reach_m, 0.22 * side, seat_m + 0.16)
        elbow = (0.5 * (lean_m + reach_m), 0.26 * side, 0.5 * (shoulder + grip[2]) - 0.05)
        parts += [
            tube((-0.14, 0.09 * side, seat_m), knee, 0.085, "cloth_dark", 6),
            tube(knee, foot, 0.06, "cloth_dark", 6),
            tube((lean_m, 0.19 * side, shoulder), elbow, 0.05, "cloth", 5),
            tube(elbow, grip, 0.042, "cloth", 5),
        ]
    parts.append(tube((-0.16, 0, seat_m - 0.05), (lean_m, 0, shoulder + 0.06), 0.17, "cloth", 8))
    parts.append(ellipsoid((lean_m + 0.06, 0, height_m - 0.14), (0.13, 0.11, 0.14), "plastic", 4))
    return parts
