"""Street furniture: lamp posts, signs, signals, bins, benches, bicycle stands, shelters, cabinets.

Each faces the oncoming traffic along its kerb. In its frame, x points in the driving direction and y to the
left, towards the road; the origin is on the ground.
"""

from __future__ import annotations

import itertools

import numpy as np

from advpipe.stages.simulate.world.raycast.mesh import Mesh, box_mesh, merge, surface, tube
from advpipe.stages.simulate.world.raycast.shapes import limbs


def lamp_post(rng: np.random.Generator) -> Mesh:
    """A tapered post with an arm over the road."""
    height_m, reach_m = rng.uniform(6.0, 10.0), rng.uniform(1.0, 2.2)
    feet, tops = np.array([[0, 0, -0.3], [0, 0, 1.2]]), np.array([[0, 0, 1.2], [0, 0, height_m]])
    return merge(
        [
            limbs(feet, tops, np.array([0.11, 0.08]), "steel", sides=6, taper=0.8),
            tube((0, 0, height_m), (0, reach_m, height_m + 0.25), 0.04, "steel", 4),
            box_mesh((0.25, 0.6, 0.12), "steel").moved(0, reach_m + 0.2, height_m + 0.18),
        ]
    )


def traffic_sign(rng: np.random.Generator) -> Mesh:
    """A traffic sign on its post: round, triangular, square or a large panel; bright to the front only."""
    shape = int(rng.integers(5))
    foot_m = rng.uniform(2.0, 2.4)
    if shape == 4:
        face = _plate([(-0.9, 0.0), (0.9, 0.0), (0.9, 1.1), (-0.9, 1.1)])
        posts = [tube((0, y, -0.3), (0, y, foot_m + 1.1), 0.05, "steel", 6) for y in (-0.7, 0.7)]
        return merge([face.moved(-0.06, 0, foot_m), *posts])
    corners, size_m = (16, 3, 4, 8)[shape], 0.37
    angle = 2 * np.pi * (np.arange(corners) + (0.5 if corners in (4, 8) else 0.0)) / corners + np.pi / 2
    face = _plate([(size_m * np.cos(a), size_m * np.sin(a) + size_m) for a in angle])
    post = tube((0, 0, -0.3), (0, 0, foot_m + 2 * size_m), 0.035, "steel", 6)
    return merge([face.moved(-0.05, 0, foot_m), post])


def _plate(outline_yz: list[tuple[float, float]]) -> Mesh:
    """A convex sheet: retroreflective towards -x, bare metal 2 cm behind."""
    points = np.array([(0.0, y, z) for y, z in outline_yz])
    fan = [[0, i, i + 1] for i in range(1, len(points) - 1)]
    return merge([surface(points, fan, "sign"), surface(points + (0.02, 0, 0), fan, "sign_back")])


def traffic_light(rng: np.random.Generator) -> Mesh:
    """A traffic signal: a head on the post, and often another on an arm over the road."""
    head = merge(
        [
            box_mesh((0.22, 0.3, 0.9), "signal_head"),
            box_mesh((0.02, 0.56, 1.1), "signal_head").moved(0.12, 0, -0.1),
        ]
    )
    parts = [tube((0, 0, -0.3), (0, 0, 3.4), 0.07, "steel", 8), head.moved(-0.15, 0, 2.3)]
    if rng.random() < 0.6:
        reach_m = rng.uniform(3.0, 5.5)
        parts.append(tube((0, 0, 3.4), (0, 0, 5.9), 0.08, "steel", 8))
        parts.append(tube((0, 0, 5.8), (0, reach_m, 5.9), 0.06, "steel", 6))
        parts.append(head.moved(-0.15, reach_m - 0.2, 4.9))
    return merge(parts)


def bollard(rng: np.random.Generator) -> Mesh:
    """A bollard with a reflecting band."""
    band = tube((0, 0, 0.7), (0, 0, 0.8), 0.07, "sign", 8)
    return merge([tube((0, 0, -0.2), (0, 0, 0.95), 0.06, "steel", 8), band])


def delineator(rng: np.random.Generator) -> Mesh:
    """The reflecting post beside fast roads."""
    reflector = box_mesh((0.01, 0.05, 0.18), "sign").moved(-0.065, 0, 0.75)
    return merge([box_mesh((0.12, 0.12, 1.0), "barrier_concrete"), reflector])


def litter_bin(rng: np.random.Generator) -> Mesh:
    """A bin, or two large ones on wheels."""
    if rng.random() < 0.5:
        return tube((0, 0, 0.1), (0, 0, 0.9), 0.22, "bin", 10)
    return merge(box_mesh((0.58, 0.7, 1.05), "bin").moved(x, 0, 0) for x in (-0.34, 0.34))


def container(rng: np.random.Generator) -> Mesh:
    """A switch cabinet or a skip, some of a car's size: hard negatives for detectors of cars."""
    if rng.random() < 0.5:
        return box_mesh((rng.uniform(0.4, 1.2), rng.uniform(0.3, 0.6), rng.uniform(0.8, 1.6)), "bin")
    return box_mesh((rng.uniform(1.2, 4.5), rng.uniform(1.0, 1.9), rng.uniform(1.1, 1.9)), "skip")


def shelter(rng: np.random.Generator) -> Mesh:
    """A bus shelter: roof, posts, panes at the back and one end, a bench."""
    pane = box_mesh((3.6, 0.01, 1.9), "pane").moved(0, -0.75, 0.25)
    end = box_mesh((0.01, 1.3, 1.9), "pane").moved(1.8, -0.1, 0.25)
    posts = [tube((x, y, 0), (x, y, 2.35), 0.04, "steel", 6) for x in (-1.85, 1.85) for y in (-0.75, 0.6)]
    bench = box_mesh((2.4, 0.4, 0.06), "wood").moved(0, -0.45, 0.45)
    return merge([box_mesh((4.0, 1.7, 0.12), "steel").moved(0, 0, 2.35), pane, end, *posts, bench])


def bench(rng: np.random.Generator) -> Mesh:
    """A bench with a back, towards the road."""
    seat = [box_mesh((1.7, 0.12, 0.05), "wood").moved(0, y, 0.45) for y in (-0.12, 0.02, 0.16)]
    back = [box_mesh((1.7, 0.04, 0.12), "wood").moved(0, -0.24, z) for z in (0.6, 0.76)]
    legs = [box_mesh((0.06, 0.45, 0.45), "steel").moved(x, 0, 0) for x in (-0.7, 0.7)]
    return merge([*seat, *back, *legs])


def bicycle_stand(rng: np.random.Generator) -> Mesh:
    """Hoops across the kerb; bicycles lean against some of them."""
    parts = []
    for x in np.arange(int(rng.integers(2, 5))) * 0.9 - 1.3:
        corners = [(x, -0.4, 0), (x, -0.4, 0.8), (x, 0.4, 0.8), (x, 0.4, 0)]
        parts += [tube(a, b, 0.025, "steel", 4) for a, b in itertools.pairwise(corners)]
        if rng.random() < 0.65:
            parts.append(_bicycle().moved(float(x) + 0.12, 0, 0))
    return merge(parts)


def _bicycle() -> Mesh:
    """A bicycle that stands across, in few pieces: two rims, a frame, bars and a saddle."""
    angle = 2 * np.pi * np.arange(10) / 10
    rings = []
    for y in (-0.52, 0.52):
        outer, inner = (
            np.column_stack([0 * angle, y + r * np.cos(angle), 0.34 + r * np.sin(angle)])
            for r in (0.34, 0.29)
        )
        i, j = np.arange(10), (np.arange(10) + 1) % 10
        faces = np.concatenate([np.stack([i, j, i + 10], axis=1), np.stack([j, j + 10, i + 10], axis=1)])
        rings.append(surface(np.concatenate([outer, inner]), faces, "rubber"))
    points = [(0.0, -0.52, 0.34), (0.0, -0.3, 0.85), (0.0, 0.35, 0.8), (0.0, 0.52, 0.34), (0.0, 0.0, 0.32)]
    pairs = [(0, 1), (1, 2), (2, 3), (1, 4), (2, 4), (0, 4)]
    bars = [tube(points[a], points[b], 0.02, "fence_metal", 3) for a, b in pairs]
    handle = box_mesh((0.55, 0.05, 0.05), "fence_metal").moved(0, 0.35, 0.95)
    return merge([*rings, *bars, handle, box_mesh((0.13, 0.25, 0.06), "rubber").moved(0, -0.3, 0.88)])


def construction_barrier(rng: np.random.Generator) -> Mesh:
    """Red and white boards on feet around a hole, with a heap of soil beside."""
    parts = []
    for x in (-1.1, 1.1):
        boards = [box_mesh((2.0, 0.04, 0.2), "hazard_board").moved(x, 0.6, z) for z in (0.75, 0.35)]
        feet = [
            box_mesh((0.25, 0.5, 1.0), "rubber").scaled(0.3, 1, 1).moved(x + dx, 0.6, 0) for dx in (-0.9, 0.9)
        ]
        parts += [*boards, *feet]
    angle = 2 * np.pi * np.arange(8) / 8
    foot = np.column_stack([1.2 * np.cos(angle), 0.5 * np.sin(angle) - 0.2, np.full(8, -0.05)])
    top = np.array([[0.0, -0.2, rng.uniform(0.4, 0.8)]])
    heap = [[i, (i + 1) % 8, 8] for i in range(8)]
    return merge([*parts, surface(np.concatenate([foot, top]), heap, "soil")])


def utility_pole(rng: np.random.Generator, height_m: float) -> Mesh:
    """A wooden pole with a cross-arm, which carries overhead wires."""
    arm = box_mesh((0.1, 1.5, 0.12), "wood").moved(0, 0, height_m - 0.5)
    return merge([tube((0, 0, -0.3), (0, 0, height_m), 0.13, "wood", 7), arm])
