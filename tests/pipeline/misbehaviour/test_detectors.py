"""The detectors by name, and a user's own."""

from __future__ import annotations

import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from advpipe.pipeline.core.errors import AdvpipeError, UsageError
from advpipe.pipeline.misbehaviour.claim import Claim, ReceivingVehicle
from advpipe.pipeline.misbehaviour.config import CHECKS
from advpipe.pipeline.misbehaviour.detector import PlausibilityDetector
from advpipe.pipeline.misbehaviour.detectors import MISBEHAVIOUR_DETECTORS, misbehaviour_detectors

Make = Callable[..., Claim]

OWN = """
import numpy as np
from advpipe import Verdicts


class Fast:
    def judge(self, claims, receivers):
        scores = np.array([abs(claim.speed_mps) for claim in claims])
        return Verdicts(scores, scores > 25.0)


class Silent:
    def judge(self, claims, receivers):
        {body}


class Broken:
    def __init__(self):
        raise RuntimeError("no weights")

    def judge(self, claims, receivers):
        pass


class Nothing:
    pass
"""


@pytest.fixture
def own(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Callable[..., None]:
    def write(body: str = "return None") -> None:
        (tmp_path / "judges.py").write_text(OWN.replace("{body}", body))
        monkeypatch.chdir(tmp_path)
        monkeypatch.syspath_prepend(str(tmp_path))
        monkeypatch.delitem(sys.modules, "judges", raising=False)

    return write


@pytest.mark.parametrize("name", MISBEHAVIOUR_DETECTORS)
def test_every_detector_finds_a_jump(name: str, make: Make, ego: ReceivingVehicle) -> None:
    claims = [make(0.4 * n, x_m=4.0 * n + (60.0 if n == 9 else 0.0)) for n in range(10)]
    found = MISBEHAVIOUR_DETECTORS[name].judge(claims, [ego] * 10)
    assert found.flagged.tolist() == [False] * 9 + [True]
    assert found.scores.argmax() == 9
    assert np.isfinite(found.scores).all()


def test_our_score_is_above_one_where_a_check_flags(make: Make, ego: ReceivingVehicle) -> None:
    claims = [make(0.4 * n, x_m=4.0 * n + (60.0 if n >= 5 else 0.0)) for n in range(10)]
    found = PlausibilityDetector().judge([*claims, Claim(-1, 0, 0)], [ego] * 11)
    assert ((found.scores > 1) == found.flagged).all()
    assert list(found.checks) == list(CHECKS)
    flagged = np.any([check.flagged for check in found.checks.values()], axis=0)
    assert (flagged == found.flagged).all()
    assert found.checks["decoding"].flagged.tolist() == [False] * 10 + [True]


def test_no_messages(ego: ReceivingVehicle) -> None:
    for detector in MISBEHAVIOUR_DETECTORS.values():
        found = detector.judge([], [])
        assert (found.scores.shape, found.flagged.shape) == ((0,), (0,))


def test_a_users_own(own: Callable[..., None], make: Make, ego: ReceivingVehicle) -> None:
    own()
    found = misbehaviour_detectors(["judges:Fast"])
    assert list(found) == [*MISBEHAVIOUR_DETECTORS, "judges:Fast"]
    verdicts = found["judges:Fast"].judge([make(), make(speed_mps=30.0)], [ego] * 2)
    assert verdicts.flagged.tolist() == [False, True]


@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("fast", "misbehaviour detector 'fast' is unknown; name your own as module:Class"),
        ("judges:Slow", "misbehaviour detector judges:Slow cannot be loaded: AttributeError"),
        ("judges:Nothing", "misbehaviour detector judges:Nothing has no method judge"),
        ("judges:Broken", r"judges:Broken failed: RuntimeError: no weights \(judges.py, line \d+\); fix it"),
        ("advpipe", "misbehaviour detector advpipe is there already"),
    ],
)
def test_what_is_no_detector(name: str, message: str, own: Callable[..., None]) -> None:
    own()
    with pytest.raises(AdvpipeError, match=message):
        misbehaviour_detectors([name])


def test_a_name_is_given_once(own: Callable[..., None]) -> None:
    own()
    with pytest.raises(UsageError, match="is there already"):
        misbehaviour_detectors(["judges:Fast", "judges:Fast"])


@pytest.mark.parametrize(
    ("body", "message"),
    [
        ("return None", "TypeError: judge returned NoneType instead of Verdicts"),
        ("return Verdicts(np.zeros(1), np.zeros(2, bool))", r"scores has the shape \(1,\), not \(2,\)"),
        ("return Verdicts(np.zeros(2), np.zeros(2))", "TypeError: flagged is no array of bool"),
        ("return Verdicts(np.full(2, np.nan), np.zeros(2, bool))", "scores has NaN"),
        ("return 1 / 0", "ZeroDivisionError"),
    ],
)
def test_mistakes_of_a_users_own_are_one_line(
    body: str, message: str, own: Callable[..., None], make: Make, ego: ReceivingVehicle
) -> None:
    own(body)
    detector = misbehaviour_detectors(["judges:Silent"])["judges:Silent"]
    with pytest.raises(AdvpipeError, match=f"judges:Silent failed: .*{message}"):
        detector.judge([make(), make(0.4)], [ego] * 2)
