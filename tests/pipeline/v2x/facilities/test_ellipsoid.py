import math

import numpy as np
import pyproj
import pytest

from advpipe.pipeline.v2x.facilities.ellipsoid import east_north_m


def test_distance_and_direction_equal_the_geodesic() -> None:
    geod, rng = pyproj.Geod(ellps="WGS84"), np.random.default_rng(0)
    for _ in range(300):
        latitude, longitude, azimuth = rng.uniform(-80, 80), rng.uniform(-180, 180), rng.uniform(-180, 180)
        far_longitude, far_latitude, _ = geod.fwd(longitude, latitude, azimuth, 100)
        east_m, north_m = east_north_m(latitude, longitude, far_latitude, far_longitude)
        assert math.hypot(east_m, north_m) == pytest.approx(100, abs=1e-4)
        off_deg = math.remainder(math.degrees(math.atan2(east_m, north_m)) - azimuth, 360)
        assert abs(off_deg) < 0.003
