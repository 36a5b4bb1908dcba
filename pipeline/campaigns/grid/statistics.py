"""What the drives of a level say together: ratios of means over seeds, with intervals over drives.

Frames of one drive share its road users, its traffic and its weather, and so does an interval over its
frames: it says nothing of other drives. Here whole drives are drawn, with their clean and attacked figures
together.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from advpipe.pipeline.campaigns.grid.cell import WHOLE, GridValues, ScoredCell
from advpipe.pipeline.core.seeding import named_generator
from advpipe.pipeline.results.metrics import MIN_CLEAN_MAP, Interval

Float64 = npt.NDArray[np.float64]

DRIVE_DRAWS = 10_000
LEAST_DRIVES = 3
"""With fewer drives there is no interval."""


@dataclass(frozen=True)
class DriveRatio:
    """A ratio of means over drives, in percent, with its 95 % interval; NaN and None where undefined."""

    percent: float
    ci95: Interval

    @classmethod
    def of(cls, part: Float64, whole: Float64) -> DriveRatio:
        """part, whole: mAP of each drive (N,); the ratio is that of their means.

        No interval where draws without a ratio, of drives in which hardly anything is found, are more than
        those that may lie below it.
        """
        if not len(whole) or whole.mean() < MIN_CLEAN_MAP:
            return cls(math.nan, None)
        percent = float(100 * part.mean() / whole.mean())
        draws = drive_draws(len(whole))
        if not len(draws):
            return cls(percent, None)
        parts, wholes, levels = (
            part[draws].mean(axis=1),
            whole[draws].mean(axis=1),
            expanded_levels(len(whole)),
        )
        defined = wholes >= MIN_CLEAN_MAP
        if 1 - defined.mean() > levels[0]:
            return cls(percent, None)
        low, high = np.quantile(100 * parts[defined] / wholes[defined], levels)
        return cls(percent, (float(low), float(high)))


@dataclass(frozen=True)
class DriveMean:
    """A mean over drives with its 95 % interval; NaN and None where undefined."""

    value: float
    ci95: Interval
    drives: int

    @classmethod
    def of(cls, figures: Float64) -> DriveMean:
        """figures: one of each drive (N,)."""
        if not len(figures):
            return cls(math.nan, None, 0)
        draws = drive_draws(len(figures))
        if not len(draws):
            return cls(float(figures.mean()), None, len(figures))
        low, high = np.quantile(figures[draws].mean(axis=1), expanded_levels(len(figures)))
        return cls(float(figures.mean()), (float(low), float(high)), len(figures))


def drive_draws(drives: int) -> npt.NDArray[np.int64]:
    """Draws of drives with replacement (draws, drives); none with fewer than `LEAST_DRIVES`."""
    draws = DRIVE_DRAWS if drives >= LEAST_DRIVES else 0
    return named_generator(0, "grid", "drives", drives).integers(0, drives, (draws, drives))


def expanded_levels(drives: int, level: float = 0.95) -> tuple[float, float]:
    """The quantiles of a percentile interval over few drives, wider by the factor of Student's t.

    The plain percentile interval is too narrow for small samples; this is the expanded percentile interval of
    Hesterberg (What Teachers Should Know About the Bootstrap, The American Statistician 69(4), 2015).
    """
    from scipy.stats import norm, t

    tail = norm.cdf(-math.sqrt(drives / (drives - 1)) * t.ppf((1 + level) / 2, drives - 1))
    return float(tail), float(1 - tail)


@dataclass(frozen=True)
class GridGroup:
    """The cells of one level of each factor, attack, detector and defence: one for each seed."""

    cells: tuple[ScoredCell, ...]

    @property
    def key(self) -> tuple[tuple[object, ...], str, str, str]:
        """Labels of the levels, attack, detector, defence."""
        first = self.cells[0].cell
        return tuple(first.drive.levels.values()), first.attack, first.detector, first.defence

    @property
    def seeds(self) -> tuple[int, ...]:
        """The seeds of its drives."""
        return tuple(each.cell.drive.seed for each in self.cells)

    def ratio(self, stratum: str = WHOLE, of_baseline: bool = False) -> DriveRatio:
        """The mAP under attack (or that of the random baseline) to that on clean clouds, over drives.

        Drives without objects in the stratum do not count.
        """
        pairs = [
            (under_attack, values.map_clean)
            for values in self._values(stratum)
            if (under_attack := values.map_baseline if of_baseline else values.map_adv) is not None
            and values.map_clean is not None
        ]
        part, whole = np.array(pairs, dtype=np.float64).reshape(-1, 2).T
        return DriveRatio.of(part, whole)

    def delta(self) -> DriveRatio:
        """The ratio under attack minus that of the random baseline, in percentage points, drawn together."""
        triples = [
            (values.map_adv - values.map_baseline, values.map_clean)
            for values in self._values(WHOLE)
            if values.map_adv is not None and values.map_baseline is not None and values.map_clean is not None
        ]
        part, whole = np.array(triples, dtype=np.float64).reshape(-1, 2).T
        return DriveRatio.of(part, whole)

    def map_clean(self) -> float:
        """The mean mAP on clean clouds, over drives."""
        found = [each.map_clean for each in self._values(WHOLE) if each.map_clean is not None]
        return sum(found) / len(found) if found else math.nan

    @property
    def strata(self) -> list[str]:
        """The strata of its cells."""
        return list(dict.fromkeys(each.stratum for cell in self.cells for each in cell.stored.values))

    def mean(self, stratum: str, column: str) -> DriveMean:
        """The mean of a column of `GridValues` over the drives that have a figure there."""
        found = [getattr(values, column) for values in self._values(stratum)]
        return DriveMean.of(np.array([each for each in found if each is not None], dtype=np.float64))

    def _values(self, stratum: str) -> list[GridValues]:
        return [each for cell in self.cells for each in cell.stored.values if each.stratum == stratum]


def groups_of_cells(cells: Sequence[ScoredCell]) -> list[GridGroup]:
    """The cells that differ in their seed alone, in the order of the first of each."""
    found: dict[object, list[ScoredCell]] = {}
    for each in cells:
        cell = each.cell
        key = (tuple(map(repr, cell.drive.levels.values())), cell.attack, cell.detector, cell.defence)
        found.setdefault(key, []).append(each)
    return [GridGroup(tuple(group)) for group in found.values()]
