"""Jamming: noise in the radar's band raises its noise floor."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from advpipe.pipeline.messages.radar import RadarReturns
from advpipe.stages.attack.bounds import checked_number
from advpipe.stages.attack.radar.base import AttackedScan, RadarAttack, RadarTraits, ScanAttacker, ScanContext

PLACE = ("range", "azimuth", "elevation", "velocity")


@dataclass(frozen=True, kw_only=True)
class RadarJam(RadarAttack):
    """Raises the noise floor: the CFAR's threshold rises with it, so that weak targets vanish, strong ones
    are measured less well, and false alarms stay as many (Yan, Xu and Liu, Can you trust autonomous vehicles,
    DEF CON 24, 2016).

    The amplitude is over the noise, so that it falls, and with it the RCS that the radar works out from it.

    noise_rise_db: by how much; 20 dB shorten the range of detection by a factor of 3.2. radar: the name of
    the attacked one; all of the victim without a name.
    """

    traits = RadarTraits()

    noise_rise_db: float = 20.0
    radar: str = ""

    def __post_init__(self) -> None:
        checked_number("radar-jam", "noise_rise_db", self.noise_rise_db, 0.1, 100)

    def begin(self, rng: np.random.Generator) -> ScanAttacker:
        """New noise in every scan."""
        floor = 10 ** (self.noise_rise_db / 10)

        def jam(returns: RadarReturns, context: ScanContext) -> AttackedScan:
            before = 10 ** (returns["amplitude"].astype(np.float64) / 10)
            after, detected = context.radar.detected_again(np.maximum(before - 1, 0) / floor, rng)
            width = context.radar.cell_width
            worse = np.sqrt(np.maximum(1 / (2 * after) - 1 / (2 * before), 0))[:, None]
            noise = rng.standard_normal((len(returns), 4)) * worse * width
            kept = np.flatnonzero(detected)
            false_powers, places = context.radar.false_alarms(rng)
            measured = np.stack([returns[name].astype(np.float64) for name in PLACE], axis=1)
            measured = context.radar.folded((measured + noise)[kept])
            measured[:, 0] = np.clip(measured[:, 0], 0.01, context.radar.section.range)
            powers = np.concatenate([after[kept], false_powers])
            added = context.radar.as_returns(np.concatenate([measured, places]), powers)
            source = np.concatenate([kept, np.full(len(places), -1)])
            return AttackedScan(added, source)

        return jam
