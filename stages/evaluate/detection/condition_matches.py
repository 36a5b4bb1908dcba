"""Average precision under one condition: on the clean clouds, the adversarial ones or a baseline's."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np
import numpy.typing as npt

from advpipe.pipeline.metrics.average_precision import (
    R11,
    R40,
    RankedMatches,
    RecallPositions,
    mean_average_precision,
)
from advpipe.pipeline.metrics.bootstrap import BlockBootstrap, percentile_interval
from advpipe.pipeline.metrics.matching import MatchTable
from advpipe.pipeline.results.metrics import Interval
from advpipe.stages.evaluate.detection.comparison import FrameResult
from advpipe.stages.evaluate.detection.scoring import CRITERIA
from advpipe.stages.evaluate.detection.strata import STRATA, Measures

Float64 = npt.NDArray[np.float64]

WHOLE = "all"
"""The stratum of all objects."""


@dataclass(frozen=True)
class Precision:
    """One average precision: of a class by a criterion, in a stratum `stratum` of those cut `by` a measure.

    boxes: how many objects were to be found. ap_r40, ap_r11: NaN without any. ap_r40_ci95: None where
    there is no interval.
    """

    name: str
    criterion: str
    by: str
    stratum: str
    boxes: int
    ap_r40: float
    ap_r40_ci95: Interval
    ap_r11: float


@dataclass(frozen=True)
class ConditionMatches:
    """The matches under one condition, and average precisions from them.

    tables, ranked: by criterion and class. in_map: the classes of the mAP. draws: by criterion and class,
    the R40 average precision (draws,) in each draw of `bootstrap`.
    """

    tables: Mapping[tuple[str, str], MatchTable]
    ranked: Mapping[tuple[str, str], RankedMatches]
    in_map: Sequence[str]
    draws: Mapping[tuple[str, str], Float64]
    bootstrap: BlockBootstrap

    @classmethod
    def of(
        cls,
        frames: Sequence[FrameResult],
        condition: str,
        classes: Sequence[str],
        in_map: Sequence[str],
        bootstrap: BlockBootstrap,
    ) -> ConditionMatches:
        """The matches of these frames under a condition."""
        found = [frame.all_clouds()[condition].matches for frame in frames]
        tables = {
            (criterion, name): MatchTable.of([matches[criterion, name] for matches in found])
            for criterion in CRITERIA
            for name in classes
        }
        ranked = {key: RankedMatches.of(table) for key, table in tables.items()}
        draws = {key: ap_draws(each, bootstrap) for key, each in ranked.items()}
        return cls(tables, ranked, in_map, draws, bootstrap)

    def mean_ap(self, criterion: str = "strict", positions: RecallPositions = R40) -> float:
        """The mean over the classes of the mAP."""
        ranked = [self.ranked[criterion, name] for name in self.in_map]
        return float(mean_average_precision([each.average_precision(positions=positions) for each in ranked]))

    def map_draws(self, criterion: str = "strict") -> Float64:
        """The mAP (draws,) in each draw of the bootstrap."""
        return mean_average_precision([self.draws[criterion, name] for name in self.in_map])

    def precisions(
        self, frames: Sequence[FrameResult], condition: str, criteria: Sequence[str] = tuple(CRITERIA)
    ) -> Iterator[Precision]:
        """Every class by every criterion; by each of `criteria`, in every stratum too."""
        for (criterion, name), ranked in self.ranked.items():
            yield _precision(name, criterion, "", WHOLE, ranked, self.draws[criterion, name])
        of_class = {name: Measures.of(frames, condition, name) for _, name in self.ranked}
        known = {  # of any class: one without objects has strata too, all empty
            by
            for measures in of_class.values()
            for by, values in measures.truths.items()
            if np.isfinite(values).any()
        }
        for name, measures in of_class.items():
            for criterion in criteria:
                for stratum in (each for each in STRATA if each.by in known):
                    part = RankedMatches.of(measures.cut(self.tables[criterion, name], stratum))
                    draws = ap_draws(part, self.bootstrap)
                    yield _precision(name, criterion, stratum.by, stratum.name, part, draws)


def ap_draws(ranked: RankedMatches, bootstrap: BlockBootstrap) -> Float64:
    """The R40 average precision (draws,) in each draw of the bootstrap."""
    return bootstrap.samples(partial(ranked.average_precisions, block=bootstrap.block))


def _precision(
    name: str, criterion: str, by: str, stratum: str, ranked: RankedMatches, draws: Float64
) -> Precision:
    return Precision(
        name,
        criterion,
        by,
        stratum,
        int(ranked.n_truth.sum()),
        ranked.average_precision(),
        percentile_interval(draws),
        ranked.average_precision(positions=R11),
    )
