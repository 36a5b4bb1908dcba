"""What an attack on a vehicle's GPS does to its localisation, in figures, and whether the vehicle notices."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from advpipe.pipeline.geometry.transforms import Float64
from advpipe.pipeline.localisation.monitor import nis_threshold, windowed_alarms
from advpipe.pipeline.results.localisation import Errors, LocalisationRecord
from advpipe.stages.evaluate.localisation.track import Bool, LocalisationTrack

LOST_M = 5.0
"""An attack has succeeded where the estimate is farther off (TDRobertson's success rate for CARLA)."""


def errors(track: LocalisationTrack, chosen: Bool) -> Errors:
    """Of the estimates (K,) that are chosen."""
    error_m, lateral_m = track.error_m[chosen], np.abs(track.lateral_m[chosen])
    if not len(error_m):
        return Errors(*[float("nan")] * 6)
    horizontal_m = np.linalg.norm(error_m[:, :2], axis=1)
    return Errors(
        float(horizontal_m.mean()),
        _rms(horizontal_m),
        float(horizontal_m.max()),
        _rms(np.linalg.norm(error_m, axis=1)),
        float(lateral_m.mean()),
        float(lateral_m.max()),
    )


def localisation_record(
    bag: str,
    vehicle: str,
    clean: LocalisationTrack,
    adversarial: LocalisationTrack,
    attacked_ns: npt.NDArray[np.int64],
) -> LocalisationRecord:
    """attacked_ns: (A,), the times of the attacked fixes; both tracks are of the same times."""
    attacked = was_attacked(clean, attacked_ns)
    (steps,) = np.nonzero(attacked)
    span = np.zeros(len(attacked), dtype=bool)
    if len(steps):
        span[steps[0] : steps[-1] + 1] = True
    after = np.cumsum(attacked) > 0
    span_ns = clean.times_ns[span]
    known, alarm = np.isfinite(adversarial.nis), adversarial.nis > nis_threshold()
    window_alarm = windowed_alarms(adversarial.nis)
    everything = np.ones(len(attacked), dtype=bool)
    clean_all, adversarial_all = errors(clean, everything), errors(adversarial, everything)
    off_m = np.linalg.norm(adversarial.error_m[span][:, :2], axis=1)
    detection_rate = _share(alarm[attacked & known])
    return LocalisationRecord(
        bag=bag,
        vehicle=vehicle,
        fixes=int(np.isfinite(clean.nis).sum()),
        attacked=int(attacked.sum()),
        lost=int((attacked & ~known).sum()),
        span_s=float(span_ns[-1] - span_ns[0]) / 1e9 if len(span_ns) else 0.0,
        clean=errors(clean, span),
        adversarial=errors(adversarial, span),
        clean_all=clean_all,
        adversarial_all=adversarial_all,
        ate_clean_m=clean_all.ate_m,
        ate_m=adversarial_all.ate_m,
        detection_rate=detection_rate,
        stealth_rate=1 - detection_rate,
        false_alarm_rate=_share(clean.nis[np.isfinite(clean.nis)] > nis_threshold()),
        echo_rate=_share(alarm[after & ~attacked & known]),
        delay_s=_delay_s(adversarial, attacked, alarm),
        window_detection_rate=_share(window_alarm[attacked & known]),
        window_false_alarm_rate=_share(windowed_alarms(clean.nis)[np.isfinite(clean.nis)]),
        window_delay_s=_delay_s(adversarial, attacked, window_alarm),
        success_rate=_share(off_m > LOST_M),
    )


def was_attacked(track: LocalisationTrack, attacked_ns: npt.NDArray[np.int64]) -> Bool:
    """Which steps (K,) got an attacked fix: a fix counts for the first estimate at or after its time."""
    steps = np.searchsorted(track.times_ns, attacked_ns)
    attacked = np.zeros(len(track.times_ns), dtype=bool)
    attacked[steps[steps < len(attacked)]] = True
    return attacked


def _delay_s(track: LocalisationTrack, attacked: Bool, alarm: Bool) -> float:
    """From the first attacked fix to the first one with an alarm; NaN where there is none."""
    caught_ns = track.times_ns[attacked & alarm]
    return float(caught_ns[0] - track.times_ns[attacked][0]) / 1e9 if len(caught_ns) else float("nan")


def _rms(values: Float64) -> float:
    return float(np.sqrt(np.mean(np.square(values))))


def _share(hits: Bool) -> float:
    return float(hits.mean()) if len(hits) else float("nan")
