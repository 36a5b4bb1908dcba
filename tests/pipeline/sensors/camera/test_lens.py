"""Projections: numbers by hand, OpenCV's formulas worked by hand, and the way back."""

from __future__ import annotations

import numpy as np
import pytest

from advpipe.pipeline.sensors.camera.section import CameraSensor


def lens(**keys: object):
    return CameraSensor.model_validate({"image_size_x": 640, "image_size_y": 480} | keys).lens()


def test_a_pinhole_of_90_degrees_has_its_focal_length_by_hand() -> None:
    made = lens(fov=90.0)
    assert np.allclose(made.matrix, [[320, 0, 319.5], [0, 320, 239.5], [0, 0, 1]])
    assert np.allclose(made.project(np.array([[1.0, 0.5, 2.0]])), [[319.5 + 160, 239.5 + 80]])
    assert np.isnan(made.project(np.array([[0.0, 0.0, -1.0]]))).all()


def test_plumb_bob_by_hand() -> None:
    """x = .5, y = .25: r^2 = .3125; radial 1 + .1 r^2 - .02 r^4 = 1.029296875; p1 = .01, p2 = -.005."""
    intrinsics = {"fx": 100.0, "fy": 100.0, "cx": 0.0, "cy": 0.0}
    made = lens(
        image_size_x=100, image_size_y=60, intrinsics=intrinsics, distortion=(0.1, -0.02, 0.01, -0.005)
    )
    x = 0.5 * 1.029296875 + 2 * 0.01 * 0.125 - 0.005 * (0.3125 + 0.5)
    y = 0.25 * 1.029296875 + 0.01 * (0.3125 + 0.125) - 2 * 0.005 * 0.125
    assert np.allclose(made.project(np.array([[1.0, 0.5, 2.0]])), [[100 * x, 100 * y]])


def test_an_equidistant_fisheye_by_hand() -> None:
    made = lens(projection="fisheye", fov=180.0)
    focal = 320 / (np.pi / 2)
    aside = np.array([[1.0, 0.0, 0.0], [np.sin(0.5), 0.0, np.cos(0.5)]])
    assert np.allclose(made.project(aside), [[319.5 + 320, 239.5], [319.5 + 0.5 * focal, 239.5]])


@pytest.mark.parametrize(
    "keys",
    [
        {"fov": 70.0},
        {"fov": 100.0, "distortion": (-0.1, 0.01, 0.001, -0.0005, 0.0)},
        {"projection": "fisheye", "fov": 220.0},
        {"projection": "fisheye", "fov": 160.0, "distortion": (0.05, -0.01, 0.002)},
    ],
)
def test_directions_and_projection_are_inverse(keys: dict[str, object]) -> None:
    made = lens(**keys)
    rng = np.random.default_rng(1)
    pixels = rng.uniform((0, 0), (639, 479), (500, 2))
    rays = made.directions(pixels)
    seen = np.isfinite(rays).all(axis=1)
    assert seen.mean() > 0.75
    assert np.allclose(np.linalg.norm(rays[seen], axis=1), 1)
    assert np.allclose(made.project(7.0 * rays[seen]), pixels[seen], atol=1e-3)


def test_a_fisheye_sees_nothing_beyond_its_circle() -> None:
    made = lens(projection="fisheye", fov=359.0, image_size_y=640)
    assert np.isnan(made.directions(np.array([[1.0, 1.0]]))).all()


K = {"fx": 400.0, "fy": 400.0, "cx": 399.5, "cy": 300.0}
"""Of 90 degrees in 800 pixels: 2 atan(400 / 400)."""


@pytest.mark.parametrize(
    ("keys", "message"),
    [
        ({"fov": 0.0}, "fov"),
        ({"fov": 360.0}, "fov"),
        ({"fov": 175.0}, "make projection fisheye"),
        ({"image_size_x": 0}, "image_size_x"),
        ({"image_size_x": 100_000}, "image_size_x"),
        ({"image_size_x": 8000, "image_size_y": 8000}, "over 12,600,000; lower them"),
        ({"image_size_x": 4000, "image_size_y": 3000, "samples": 4}, "over 12,600,000"),
        ({"distortion": (-0.9,)}, "folds back"),
        ({"distortion": (0.0, 0.0, 5.0)}, "folds back"),
        ({"projection": "fisheye", "fov": 180.0, "distortion": (-0.5,)}, "folds back"),
        ({"projection": "fisheye", "distortion": (0.0,) * 5}, "four coefficients"),
        ({"z_m": -0.5}, "z_m"),
        ({"preset": "polaroid"}, "polaroid' is unknown"),
        ({"images": ()}, "images"),
        ({"images": ("rgb", "rgb")}, "twice"),
        ({"images": ("infrared",)}, "images"),
        ({"intrinsics": {"fx": 0.0, "fy": 1.0, "cx": 0.0, "cy": 0.0}}, "fx"),
        ({"intrinsics": K | {"cx": 5000.0}}, "cx 5000 and cy 300, is outside the image of 800 by 600"),
        ({"intrinsics": K | {"cy": -1.0}}, "outside the image"),
        ({"intrinsics": K, "fov": 60.0}, "fov is 60, but intrinsics with fx 400 have 90.0 degrees in 800"),
        ({"preset": "kitti", "image_size_x": 400}, "give the intrinsics of this size"),
    ],
)
def test_bad_cameras_are_refused(keys: dict[str, object], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        CameraSensor.model_validate(keys)


def test_a_preset_gives_way_to_given_keys() -> None:
    camera = CameraSensor.model_validate({"preset": "kitti", "z_m": 2.0})
    assert (camera.image_size_x, camera.z_m, camera.lens().matrix[0, 0]) == (1242, 2.0, 721.5377)


def test_fov_or_intrinsics_replace_those_of_a_preset() -> None:
    wide = CameraSensor.model_validate({"preset": "kitti", "fov": 100.0})
    assert wide.intrinsics is None
    assert wide.lens().matrix[0, 0] == pytest.approx(621 / np.tan(np.deg2rad(50)))
    own = CameraSensor.model_validate({"preset": "front", "intrinsics": K | {"cx": 300.0, "cy": 180.0}})
    assert own.lens().matrix[0, 0] == 400.0


def test_fov_may_repeat_the_intrinsics_and_a_resolved_camera_is_read_again() -> None:
    assert CameraSensor.model_validate({"intrinsics": K, "fov": 90.0}).lens().matrix[0, 0] == 400.0
    made = CameraSensor.model_validate({"preset": "kitti"})
    assert CameraSensor.model_validate(made.model_dump(mode="json")) == made
