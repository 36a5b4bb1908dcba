"""Fields of a CAM by what they claim, and which of them an attack did not declare."""

from __future__ import annotations

import pytest

from advpipe.pipeline.labels.claims import ALL_CLAIMS, CLAIM_FIELDS, undeclared_fields
from advpipe.pipeline.v2x.facilities.cam_values import FIELDS, OTHER


def test_every_field_states_one_claim() -> None:
    assert sorted(field for fields in CLAIM_FIELDS.values() for field in fields) == sorted(FIELDS)
    assert tuple(CLAIM_FIELDS) == ALL_CLAIMS


@pytest.mark.parametrize(
    ("changed", "untrue", "found"),
    [
        ("latitude_deg,longitude_deg", {"position"}, []),
        ("latitude_deg,speed_mps", {"position"}, ["speed_mps"]),
        ("latitude_deg,speed_mps", {"position", "speed"}, []),
        ("speed_mps", set(), ["speed_mps"]),
        (OTHER, {"heading"}, []),
        (OTHER, set(), [OTHER]),
        ("speed_mps", {"velocity"}, ["speed_mps"]),
    ],
)
def test_what_no_claim_covers(changed: str, untrue: set[str], found: list[str]) -> None:
    """What has no field of its own goes with any claim; a claim of another version covers nothing."""
    assert undeclared_fields(changed, frozenset(untrue)) == found
