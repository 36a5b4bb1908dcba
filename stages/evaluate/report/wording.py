"""Sentences that several parts of a report need: what its random baselines are, what lost means."""

from __future__ import annotations

import re
from typing import NamedTuple

from advpipe.pipeline.results.row import ResultRow

TO_BEAT = "random-best"
"""The baseline that cards, verdicts and intervals compare an attack with."""

OLDER_BASELINES = (
    "Figures of older versions have no random-best: beside them stands the strongest of the plain random "
    "baselines, the best of several whole draws, which is weaker."
)

ABOUT_BASELINES = (
    "The baseline to beat is random-best: it draws at random, judges as many tries as recipe best of the "
    "attack (or as --baseline-tries says), keeps the best for each object and allocates the budget to the "
    "objects as recipe best does; recipe random-best of advpipe attack is the same. The other random "
    "baselines are one draw each: anywhere, near objects and, where points are moved, every point."
)

WHITE_BOX = (
    "The attacker knows more than the detector's weights: LiDAR attacks are given the true boxes, or, with "
    "--truth detections, what the detector finds in the clean cloud; and recipes that judge their tries "
    "(best, hide, robust, stealthy, transfer and random-best) also the rule that matches detections to them. "
    "The recipes score-based and decision-based know none of this, only what the detector answers."
)

OVERLAPS = "3D IoU of cars and trucks 0.7 (strict) or 0.5 (loose), of people and two-wheelers 0.5 or 0.25"


def lost_means(min_score: object) -> str:
    """What counts as lost in a table, with its overlap and its score."""
    score = f"{min_score:.2f}" if isinstance(min_score, float | int) else "the working score"
    return f"at loose overlap and a score of at least {score}"


def marks_mean(min_score: float, is_attacked: bool) -> str:
    """What the marked objects of a frame are, without a full stop."""
    what = "Lost" if is_attacked else "Missed"
    text = (
        f"{what}: no box with a score of at least {min_score:.2f} at loose overlap "
        "(3D IoU 0.5; people and two-wheelers 0.25)"
    )
    if not is_attacked:
        return text
    return f"{text}; displaced: none at strict overlap (0.7; 0.5). Labels: the best box left"


class Change(NamedTuple):
    """What was done to the points of clouds: as the subject of a sentence, after "the attack", in a title."""

    active: str
    does: str
    passive: str


def changed_points(row: ResultRow) -> Change | None:
    """What the attack did, measured over all frames; None where it changed no point."""
    metrics, clean = row.attacked, row.counts.points_clean
    if metrics is None or not clean:
        return None
    reach = f"by at most {100 * metrics.max_displacement_m:.3g} cm"
    parts = [
        [each.format(_share(100 * count / clean)) for each in forms]
        for count, forms in (
            (metrics.points_removed, _forms("removing", "removes", "removed", "of the LiDAR points")),
            (metrics.points_added, _forms("adding", "adds", "added", "more LiDAR points")),
            (metrics.points_moved, _forms("moving", "moves", "moved", "of the LiDAR points", reach)),
        )
        if count
    ]
    if not parts:
        return None
    active, does, passive = (" and ".join(part[side] for part in parts) for side in (0, 1, 2))
    return Change(active[0].upper() + active[1:], does, passive)


def _forms(active: str, does: str, passive: str, points: str, how: str = "") -> tuple[str, str, str]:
    return (
        f"{active} {{}} {points} {how}".strip(),
        f"{does} {{}} {points} {how}".strip(),
        f"{{}} {points} {passive} {how}".strip(),
    )


V2X_DEEDS = {
    "dos": "floods the radio channel with V2X messages",
    "ghost": "announces ghost vehicles, which do not exist, in V2X messages",
    "sybil": "announces ghost vehicles, which do not exist, in V2X messages",
    "position": "announces false positions in V2X messages",
    "speed": "announces false speeds in V2X messages",
    "heading": "announces false headings in V2X messages",
    "replay": "repeats V2X messages of other vehicles",
    "drop": "withholds V2X messages",
    "delay": "sends V2X messages late",
    "stale": "repeats old V2X messages",
}
"""What an attack on V2X does, by a word in its name; the first that fits."""


def v2x_deed(names: str) -> str:
    """What an attack or several of these names do to V2X messages, after "the attack"."""
    words = set(re.split(r"[^a-z0-9]+", names))
    return next((deed for word, deed in V2X_DEEDS.items() if word in words), "sends false V2X messages")


def _share(percent: float) -> str:
    """To two digits, such as `0.99 %`."""
    return f"{percent:.2g} %" if percent < 99.5 else "all" if percent == 100 else f"{percent:.1f} %"
