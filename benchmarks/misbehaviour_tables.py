"""The tables that the benchmark of misbehaviour detection prints."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping

import numpy as np
import numpy.typing as npt
from scipy.stats import t as student_t

from advpipe.pipeline.misbehaviour.detectors import MISBEHAVIOUR_DETECTORS, OURS
from advpipe.pipeline.misbehaviour.scores import Scores
from advpipe.stages.evaluate.v2x.detection import Detection, DetectorResult

NAMES = list(MISBEHAVIOUR_DETECTORS)


def f1_beside_innocents(scores: Scores) -> float:
    """F1 in which only the messages of stations that do not attack count as false positives.

    Which of an attacker's own messages are false is a matter of the labels: NextGen's call a reversed heading
    of a standing car true.
    """
    errors = scores.innocent_flagged + scores.false_negatives
    found = 2 * scores.true_positives
    return found / (found + errors) if found + errors else math.nan


def print_table(
    title: str,
    found: Mapping[str, Mapping[str, Detection]],
    value: Callable[[DetectorResult], float],
) -> dict[str, dict[str, float]]:
    """Print the means over drives with their intervals; return the means by attack and detector.

    found: results by drive and attack.
    """
    attack_names = list(dict.fromkeys(name for each in found.values() for name in each))
    means: dict[str, dict[str, float]] = {}
    print(f"\n| {title} of | false messages | " + " | ".join(NAMES) + " |")
    print("|---" * (len(NAMES) + 2) + "|")
    for attack_name in sorted(attack_names):
        drives = [each[attack_name] for each in found.values() if attack_name in each]
        drives = [each for each in drives if each.false_messages]
        if not drives:
            continue
        values = {name: np.array([value(each.detectors[name]) for each in drives]) for name in NAMES}
        means[attack_name] = {name: float(each.mean()) for name, each in values.items()}
        count = sum(each.false_messages for each in drives)
        print(f"| `{attack_name}` | {count} | " + " | ".join(map(_with_interval, values.values())) + " |")
    return means


def print_lead(found: Mapping[str, Mapping[str, Detection]], attack_name: str) -> None:
    """Print by how much our F1 is above each other's, on the same drives."""
    drives = [each[attack_name].detectors for each in found.values() if attack_name in each]
    for name in NAMES:
        lead = np.array([each[OURS].scores.f1 - each[name].scores.f1 for each in drives])
        if name != OURS and len(lead):
            print(f"`{attack_name}`: F1 above {name} by {_with_interval(lead)}")


def print_honest(clean: Mapping[str, Detection]) -> float:
    """Print what is flagged where nobody attacks; return our largest share."""
    print("\n| honest drive, flagged % | messages | " + " | ".join(NAMES) + " |")
    print("|---" * (len(NAMES) + 2) + "|")
    for name, each in clean.items():
        shares = (f"{100 * each.detectors[n].scores.false_positive_rate:.2f}" for n in NAMES)
        print(f"| {name} | {each.messages} | " + " | ".join(shares) + " |")
    return max(each.detectors[OURS].scores.false_positive_rate for each in clean.values())


def _with_interval(values: npt.NDArray[np.float64]) -> str:
    """The mean, and half the width of its 95 % interval by Student's t."""
    if len(values) < 2:
        return f"{values.mean():.3f}"
    half = student_t.ppf(0.975, len(values) - 1) * values.std(ddof=1) / math.sqrt(len(values))
    return f"{values.mean():.3f} ± {half:.3f}"
