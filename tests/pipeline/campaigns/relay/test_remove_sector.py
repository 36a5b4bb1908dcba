"""Sector removal."""

import numpy as np
import pytest
from relay_messages import cloud

from advpipe.pipeline.campaigns.relay.remove_sector import RemoveSector
from advpipe.pipeline.core.errors import UsageError
from advpipe.pipeline.detector.no_detector import NoDetector
from advpipe.pipeline.geometry.boxes import Boxes
from advpipe.stages.attack.lidar.result_checks import refuse_invalid, refuse_out_of_bounds


@pytest.mark.parametrize("centre_deg", [0.0, 90.0, -170.0, 180.0])
def test_only_the_sector_is_gone(centre_deg: float) -> None:
    attack = RemoveSector(width_deg=30, centre_deg=centre_deg, nearest_m=20, farthest_m=40)
    clean = cloud()
    result = attack(clean, Boxes(), NoDetector(), np.random.default_rng(0))
    degrees = np.degrees(np.arctan2(clean["y"], clean["x"]))
    off_deg = (degrees - centre_deg + 180) % 360 - 180
    distance_m = np.hypot(clean["x"], clean["y"])
    expected = (np.abs(off_deg) <= 15) & (distance_m >= 20) & (distance_m <= 40)
    assert 0 < expected.sum() < len(clean)
    assert np.array_equal(result.cloud, clean[~expected])
    assert result.labels.point.tolist() == np.flatnonzero(expected).tolist()
    refuse_invalid("remove-sector", clean, result)
    refuse_out_of_bounds("remove-sector", attack, clean, result)


def test_bad_parameters() -> None:
    with pytest.raises(UsageError, match="nearest_m 50 is not below farthest_m 40"):
        RemoveSector(nearest_m=50, farthest_m=40)
    with pytest.raises(UsageError, match="width_deg"):
        RemoveSector(width_deg=400)
