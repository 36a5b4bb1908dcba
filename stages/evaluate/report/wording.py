"""Sentences that several parts of a report need: what its random baselines are, what lost means."""

from __future__ import annotations

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
