"""Deletion: the returns of one target are cancelled."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from advpipe.pipeline.geometry.boxes import Boxes
from advpipe.pipeline.labels.scan_quantities import RETURNS_ADDED, RETURNS_CHANGED
from advpipe.pipeline.messages.radar import RadarReturns
from advpipe.pipeline.sensors.radar.association import returns_of_boxes
from advpipe.stages.attack.bounds import checked_number
from advpipe.stages.attack.radar.base import (
    AttackedScan,
    RadarAttack,
    RadarTraits,
    ScanAttacker,
    ScanContext,
    kept_returns,
)


@dataclass(frozen=True, kw_only=True)
class RadarDelete(RadarAttack):
    """Removes the returns of one road user, as a device on it that answers with the opposite phase would (the
    false negatives of Hunt et al., MadRadar, NDSS 2024).

    target: id of the road user; without one, that with returns that is nearest at the first attacked scan of
    a span. margin_m: returns so near its box vanish too. probability: that a return is cancelled. radar: the
    name of the attacked one; all of the victim without a name.
    """

    traits = RadarTraits()

    target: str = ""
    margin_m: float = 0.5
    probability: float = 1.0
    radar: str = ""

    def __post_init__(self) -> None:
        checked_number("radar-delete", "margin_m", self.margin_m, 0, 20)
        checked_number("radar-delete", "probability", self.probability, 0, 1)

    @property
    def bounds(self) -> dict[str, tuple[float, float]]:
        return {RETURNS_ADDED.name: (0, 0), RETURNS_CHANGED.name: (0, 0)}

    def begin(self, rng: np.random.Generator) -> ScanAttacker:
        """One draw for each return."""
        chosen = ""

        def delete(returns: RadarReturns, context: ScanContext) -> AttackedScan:
            nonlocal chosen
            boxes, draws = context.boxes(), rng.random(len(returns))
            near = returns_of_boxes(context.radar.section, returns, boxes, self.margin_m)
            if self.target:
                chosen = self.target
            elif context.elapsed_s == 0 or not chosen:
                chosen = nearest_with_returns(boxes, near)
            kept = np.ones(len(returns), bool)
            if chosen in boxes.ids:
                hit = near[boxes.ids.index(chosen)]
                kept[hit] = draws[hit] >= self.probability
            return kept_returns(returns, kept)

        return delete


def nearest_with_returns(boxes: Boxes, returns: list[np.ndarray]) -> str:
    """The id of the nearest box that has returns; "" if none has."""
    seen = [index for index, of_box in enumerate(returns) if len(of_box)]
    away_m = np.linalg.norm(boxes.geometry[seen, :2], axis=1)
    return boxes.ids[seen[int(np.argmin(away_m))]] if seen else ""
