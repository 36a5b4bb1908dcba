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

    mean_m: Annotated[float, "mean horizontal error of the estimate, in metres"]
    rmse_m: Annotated[float, "root mean square of the horizontal error, in metres"]
    max_m: Annotated[float, "largest horizontal error, in metres"]
    ate_m: Annotated[float, "root mean square of the error in 3D, without alignment, in metres"]
    lateral_mean_m: Annotated[float, "mean size of the error across the direction of travel, in metres"]
    lateral_max_m: Annotated[float, "largest error across the direction of travel, in metres"]


@dataclass(frozen=True)
class LocalisationRecord(Listed):
    """One vehicle in one adversarial bag.

    fixes: of the clean bag; attacked: those that say something else, lost: those of them that say nothing.
    The span goes from the first attacked fix to the last one: `clean` and `adversarial` are the errors of
    the estimates in it, `clean_all` and `adversarial_all` of all, attacked or not. ate_clean_m, ate_m: the
    unaligned absolute trajectory error of both tracks, which are of the whole drive or of a part of it.
    Without an attacked fix, the span is empty.

    detection_rate: of attacked fixes, the share that fails the innovation test; NaN where all were lost.
    stealth_rate: the share that passes it. false_alarm_rate: of the clean bag's fixes, the share that fails
    it; echo_rate: of genuine fixes after the first attacked one. delay_s: from the first attacked fix to the
    first one that fails; NaN where none does. window_...: the same of the windowed test, which adds up the
    innovations of the last fixes. success_rate: share of the span in which the estimate is
    more than `LOST_M` off.
    """

    bag: Annotated[str, "adversarial bag"]
    vehicle: Annotated[str, "attacked vehicle"]
    fixes: Annotated[int, "number of GNSS fixes in the clean bag"]
    attacked: Annotated[int, "number of attacked fixes: changed or lost"]
    lost: Annotated[int, "number of attacked fixes without a position"]
    span_s: Annotated[float, "time from the first attacked fix to the last, in seconds"]
    clean: Annotated[Errors, Flat("clean_", "clean bag, from the first attacked fix to the last: ")]
    adversarial: Annotated[Errors, Flat("adv_", "attacked bag, from the first attacked fix to the last: ")]
    clean_all: Annotated[Errors, Flat("clean_all_", "clean bag, whole drive or window: ")]
    adversarial_all: Annotated[Errors, Flat("adv_all_", "attacked bag, whole drive or window: ")]
    ate_clean_m: Annotated[
        float,
        "absolute trajectory error in the clean bag, whole drive or window, without alignment, in metres",
    ]
    ate_m: Annotated[float, "the same in the attacked bag, in metres"]
    detection_rate: Annotated[
        float, "share of attacked fixes that fail the innovation test, in [0, 1]; null where all were lost"
    ]
    stealth_rate: Annotated[float, "share of attacked fixes that pass the innovation test, in [0, 1]"]
    false_alarm_rate: Annotated[
        float, "share of the clean bag's fixes that fail the innovation test, in [0, 1]"
    ]
    echo_rate: Annotated[
        float, "share of genuine fixes after the first attacked one that fail the test, in [0, 1]"
    ]
    delay_s: Annotated[
        float, "time from the first attacked fix to the first one that fails the test, in seconds"
    ]
    window_detection_rate: Annotated[
        float, "share of attacked fixes at which the windowed test fails, in [0, 1]; null where all were lost"
    ]
    window_false_alarm_rate: Annotated[
        float, "share of the clean bag's fixes at which the windowed test fails, in [0, 1]"
    ]
    window_delay_s: Annotated[
        float,
        "time from the first attacked fix to the first one at which the windowed test fails, in seconds",
    ]
    success_rate: Annotated[float, "share of the span in which the estimate is more than 5 m off, in [0, 1]"]
