"""The outcome of an audit: what each probe says of each attack."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass

from advpipe.pipeline.audit.probe import Unit
from advpipe.pipeline.core.errors import one_line
from advpipe.pipeline.core.tabular import Rows, Tabular
from advpipe.pipeline.core.text import counted

LEAK = 0.6
"""An area under the ROC curve whose interval lies above this is a leak, unless the attack implies it."""


@dataclass(frozen=True)
class ProbeResult:
    """How well a probe tells an attack's units from clean ones; `str` is one line.

    attack: as the bags name it. area, low, high: the area under the ROC curve with its interval, corrected
    for the number of probes of the attack; None for an interval that too few clusters give. attacked, clean,
    clusters: numbers of units, and of what is independent of each other. is_trained: whether the probe learnt
    on other drives. reason: why the attack implies it, "" if it does not.
    """

    attack: str
    unit: Unit
    probe: str
    meaning: str
    area: float
    low: float | None
    high: float | None
    attacked: int
    clean: int
    clusters: int
    is_trained: bool
    reason: str

    @property
    def is_telling(self) -> bool:
        """Whether the interval lies above `LEAK`."""
        return self.low is not None and self.low > LEAK

    @property
    def is_finding(self) -> bool:
        """Whether it gives the attack away, and the attack does not imply it."""
        return self.is_telling and not self.reason

    def __str__(self) -> str:
        interval = "" if self.low is None or self.high is None else f" ({self.low:.2f} to {self.high:.2f})"
        because = f"; implied: {self.reason}" if self.reason else ""
        return one_line(
            f"{self.attack}: {self.unit}/{self.probe}, {self.meaning}: "
            f"area {self.area:.2f}{interval}{because}"
        )


@dataclass(frozen=True, repr=False)
class Audit(Tabular):
    """The outcome of an audit. datasets: what was audited; trained_on: the data sets given to learn from.

    unchecked: by attack, why it was not judged.
    """

    datasets: tuple[str, ...]
    trained_on: tuple[str, ...]
    results: tuple[ProbeResult, ...]
    unchecked: Mapping[str, str]

    @property
    def findings(self) -> tuple[ProbeResult, ...]:
        """What gives attacks away."""
        return tuple(each for each in self.results if each.is_finding)

    @property
    def implied(self) -> tuple[ProbeResult, ...]:
        """What tells attacks apart by their definitions."""
        return tuple(each for each in self.results if each.is_telling and each.reason)

    @property
    def is_good(self) -> bool:
        """Whether nothing gives an attack away."""
        return not self.findings

    def strongest(self, attack: str) -> ProbeResult | None:
        """Of the probes of an attack that its definition does not move, the one with the largest area."""
        own = [each for each in self.results if each.attack == attack and not each.reason]
        return max(own, key=lambda each: (each.low or 0.0, each.area), default=None)

    def __str__(self) -> str:
        attacks = len({each.attack for each in self.results})
        judged = f"{counted(len(self.results), 'probe')} of {counted(attacks, 'attack')}"
        outcome = counted(len(self.findings), "finding") if self.findings else "good"
        return one_line(f"{', '.join(self.datasets)}: {judged}: {outcome}")

    def to_dicts(self) -> Rows:
        """A row for each probe of each attack."""
        return [{**asdict(each), "is_finding": each.is_finding} for each in self.results]

    def to_json(self) -> str:
        """The outcome as a JSON document."""
        plain = {
            "datasets": self.datasets,
            "trained_on": self.trained_on,
            "good": self.is_good,
            "findings": [str(each) for each in self.findings],
            "results": self.to_dicts(),
            "unchecked": dict(self.unchecked),
        }
        return json.dumps(plain, indent=2)


def or_none(value: float) -> float | None:
    """The number, None for NaN, which JSON does not have."""
    return None if math.isnan(value) else value
