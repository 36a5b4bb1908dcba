"""GNSS against a filter of wheels, IMU and earlier fixes: single and windowed tests of innovations."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator

import numpy as np

from advpipe.pipeline.core.errors import AdvpipeError
from advpipe.pipeline.localisation.estimator import Estimator
from advpipe.pipeline.localisation.measurements import ImuSamples, Measurements, WheelTwist
from advpipe.pipeline.localisation.monitor import WINDOW_FIXES, nis_threshold
from advpipe.pipeline.scenario.sensors import Sensors
from advpipe.stages.investigate.cue import GNSS, Cue, CueReading
from advpipe.stages.investigate.evidence_topics import EvidenceKind
from advpipe.stages.investigate.observations import Observations
from advpipe.stages.investigate.situation import PriorKnowledge, Situation

MOST = 1e3


class GnssInnovationCue(Cue):
    """Runs a filter with the usual noise of such sensors, as the vehicle's own does not record innovations.

    The value is the larger of the normalised innovation squared over its threshold, of a fix, and the same
    summed over the last `WINDOW_FIXES`.
    """

    needs = (EvidenceKind.FIXES, EvidenceKind.WHEELS, EvidenceKind.IMU, EvidenceKind.INITIAL_POSE)
    meaning = "GNSS fixes against a filter of wheels, IMU and earlier fixes"

    def __init__(self, background: PriorKnowledge) -> None:
        super().__init__(background)
        self._estimator: Estimator | None = None
        if background.geodesy is not None and background.initial is not None:
            self._estimator = Estimator(Sensors(), background.geodesy, background.initial)
        self._nis: deque[float] = deque(maxlen=WINDOW_FIXES)

    def judge(self, situation: Situation) -> Iterator[CueReading]:
        measured = _measurements(situation.observed)
        if self._estimator is None or measured is None:
            return
        try:
            innovation = self._estimator.step(measured).innovation
        except (AdvpipeError, ArithmeticError, ValueError, np.linalg.LinAlgError):
            self._estimator = None  # it has diverged, and cannot judge from here on
            return
        if innovation is None:
            return
        self._nis.append(min(innovation.nis, MOST))
        single = innovation.nis / nis_threshold()
        windowed = sum(self._nis) / nis_threshold(len(self._nis))
        away_m = float(np.linalg.norm(innovation.residual_m[:2]))
        of = "a fix is" if single >= windowed else f"the last {len(self._nis)} fixes are"
        words = f"{of} farther from the prediction of wheels and IMU than noise explains (now {away_m:.1f} m)"
        yield CueReading(GNSS, situation.time_ns, min(max(single, windowed), MOST), words)


def _measurements(observed: Observations) -> Measurements | None:
    """What the filter's step takes; None for a period without the vehicle's sensors."""
    samples = sorted(observed.inertia, key=lambda one: one.time_ns)
    if not (samples or observed.twists or observed.fixes):
        return None
    imu = ImuSamples(
        np.array([one.time_ns for one in samples], np.int64),
        np.array([one.specific_force_mps2 for one in samples]).reshape(-1, 3),
        np.array([one.angular_rate_radps for one in samples]).reshape(-1, 3),
    )
    twist = observed.twists[-1] if observed.twists else None
    wheel = None if twist is None else WheelTwist(twist.speed_mps, twist.turn_rate_radps)
    fix = observed.fixes[-1].geographic if observed.fixes else None
    return Measurements(observed.time_ns, imu, wheel, fix)
