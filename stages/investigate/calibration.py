"""What honest sensors and stations reach, and how much each cue says: tuned on other drives, in a file.

`benchmarks/investigate.py tune` writes `calibration.json`.
"""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cache
from importlib.resources import files
from typing import Any

FILE = "calibration.json"


@dataclass(frozen=True)
class CueCalibration:
    """limit: what few readings of honest ones exceed. weight: of the cue's score in the log odds. sharpness:
    how much a ratio to the limit says; the more, the less honest readings spread."""

    limit: float
    weight: float
    sharpness: float = 1.0


@dataclass(frozen=True)
class Calibration:
    """cues: by name. intercept: the log odds without any evidence. alarm_probability: from which somebody is
    named. half_life_s: in which evidence fades. most, least: bounds of what one reading adds to a score;
    twice as much where it is `flagrant` times the limit, which no honest one comes near. drives: the names of
    the drives that it was tuned on, as `benchmarks/investigate_drives.py` has them."""

    cues: Mapping[str, CueCalibration]
    intercept: float
    alarm_probability: float = 0.5
    half_life_s: float = 5.0
    most: float = 1.5
    least: float = 0.25
    ceiling: float = 8.0
    flagrant: float = 20.0
    drives: tuple[str, ...] = ()

    def step(self, cue: str, value: float) -> float:
        """What a reading adds to the score of its cue: the logarithm of its ratio to the limit, sharpened and
        bounded."""
        one = self.cues[cue]
        ratio = value / one.limit
        most = self.most if ratio < self.flagrant else 2 * self.most
        return min(max(one.sharpness * math.log(ratio), -self.least), most) if ratio > 0 else -self.least

    def probability(self, scores: Mapping[str, float]) -> float:
        """That somebody with these scores by cue lies."""
        odds = self.intercept + sum(self.cues[cue].weight * score for cue, score in scores.items())
        return 1 / (1 + math.exp(-min(max(odds, -50.0), 50.0)))

    def without(self, cue: str) -> Calibration:
        """The same deaf to one cue, for ablations."""
        cues = {**self.cues, cue: replace(self.cues[cue], weight=0.0)}
        return Calibration(**{**vars(self), "cues": cues})

    def to_plain(self) -> dict[str, Any]:
        """For JSON."""
        cues = {name: vars(one) for name, one in self.cues.items()}
        return {**vars(self), "cues": cues, "drives": list(self.drives)}

    def text(self) -> str:
        """The whole file."""
        return json.dumps(self.to_plain(), indent=1) + "\n"

    @classmethod
    def of_plain(cls, plain: Mapping[str, Any]) -> Calibration:
        """The inverse of `to_plain`."""
        cues = {name: CueCalibration(**one) for name, one in plain["cues"].items()}
        return cls(**{**plain, "cues": cues, "drives": tuple(plain["drives"])})


@cache
def shipped_calibration() -> Calibration:
    """The one that comes with advpipe."""
    text = files("advpipe.stages.investigate").joinpath(FILE).read_text(encoding="utf-8")
    return Calibration.of_plain(json.loads(text))
