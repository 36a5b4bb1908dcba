"""Clouds of a small rotating LiDAR whose every ray a person can work out: 8 rings of 120 columns, 2 m above
flat ground, before a wall at x = 20 m."""

import numpy as np

from advpipe.pipeline.detector.protocol import Detections
from advpipe.pipeline.messages.cloud import POINT_DTYPE

COLUMNS, ELEVATIONS_DEG = 120, (-20.0, -16.0, -12.0, -9.0, -6.0, -4.0, -2.0, -1.0)
NOTHING = Detections(np.zeros((0, 7)), np.zeros(0), np.zeros(0, np.int64))


def rays():
    """Unit vectors (R, 3) and rings (R,), column by column."""
    azimuth, elevation = np.meshgrid(
        2 * np.pi * np.arange(COLUMNS) / COLUMNS - np.pi, np.deg2rad(ELEVATIONS_DEG), indexing="ij"
    )
    flat = np.cos(elevation)
    directions = np.stack([flat * np.cos(azimuth), flat * np.sin(azimuth), np.sin(elevation)], axis=-1)
    rings = np.broadcast_to(np.arange(len(ELEVATIONS_DEG)), azimuth.shape)
    return directions.reshape(-1, 3), rings.ravel()


def ranges(directions):
    """The distance along each ray to the ground or the wall."""
    with np.errstate(divide="ignore"):
        wall_m = np.where(directions[:, 0] > 0, 20 / directions[:, 0], np.inf)
    return np.minimum(-2 / directions[:, 2], wall_m)


def cloud_of(range_m, directions, rings, intensity=0.5):
    cloud = np.zeros(len(range_m), POINT_DTYPE)
    cloud["x"], cloud["y"], cloud["z"] = (directions * range_m[:, None]).T
    cloud["ring"], cloud["intensity"] = rings, intensity
    return cloud


def turn(seed=0, loss=0.05, noise_m=0.02):
    """A clean cloud with range noise, some returns lost at random."""
    rng = np.random.default_rng(seed)
    directions, rings = rays()
    range_m = ranges(directions) + noise_m * rng.standard_normal(len(directions))
    return cloud_of(range_m, directions, rings)[rng.random(len(directions)) >= loss]


def knowledge(grid=None, turns=4):
    from advpipe.pipeline.attack_detection.base import DefenderKnowledge

    return DefenderKnowledge([turn(seed) for seed in range(100, 100 + turns)], grid)
