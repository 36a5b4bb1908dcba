"""Attacks that give themselves away are found, and the same ones put right are not."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from drives import ADDED, CLOUDS, at_end, write_data_set

from advpipe.pipeline.attack_detection.scan_order import places_in_scan, scan_order_of
from advpipe.pipeline.audit.registry import PROBES
from advpipe.pipeline.audit.run import audit
from advpipe.pipeline.core.errors import AdvpipeError

ADDS = {"points_added": (ADDED, ADDED), "points_removed": (0, 0), "max_off_ray_urad": (0, 0)}
ADDS |= {"max_displacement_m": (0, 0), "max_intensity_change": (0, 0)}
NOTHING = dict.fromkeys(ADDS, (0.0, 0.0))


def in_scan(clean, added):
    before = places_in_scan(clean, added, scan_order_of(clean))
    return np.insert(clean, before, added), before + np.arange(len(added))


@pytest.fixture(scope="module")
def told(tmp_path_factory) -> Path:
    return write_data_set(tmp_path_factory.mktemp("told"), 1, at_end, ADDS)


@pytest.fixture(scope="module")
def hidden(tmp_path_factory) -> Path:
    return write_data_set(tmp_path_factory.mktemp("hidden"), 2, in_scan, ADDS)


def test_points_at_the_end_are_found(told: Path) -> None:
    result = audit([told])
    found = {f"{each.unit}/{each.probe}": each for each in result.findings}
    assert {"point/place", "cloud/steps-back", "cloud/tail"} <= found.keys()
    place = found["point/place"]
    assert place.attacked == CLOUDS * ADDED
    assert place.area > 0.95 > place.low > 0.6
    assert "add: point/place" in str(place)
    assert not result.is_good
    assert json.loads(result.to_json())["findings"] == [str(each) for each in result.findings]


def test_points_in_the_order_of_the_scan_are_not(hidden: Path) -> None:
    result = audit([hidden])
    assert result.findings == ()
    assert {"cloud", "point", "chunk"} == {each.unit for each in result.results}
    assert not any(each.is_trained for each in result.results)


def test_more_points_are_implied_by_an_attack_that_declares_them(hidden: Path, tmp_path: Path) -> None:
    """Of about 384 points, 12 more are no leak that one drive shows: here, the reason alone counts."""
    (points,) = (each for each in audit([hidden]).results if (each.unit, each.probe) == ("cloud", "points"))
    assert points.reason == "add declares points added (points_added) of up to 12"
    silent = write_data_set(tmp_path, 3, in_scan, NOTHING)
    (points,) = (each for each in audit([silent]).results if (each.unit, each.probe) == ("cloud", "points"))
    assert points.reason == ""


def test_probes_learn_on_other_drives(told: Path, tmp_path: Path) -> None:
    other = write_data_set(tmp_path / "o", 4, at_end, ADDS)
    trained = audit([told], [other])
    assert all(each.is_trained for each in trained.results if each.unit == "point")
    assert "place" in {each.probe for each in trained.findings}
    both = audit([told, other])
    assert {each.attacked for each in both.results if each.unit == "point"} == {2 * CLOUDS * ADDED}
    assert all(each.is_trained for each in both.results if each.unit == "point")


def test_what_cannot_be_audited(told: Path, tmp_path: Path) -> None:
    with pytest.raises(AdvpipeError, match="given twice"):
        audit([told], [told])
    with pytest.raises(AdvpipeError, match="is not a data set"):
        audit([told / "clean"])
    (tmp_path / "d").mkdir()
    (tmp_path / "d" / "clean").symlink_to(told / "clean")
    with pytest.raises(AdvpipeError, match="no adversarial bag"):
        audit([tmp_path / "d"])
    (tmp_path / "d" / "add").mkdir()
    for path in (told / "add").iterdir():
        (tmp_path / "d" / "add" / path.name).write_bytes(path.read_bytes())
    (tmp_path / "d" / "add" / "labels.parquet").write_bytes(b"PAR1")
    with pytest.raises(AdvpipeError, match="not a complete Parquet file"):
        audit([tmp_path / "d"])


def test_names_are_unique() -> None:
    keys = [probe.key for probe in PROBES]
    assert len(keys) == len(set(keys))
