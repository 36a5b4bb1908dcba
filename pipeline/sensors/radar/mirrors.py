"""Mirror images of road users in guard rails: what arrives by way of the rail, both ways.

Image theory, as for the ghosts that Kraus et al., Using machine learning to detect ghost images in automotive
radar (ITSC 2020), label: the wave goes by the rail to the target and back the same way, so that the ghost
stands where the rail's mirror image of the target is.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from advpipe.pipeline.geometry.boxes import Boxes
from advpipe.pipeline.geometry.transforms import Float64
from advpipe.pipeline.sensors.radar.aim import Aim
from advpipe.pipeline.sensors.radar.scatterers import Scatterers
from advpipe.pipeline.sensors.world import SURFACES, Hits

BARRIER = SURFACES.index("barrier")

STRIDE = 3
"""Columns of the grid between both ends of a facet, over which the profile of a rail averages out."""

LONGEST_M, SHORTEST_M = 12.0, 0.3
"""Of a facet: hits farther apart are on different rails, and closer ones give no direction."""


def barrier_facets(aim: Aim, hits: Hits) -> Float64:
    """Facets (F, 2, 2) of barriers, from x and y of one end to the other, in the radar's frame."""
    rows, columns = aim.grid
    count = rows * columns
    if hits.surfaces is None or columns <= STRIDE:
        return np.zeros((0, 2, 2))
    range_m = hits.range_m[:count].astype(np.float64)
    is_barrier = (hits.surfaces[:count] == BARRIER) & np.isfinite(range_m) & (hits.objects[:count] < 0)
    is_barrier = is_barrier.reshape(rows, columns)
    row, column = np.nonzero(is_barrier[:, :-STRIDE] & is_barrier[:, STRIDE:])
    first = row * columns + column
    ends = np.stack([first, first + STRIDE], axis=1)
    facets = aim.directions[ends][..., :2] * range_m[ends][..., None]
    length_m = np.linalg.norm(facets[:, 1] - facets[:, 0], axis=1)
    return np.asarray(facets[(length_m > SHORTEST_M) & (length_m < LONGEST_M)])


def mirror_images(direct: Scatterers, boxes: Boxes, facets: Float64, reflection: float) -> Scatterers:
    """The images of the scatterers of road users in facets; boxes: in the radar's frame.

    A facet mirrors a road user if the line to its image passes through the facet. The normals of all such
    facets of a rail are averaged.
    """
    none = direct[np.zeros(0, np.int64)]
    if not len(facets) or not len(boxes) or not reflection:
        return none
    images = [none]
    for side in (-1.0, 1.0):
        users, normals, offsets = _mirrors(facets[np.sign(facets[:, 0, 1]) == side], boxes)
        for user, normal, offset_m in zip(users, normals, offsets, strict=True):
            images.append(_mirrored(direct[direct.users == user], normal, offset_m, reflection))
    found = images[0]
    for image in images[1:]:
        found = found + image
    return found


def _mirrors(facets: Float64, boxes: Boxes) -> tuple[npt.NDArray[np.int64], Float64, Float64]:
    """The road users (K,) with an image, and the mirror of each: normal (K, 2) away from the radar and
    distance (K,) from it."""
    along = facets[:, 1] - facets[:, 0]
    length_m = np.linalg.norm(along, axis=1)
    along = along / np.maximum(length_m, 1e-9)[:, None]
    normal = np.stack([-along[:, 1], along[:, 0]], axis=1)
    offset_m = (normal * facets[:, 0]).sum(axis=1)
    sign = np.where(offset_m < 0, -1.0, 1.0)
    normal, offset_m = normal * sign[:, None], offset_m * sign
    depth_m = offset_m[:, None] - normal @ boxes.geometry[:, :2].T  # of each user before each facet
    image = boxes.geometry[None, :, :2] + 2 * depth_m[..., None] * normal[:, None]
    ahead = (image * normal[:, None]).sum(axis=-1)
    crossing = image * (offset_m[:, None] / np.maximum(ahead, 1e-9))[..., None]
    place_m = ((crossing - facets[:, None, 0]) * along[:, None]).sum(axis=-1)
    valid = (depth_m > 0.3) & (place_m >= 0) & (place_m <= length_m[:, None])
    count = valid.sum(axis=0)
    users = np.flatnonzero(count)
    weights = valid[:, users] / count[users]
    mean = weights.T @ normal
    return users, mean / np.linalg.norm(mean, axis=1)[:, None], weights.T @ offset_m


def _mirrored(direct: Scatterers, normal: Float64, offset_m: float, reflection: float) -> Scatterers:
    """The scatterers behind a mirror, which the wave meets twice."""
    position_m, velocity_mps = direct.position_m.copy(), direct.velocity_mps.copy()
    position_m[:, :2] += 2 * (offset_m - position_m[:, :2] @ normal)[:, None] * normal
    velocity_mps[:, :2] -= 2 * (velocity_mps[:, :2] @ normal)[:, None] * normal
    return Scatterers(position_m, velocity_mps, direct.rcs_m2 * reflection**2, direct.height_m, direct.users)
