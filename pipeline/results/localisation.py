"""What `report.json` lists as `localisation`."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

from advpipe.pipeline.results.listed import Flat, Listed


@dataclass(frozen=True)
class Errors:
    """Of the estimates at some times; NaN where there are none.

    mean_m, rmse_m, max_m: of the horizontal distance from the truth. ate_m: root mean square of the whole
    error, height included, without alignment. lateral_mean_m, lateral_max_m: of the size of the error
    across the direction of travel.
    """

    mean_m: float
    rmse_m: float
    max_m: float
    ate_m: float
    lateral_mean_m: float
    lateral_max_m: float


@dataclass(frozen=True)
class LocalisationRecord(Listed):
    """One vehicle in one adversarial bag.

    fixes: of the clean bag; attacked: those that say something else, lost: those of them that say nothing.
    The span goes from the first attacked fix to the last one: `clean` and `adversarial` are the errors of
    the estimates in it. ate_clean_m, ate_m: the unaligned absolute trajectory error of both tracks, which
    are of the whole drive or of a part of it. Without an attacked fix, the span is empty.

    detection_rate: of attacked fixes, the share that fails the innovation test; NaN where all were lost.
    stealth_rate: the share that passes it. false_alarm_rate: of the clean bag's fixes, the share that fails
    it; echo_rate: of genuine fixes after the first attacked one. delay_s: from the first attacked fix to the
    first one that fails; NaN where none does. success_rate: share of the span in which the estimate is
    more than `LOST_M` off.
    """

    bag: str
    vehicle: str
    fixes: int
    attacked: int
    lost: int
    span_s: float
    clean: Annotated[Errors, Flat("clean_")]
    adversarial: Annotated[Errors, Flat("adv_")]
    ate_clean_m: float
    ate_m: float
    detection_rate: float
    stealth_rate: float
    false_alarm_rate: float
    echo_rate: float
    delay_s: float
    success_rate: float
