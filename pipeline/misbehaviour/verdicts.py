"""What a misbehaviour detector is asked, and what it answers."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Protocol

import numpy as np
import numpy.typing as npt

from advpipe.pipeline.geometry.transforms import Float64
from advpipe.pipeline.misbehaviour.claim import Claim, ReceivingVehicle
from advpipe.pipeline.misbehaviour.scores import Bools


@dataclass(frozen=True)
class CheckVerdicts:
    """What one check says of M messages.

    scores: (M,), larger for what is less plausible; NaN where the check does not apply. flagged: (M,).
    """

    scores: Float64
    flagged: Bools


@dataclass(frozen=True)
class Verdicts:
    """What a detector says of M messages.

    scores: (M,), larger for what is less trustworthy, by which the ROC curve orders messages; no NaN.
    flagged: (M,), which messages the detector would not trust. checks: by name, for a detector that has some.
    """

    scores: Float64
    flagged: Bools
    checks: Mapping[str, CheckVerdicts] = field(default_factory=dict)


class MisbehaviourDetector(Protocol):
    """Judges received CAMs; shipped ones and users' own have this method alone."""

    def judge(self, claims: Sequence[Claim], receivers: Sequence[ReceivingVehicle]) -> Verdicts:
        """The verdicts on all messages of one receiver, which come in order of arrival.

        receivers: the receiver's own state at each arrival; as many as claims. A call knows nothing of the
        one before: each is about another receiver.
        """


def refuse_wrong_verdicts(found: object, messages: int) -> None:
    """Raises TypeError or ValueError for what are no verdicts on so many messages."""
    if not isinstance(found, Verdicts):
        raise TypeError(f"judge returned {type(found).__name__} instead of Verdicts")
    _refuse_array("scores", found.scores, messages, np.floating)
    _refuse_array("flagged", found.flagged, messages, np.bool_)
    if np.isnan(found.scores).any():
        raise ValueError("scores has NaN, which no ROC curve can order")
    for name, check in found.checks.items():
        _refuse_array(f"scores of {name}", check.scores, messages, np.floating)
        _refuse_array(f"flagged of {name}", check.flagged, messages, np.bool_)


def _refuse_array(name: str, values: npt.NDArray[np.generic], messages: int, kind: type[np.generic]) -> None:
    if not isinstance(values, np.ndarray) or not np.issubdtype(values.dtype, kind):
        raise TypeError(f"{name} is no array of {kind.__name__}")
    if values.shape != (messages,):
        raise ValueError(f"{name} has the shape {values.shape}, not ({messages},)")
