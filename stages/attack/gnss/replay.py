"""Fixes of a moment ago: a repeater of recorded signals (meaconing)."""

from __future__ import annotations

from bisect import bisect_right
from dataclasses import dataclass

import numpy as np

from advpipe.stages.attack.bounds import checked_number
from advpipe.stages.attack.gnss.base import GnssAttack, GnssTraits, Spoofer, SpoofingContext

NS_PER_S = 1e9


@dataclass(frozen=True, kw_only=True)
class GnssReplay(GnssAttack):
    """The place of the latest genuine fix that is at least delay_s old, or of the first one of all.

    delay_s: the 2 s of TDRobertson's REPLAY for CARLA. The message keeps its own stamp: the receiver does
    not know.
    """

    traits = GnssTraits()

    delay_s: float = 2.0

    def __post_init__(self) -> None:
        checked_number("gnss-replay", "delay_s", self.delay_s, 0, 1e6)

    def begin(self, rng: np.random.Generator) -> Spoofer:
        """Draws nothing."""

        def spoof(context: SpoofingContext) -> np.ndarray:
            until_ns = context.true_fixes[-1].stamp_ns - round(self.delay_s * NS_PER_S)
            after = bisect_right(context.true_fixes, until_ns, key=lambda fix: fix.stamp_ns)
            return context.true_fixes[max(after - 1, 0)].position_m

        return spoof
