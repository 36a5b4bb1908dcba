"""The map's frame on the Earth, against the ellipsoid's own geometry."""

from __future__ import annotations

import numpy as np
import pyproj
import pytest

from advpipe.pipeline.localisation.geodesy import Geodesy


@pytest.mark.oracle
def test_distances_and_directions_agree_with_geodesics() -> None:
    geodesy = Geodesy(48.0, 11.0, 500.0)
    assert geodesy.to_geographic((0, 0, 0)) == pytest.approx([48.0, 11.0, 500.0], abs=1e-9)
    ellipsoid = pyproj.Geod(ellps="WGS84")
    for place in ((1000.0, 0.0, 5.0), (0.0, 1000.0, 0.0), (-300.0, -400.0, -2.0)):
        latitude, longitude, altitude = geodesy.to_geographic(place)
        azimuth_deg, _, distance_m = ellipsoid.inv(11.0, 48.0, longitude, latitude)
        assert distance_m == pytest.approx(np.hypot(place[0], place[1]), abs=1e-3)
        assert azimuth_deg == pytest.approx(np.rad2deg(np.arctan2(place[0], place[1])), abs=1e-4)
        assert altitude == 500.0 + place[2]


def test_there_and_back() -> None:
    geodesy = Geodesy(-33.9, 151.2, 20.0)
    place = np.array([1234.5, -987.6, 3.2])
    assert geodesy.to_map(geodesy.to_geographic(place)) == pytest.approx(place, abs=1e-6)
