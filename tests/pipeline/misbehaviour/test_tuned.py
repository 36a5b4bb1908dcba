"""What is shipped as tuned fits both detectors, and comes from drives that nothing is tested on."""

from __future__ import annotations

from dataclasses import asdict

import pytest

from advpipe.pipeline.misbehaviour import tuned
from advpipe.pipeline.misbehaviour.catch import (
    BOUNDED_CATCH,
    CATCH_MEANINGS,
    F1_CATCH,
    PUBLISHED_CATCH,
    CatchParameters,
)
from advpipe.pipeline.misbehaviour.catch_tuning import CATCH_RANGES
from advpipe.pipeline.misbehaviour.config import CHECKS, THRESHOLDS, DetectorConfig
from advpipe.pipeline.misbehaviour.tuning import PARDON_S


def test_every_check_has_a_threshold() -> None:
    assert set(tuned.THRESHOLDS) == {name for name, check in CHECKS.items() if check.is_tuned}
    assert list(THRESHOLDS) == list(CHECKS)
    assert all(THRESHOLDS[name] >= check.least for name, check in CHECKS.items())
    assert DetectorConfig().thresholds == THRESHOLDS


def test_no_threshold_is_set_by_hand() -> None:
    assert list(tuned.CANDIDATES) == list(tuned.THRESHOLDS)
    assert all(tuned.THRESHOLDS[name] in levels for name, levels in tuned.CANDIDATES.items())
    assert {tuned.PARDON_S, tuned.ACCELERATION_PARDON_S} <= set(PARDON_S)


@pytest.mark.parametrize("parameters", [BOUNDED_CATCH, F1_CATCH, *PUBLISHED_CATCH.values()])
def test_the_baseline_is_within_what_tuning_tries(parameters: CatchParameters) -> None:
    values = asdict(parameters)
    assert list(values) == list(CATCH_MEANINGS) == list(CATCH_RANGES)
    assert all(low <= values[name] <= high for name, (low, high) in CATCH_RANGES.items())


def test_no_drive_that_the_benchmark_tests_was_tuned_on() -> None:
    assert tuned.DRIVES
    for drive in tuned.DRIVES:
        assert not drive.startswith(("boulevard", "highway", "town06-6", "town06-7"))
