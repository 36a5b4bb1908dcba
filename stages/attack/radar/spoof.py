"""A forged car: the attacker answers the radar's chirps with delayed and shifted copies."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from advpipe.pipeline.labels.scan_quantities import RETURNS_ADDED, RETURNS_CHANGED, RETURNS_REMOVED
from advpipe.pipeline.messages.radar import RadarReturns
from advpipe.pipeline.sensors.radar.scatterers import Scatterers
from advpipe.stages.attack.bounds import checked_integer, checked_number
from advpipe.stages.attack.radar.base import (
    AttackedScan,
    RadarAttack,
    RadarTraits,
    ScanAttacker,
    ScanContext,
    with_added,
)

CAR_WIDTH_M = 1.8
NEAREST_M = 2.0


@dataclass(frozen=True, kw_only=True)
class RadarSpoof(RadarAttack):
    """Adds the returns of a forged car, whose range and Doppler agree (the false positives of Hunt et al.,
    MadRadar, NDSS 2024; Komissarov and Wool, Spoofing attacks against vehicular FMCW radar, 2021).

    range_m: of the forged car at the first attacked scan. azimuth_deg: where it appears, from the axis of the
    radar; positive is left. Several radars that look elsewhere each get a car of their own: name one.
    closing_mps: how fast it comes nearer; it stops at 2 m. rcs_dbsm: as what it appears; 10 is the rear of a
    car. returns: at most so many points of its rear; those that the radar's threshold and resolution leave
    are added. radar: the name of the attacked one; all of the victim without a name.
    """

    traits = RadarTraits()

    range_m: float = 40.0
    azimuth_deg: float = 0.0
    closing_mps: float = 5.0
    rcs_dbsm: float = 10.0
    returns: int = 3
    radar: str = ""

    def __post_init__(self) -> None:
        checked_number("radar-spoof", "range_m", self.range_m, NEAREST_M, 500)
        checked_number("radar-spoof", "azimuth_deg", self.azimuth_deg, -180, 180)
        checked_number("radar-spoof", "closing_mps", self.closing_mps, -100, 100)
        checked_number("radar-spoof", "rcs_dbsm", self.rcs_dbsm, -40, 60)
        checked_integer("radar-spoof", "returns", self.returns, 1, 1000)

    @property
    def bounds(self) -> dict[str, tuple[float, float]]:
        return {
            RETURNS_ADDED.name: (0, self.returns),
            RETURNS_REMOVED.name: (0, 0),
            RETURNS_CHANGED.name: (0, 0),
        }

    def begin(self, rng: np.random.Generator) -> ScanAttacker:
        """Points of the forged rear fluctuate from scan to scan, as those of a car do."""

        def spoof(returns: RadarReturns, context: ScanContext) -> AttackedScan:
            forged = context.radar.measure(self._rear(context.elapsed_s), np.zeros(3), rng, False)
            return with_added(returns, forged)

        return spoof

    def _rear(self, elapsed_s: float) -> Scatterers:
        """The points of the rear, at the height of the radar, whose velocity is that relative to it."""
        range_m = max(self.range_m - self.closing_mps * elapsed_s, NEAREST_M)
        azimuth = np.deg2rad(self.azimuth_deg)
        ahead = np.array([np.cos(azimuth), np.sin(azimuth), 0.0])
        across = np.array([-ahead[1], ahead[0], 0.0])
        places = (np.arange(self.returns) + 0.5) / self.returns - 0.5
        speed_mps = self.closing_mps if range_m > NEAREST_M else 0.0
        return Scatterers(
            range_m * ahead + CAR_WIDTH_M * places[:, None] * across,
            np.tile(-speed_mps * ahead, (self.returns, 1)),
            np.full(self.returns, 10 ** (self.rcs_dbsm / 10) / self.returns),
            np.zeros(self.returns),
            np.zeros(self.returns, np.int64),
        )
