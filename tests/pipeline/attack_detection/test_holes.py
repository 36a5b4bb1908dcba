"""Holes in a surface, by hand."""

from __future__ import annotations

import numpy as np

from advpipe.pipeline.attack_detection.holes import surface_holes
from advpipe.pipeline.attack_detection.range_image import RangeImage


def wall(rows: int = 5, columns: int = 12) -> RangeImage:
    """A bright wall around the sensor, 10 m away."""
    shape = (rows, columns)
    return RangeImage(
        np.zeros(0, np.int64), np.ones(shape, np.int64), np.full(shape, 10.0), np.full(shape, 0.3)
    )


def without(image: RangeImage, *rays: tuple[int, int]) -> RangeImage:
    """The same with rays that do not return."""
    for ray in rays:
        image.count[ray], image.range_m[ray], image.intensity[ray] = 0, np.nan, np.nan
    return image


def test_a_wall_has_no_holes() -> None:
    found = surface_holes(wall())
    assert found.surface.all()
    assert not found.holes.any()


def test_single_lost_rays_are_holes_also_across_the_seam() -> None:
    found = surface_holes(without(wall(), (2, 5), (3, 0)))
    assert np.argwhere(found.holes).tolist() == [[2, 5], [3, 0]]


def test_the_edge_of_a_surface_is_no_hole() -> None:
    """Beyond column 6, there is another wall, 15 m away, and the ray between them is lost."""
    image = without(wall(), *((row, 6) for row in range(5)))
    image.range_m[:, 7:] = 15.0
    assert not surface_holes(image).holes.any()


def test_rays_on_dark_surfaces_vanish_by_themselves() -> None:
    image = without(wall(), (2, 5))
    image.intensity[1:4, 4:7] = 0.05
    assert not surface_holes(image).holes.any()
