"""How well the misbehaviour detector and the baseline tell lies from honest messages, per attack."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from advpipe.pipeline.misbehaviour.catch import CatchParameters, catch_flags, catch_messages
from advpipe.pipeline.misbehaviour.config import CHECKS, DetectorConfig
from advpipe.pipeline.misbehaviour.detector import judge_all
from advpipe.pipeline.misbehaviour.scores import Bools, Scores, scores
from advpipe.stages.evaluate.v2x.labels import MessageLabel, lies
from advpipe.stages.evaluate.v2x.receptions import Receptions

PUBLISHED_CATCH_F1 = {
    "cam-position-random-offset": 0.940,
    "cam-speed-constant": 0.907,  # with speed_mps: 0, as there
    "cam-position-offset": 0.846,
    "cam-speed-random-offset": 0.808,
    "cam-speed-offset": 0.637,
    "cam-heading-reversed": 0.593,
    "cam-dos": 0.353,
    "cam-speed-frozen": 0.284,
    "cam-replay": 0.273,
    "cam-sybil-congestion": 0.259,
    "cam-position-mirrored": 0.192,
    "cam-delay": 0.062,
    "cam-acceleration": 0.050,
    "cam-sudden-stop": 0.029,
    "cam-feigned-braking": 0.027,
}
"""CaTCH in the documentation of VeReMi NextGen: urban traffic, low density. Other data than ours: for
orientation, not for comparison."""


@dataclass(frozen=True)
class Detection:
    """What two detectors made of the messages that all listeners of a bag received.

    attack: empty for a clean bag. messages, lies: received. by_attack: of each attack in a bag of several,
    the share of its lies that is flagged. objections: flagged lies by the check that objects, most first.
    """

    attack: str
    messages: int
    lies: int
    ours: Scores
    baseline: Scores
    by_attack: dict[str, float]
    objections: dict[str, int]


def detect(
    receptions: Sequence[Receptions],
    labels: Sequence[MessageLabel] = (),
    config: DetectorConfig | None = None,
    parameters: CatchParameters | None = None,
) -> Detection:
    """Runs both detectors over what each listener received, and compares with the labels."""
    config, parameters = config or DetectorConfig(), parameters or CatchParameters()
    ours, theirs, truth, liars, times_s, numbers = [], [], [], [], [], []
    objections: Counter[str] = Counter()
    for place, each in enumerate(receptions):
        judged = judge_all(each.claims, each.receivers, config)
        is_lie = lies(each.numbers, labels)
        ours.append(judged.flagged)
        theirs.append(catch_flags(catch_messages(each.claims, each.receivers), parameters))
        truth.append(is_lie)
        liars.append([place * 2**32 + one.sent.station_id for one in each.received])
        times_s.append([one.arrival_ns / 1e9 for one in each.received])
        numbers += each.numbers
        counts = judged.because(config)[is_lie].sum(axis=0).tolist()
        objections.update(dict(zip(CHECKS, counts, strict=True)))
    is_lie = _joined(truth, bool)
    who, when_s = _joined(liars, np.int64), _joined(times_s, np.float64)
    return Detection(
        " + ".join(sorted({label.attack for label in labels})),
        len(is_lie),
        int(is_lie.sum()),
        scores(_joined(ours, bool), is_lie, who, when_s),
        scores(_joined(theirs, bool), is_lie, who, when_s),
        _by_attack(numbers, labels, _joined(ours, bool)),
        {name: count for name, count in objections.most_common() if count},
    )


def _by_attack(numbers: list[int], labels: Sequence[MessageLabel], flagged: Bools) -> dict[str, float]:
    shares = {}
    for attack in sorted({label.attack for label in labels}):
        own = lies(numbers, [label for label in labels if label.attack == attack])
        shares[attack] = float(flagged[own].mean()) if own.any() else math.nan
    return shares


def _joined(parts: Sequence[Any], kind: type) -> np.ndarray[Any, np.dtype[Any]]:
    return np.concatenate([np.asarray(part, kind) for part in parts]) if parts else np.zeros(0, kind)
