"""What is shipped as tuned fits both detectors, and comes from drives that nothing is tested on."""

from __future__ import annotations

from dataclasses import asdict

from advpipe.pipeline.misbehaviour import tuned
from advpipe.pipeline.misbehaviour.catch import CATCH_MEANINGS, TUNED_CATCH
from advpipe.pipeline.misbehaviour.config import CHECKS, THRESHOLDS, DetectorConfig
from advpipe.pipeline.misbehaviour.tuning import CATCH_RANGES
from advpipe.pipeline.scenario import shipped_scenarios


def test_every_check_has_a_threshold() -> None:
    assert set(tuned.THRESHOLDS) == {name for name, check in CHECKS.items() if check.is_tuned}
    assert list(THRESHOLDS) == list(CHECKS)
    assert all(THRESHOLDS[name] >= check.least for name, check in CHECKS.items())
    assert DetectorConfig().thresholds == THRESHOLDS


def test_the_baseline_is_within_what_tuning_tries() -> None:
    values = asdict(TUNED_CATCH)
    assert list(values) == list(CATCH_MEANINGS) == list(CATCH_RANGES)
    assert all(low <= values[name] <= high for name, (low, high) in CATCH_RANGES.items())


def test_nothing_shipped_was_tuned_on() -> None:
    assert tuned.DRIVES
    for drive in tuned.DRIVES:
        assert not drive.startswith(tuple(shipped_scenarios()))
