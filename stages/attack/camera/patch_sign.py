"""Road signs in an image, as planes to fix a patch to."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy import ndimage

from advpipe.pipeline.geometry.transforms import Float64, transform_points
from advpipe.pipeline.sensors.camera.palette import TAG
from advpipe.stages.attack.camera.patch_place import PatchSize, SignFace, upright_pose
from advpipe.stages.attack.camera.scene import CameraScene

LEAST_PIXELS = 40
"""Of a sign that a patch is fixed to."""

FLAT_M, LEVEL = 0.03, 0.2
"""How far its pixels may be from a plane (root of the mean square), and how much this may lean."""

INNER = 0.9
"""Share of the sign's width and height that the patch takes at most."""


def signs(scene: CameraScene, largest: PatchSize) -> Sequence[SignFace]:
    """The signs that show the camera a flat, upright face, the one with most pixels first.

    largest: of the patch, which is smaller on a smaller sign.
    """
    known = (scene.tags == TAG["TrafficSign"]) & np.isfinite(scene.range_m)
    parts, count = ndimage.label(known)
    sizes = ndimage.sum_labels(known, parts, np.arange(1, count + 1)) if count else np.zeros(0)
    order = np.argsort(-sizes, kind="stable")
    found = [_face(scene, parts == part + 1, largest) for part in order if sizes[part] >= LEAST_PIXELS]
    return [face for face in found if face is not None]


def _face(scene: CameraScene, pixels: Float64, largest: PatchSize) -> SignFace | None:
    """The patch on one sign; None for what is not flat and upright."""
    rows, columns = np.nonzero(pixels)
    rays = scene.lens.directions(np.stack([columns, rows], axis=1).astype(np.float64))
    map_SE3_optical = scene.map_SE3_base @ scene.base_SE3_optical
    points_m = transform_points(map_SE3_optical, rays * scene.range_m[rows, columns][:, None])
    middle_m = points_m.mean(axis=0)
    _, spread, axes = np.linalg.svd(points_m - middle_m, full_matrices=False)
    normal = axes[2]
    if spread[2] / np.sqrt(len(points_m)) > FLAT_M or abs(normal[2]) > LEVEL:
        return None
    away = np.array([normal[0], normal[1], 0.0]) / np.hypot(normal[0], normal[1])
    away = away if away @ (middle_m - map_SE3_optical[:3, 3]) > 0 else -away
    right = np.cross([0.0, 0.0, -1.0], away)
    across, height = (points_m - middle_m) @ right, points_m[:, 2] - middle_m[2]
    middle_m = middle_m + right * (across.max() + across.min()) / 2
    middle_m[2] += (height.max() + height.min()) / 2
    size = PatchSize(
        min(largest.width_m, INNER * float(np.ptp(across))),
        min(largest.height_m, INNER * float(np.ptp(height))),
    )
    return SignFace(upright_pose(middle_m, away), size)
