import math

import numpy as np
import pyproj
import pytest

from advpipe.pipeline.geometry.transforms import se3_from_yaw
from advpipe.pipeline.localisation.geodesy import Geodesy
from advpipe.pipeline.v2x.facilities.reference_point import reference_point

GEODESY = Geodesy(48.0, 11.0, 500.0)
GEOD = pyproj.Geod(ellps="WGS84")


@pytest.mark.parametrize(
    ("yaw_deg", "heading_deg"), [(90, 0), (0, 90), (-90, 180), (180, 270), (60, 30), (91, 359)]
)
def test_the_reference_point_is_the_front_side_with_a_compass_heading(
    yaw_deg: float, heading_deg: float
) -> None:
    place = reference_point(GEODESY, se3_from_yaw([0, 0, 2], math.radians(yaw_deg)), 5.0)
    assert math.degrees(place.heading_rad) == pytest.approx(heading_deg, abs=1e-4)
    azimuth_deg, _, distance_m = GEOD.inv(11.0, 48.0, place.longitude_deg, place.latitude_deg)
    assert distance_m == pytest.approx(2.5, abs=1e-5)
    assert azimuth_deg % 360 == pytest.approx(heading_deg, abs=1e-3)
    assert place.altitude_m == pytest.approx(502)


def test_the_heading_is_to_true_north_away_from_the_origin() -> None:
    """20 km to the east, the grid's north is 0.2 degrees off; driving along the grid, the compass says so."""
    place = reference_point(GEODESY, se3_from_yaw([20_000, 0, 0], math.pi / 2), 4.0)
    converging_deg = pyproj.Proj("+proj=tmerc +lat_0=48 +lon_0=11 +k=1 +datum=WGS84").get_factors(
        place.longitude_deg, place.latitude_deg
    )
    expected_deg = converging_deg.meridian_convergence
    assert 0.15 < expected_deg < 0.25
    off_deg = math.remainder(math.degrees(place.heading_rad), 360)
    assert abs(off_deg) == pytest.approx(expected_deg, abs=1e-3)
    assert off_deg > 0


def test_on_a_slope_the_front_is_higher() -> None:
    map_SE3_base = se3_from_yaw([0, 0, 0], 0.0)
    map_SE3_base[:3, 0] = np.array([math.cos(0.1), 0.0, math.sin(0.1)])
    place = reference_point(GEODESY, map_SE3_base, 4.0)
    assert place.altitude_m == pytest.approx(500 + 2 * math.sin(0.1))
    assert place.heading_rad == pytest.approx(math.pi / 2, abs=2e-6)
