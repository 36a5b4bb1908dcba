"""Sentences that several parts of a report need: what its random baselines are, what lost means."""

from __future__ import annotations

from typing import NamedTuple

from advpipe.pipeline.results.row import ResultRow

PLAIN_RANDOM = "plain random"
"""The baselines that every report scores, in few words; beside them there is recipe `random-best`."""

RANDOM_BEST = (
    "The random baselines here are the plain ones: anywhere, near objects and, where points are moved, every "
    "point; each as one draw and as the best of several tries. The first draw fixes how much of the budget "
    "each object gets, and tries are chosen by what is found at strict overlap. Recipe random-best, which "
    "draws blindly too but spends the budget and keeps the best try for each object as recipe best does, is "
    "stronger than these and is not among them: `--recipe random-best` of `advpipe attack` and `advpipe "
    "sweep` scores it like an attack."
)

WHITE_BOX = (
    "The attacker knows more than the detector's weights: LiDAR attacks are given the true boxes, and "
    "recipes best, robust and random-best also the rule that matches detections to them."
)

OVERLAPS = "3D IoU of cars and trucks 0.7 (strict) or 0.5 (loose), of people and two-wheelers 0.5 or 0.25"


def lost_means(min_score: object) -> str:
    """What counts as lost in a table, with its overlap and its score."""
    score = f"{min_score:.2f}" if isinstance(min_score, float | int) else "the working score"
    return f"at loose overlap and a score of at least {score}"


class Change(NamedTuple):
    """What was done to the points of clouds, as the subject of a sentence and as a title has it."""

    active: str
    passive: str


def changed_points(row: ResultRow) -> Change | None:
    """What the attack did, measured over all frames; None where it changed no point."""
    metrics, clean = row.attacked, row.counts.points_clean
    if metrics is None or not clean:
        return None
    reach = f"by at most {100 * metrics.max_displacement_m:.3g} cm"
    parts = [
        (active.format(_share(100 * count / clean)), passive.format(_share(100 * count / clean)))
        for count, active, passive in (
            (metrics.points_removed, "removing {} of the LiDAR points", "{} of the LiDAR points removed"),
            (metrics.points_added, "adding {} LiDAR points", "{} LiDAR points added"),
            (
                metrics.points_moved,
                f"moving {{}} of the LiDAR points {reach}",
                f"{{}} of the LiDAR points moved {reach}",
            ),
        )
        if count
    ]
    if not parts:
        return None
    active, passive = (" and ".join(part[side] for part in parts) for side in (0, 1))
    return Change(active[0].upper() + active[1:], passive)


def _share(percent: float) -> str:
    """To two digits, such as `0.99 %`."""
    return f"{percent:.2g} %" if percent < 99.5 else "all" if percent == 100 else f"{percent:.1f} %"
