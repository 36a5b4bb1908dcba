"""Tunes the misbehaviour detectors and writes the file `tuned.py` that holds what was found."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path

from misbehaviour_drives import TUNING, MisbehaviourDrives, Site

from advpipe.pipeline.misbehaviour import tuned
from advpipe.pipeline.misbehaviour.catch import BOUNDED_CATCH, F1_CATCH, CatchDetector, CatchParameters
from advpipe.pipeline.misbehaviour.catch_tuning import tune_catch
from advpipe.pipeline.misbehaviour.config import CHECKS, DetectorConfig
from advpipe.pipeline.misbehaviour.detector import PlausibilityDetector
from advpipe.pipeline.misbehaviour.detectors import BASELINE, MISBEHAVIOUR_DETECTORS, OURS
from advpipe.pipeline.misbehaviour.tuning import (
    PARDON_S,
    Stream,
    TuningScore,
    evaluated,
    threshold_candidates,
    tune,
)
from advpipe.pipeline.misbehaviour.verdicts import MisbehaviourDetector

TUNED_FILE = Path(__file__).parents[1] / "pipeline" / "misbehaviour" / "tuned.py"
PARTS = ("ours", "catch")
"""What can be tuned: our detector, and CaTCH's checks."""


@dataclass(frozen=True)
class TunedFile:
    """What `tuned.py` says."""

    drives: tuple[str, ...]
    candidates: Mapping[str, Sequence[float]]
    config: DetectorConfig
    bounded: CatchParameters
    free: CatchParameters

    @classmethod
    def shipped(cls) -> TunedFile:
        """What it says today."""
        return cls(tuned.DRIVES, tuned.CANDIDATES, DetectorConfig(), BOUNDED_CATCH, F1_CATCH)

    def detectors(self) -> dict[str, MisbehaviourDetector]:
        """All detectors with these values: the package has loaded the former ones."""
        return {
            **MISBEHAVIOUR_DETECTORS,
            OURS: PlausibilityDetector(self.config),
            BASELINE: CatchDetector(self.bounded),
            "catch-f1": CatchDetector(self.free),
        }

    def text(self) -> str:
        """The file's text; numbers to four digits, as they were tried."""
        thresholds = {name: self.config.thresholds[name] for name, check in CHECKS.items() if check.is_tuned}
        return f'''"""Tuned parameters of both detectors, written by `benchmarks/misbehaviour.py --ship`."""

from __future__ import annotations

DRIVES = (
{"".join(f'    "{drive}",' + chr(10) for drive in self.drives)})
"""Drives used for tuning, with their seeds; the benchmark tests on none of them."""

THRESHOLDS: dict[str, float] = {{
{_items(thresholds)}}}
"""Thresholds of our checks, by name; units as in `config.CHECKS`."""

CANDIDATES: dict[str, tuple[float, ...]] = {{
{_items(self.candidates)}}}
"""What the search chose each threshold from, from high to low."""

PARDON_S: float = {self.config.pardon_s:g}
ACCELERATION_PARDON_S: float = {self.config.acceleration_pardon_s:g}

CATCH_BOUNDED: dict[str, float] = {{
{_items(asdict(self.bounded))}}}
"""Parameters of the baseline, by the names of `catch.CatchParameters`, with the bound on false positives."""

CATCH_F1: dict[str, float] = {{
{_items(asdict(self.free))}}}
"""The same, tuned for F1 without that bound."""
'''


def ship(drives: MisbehaviourDrives, honest: Site | None, parts: Sequence[str]) -> TunedFile:
    """Tune these `PARTS` on the drives of `TUNING`, and write `tuned.py`; the other part stays as it is.

    Ours is tuned on the honest messages of another map, too, and the baseline without the fast drives.
    """
    towns = drives.heard(is_fast=False)
    print(f"tuned on {', '.join(site.name for site in TUNING)}, {drives.seconds:g} s each")
    found = replace(TunedFile.shipped(), drives=_names(drives, honest))
    if "ours" in parts:
        heard_honestly = drives.heard_honestly(honest) if honest else []
        found = _with_ours(found, [*towns, *drives.heard(is_fast=True), *heard_honestly])
    if "catch" in parts:
        bounded, free = tune_catch(towns), tune_catch(towns, most_flagged=1.0)
        _print_score(BASELINE, bounded.score)
        _print_score("catch-f1", free.score)
        found = replace(found, bounded=_rounded(bounded.parameters), free=_rounded(free.parameters))
    TUNED_FILE.write_text(found.text(), encoding="utf-8")
    return found


def _with_ours(found: TunedFile, streams: Sequence[Stream]) -> TunedFile:
    longest_s = max(PARDON_S)  # whatever is shipped today
    base = DetectorConfig(pardon_s=longest_s, acceleration_pardon_s=longest_s)
    exact = threshold_candidates([each for each in streams if not each.attack], base)
    candidates = {name: tuple(map(_four_digits, levels)) for name, levels in exact.items()}
    best = tune(candidates, evaluated(streams), base)
    _print_score(OURS, best.score)
    return replace(found, candidates=candidates, config=best.config)


def _names(drives: MisbehaviourDrives, honest: Site | None) -> tuple[str, ...]:
    names = [f"{site.name}, {drives.seconds:g} s{' (ours alone)' * site.is_fast}" for site in TUNING]
    names += [f"{honest.name}, {drives.seconds:g} s (ours alone, honest messages)"] if honest else []
    return tuple(names)


def _print_score(name: str, score: TuningScore) -> None:
    print(f"  {name}: mean F1 {score.mean_f1:.3f}, {score.false_positive_rate:.2%} of honest flagged")


def _rounded(parameters: CatchParameters) -> CatchParameters:
    return CatchParameters(**{name: _four_digits(value) for name, value in asdict(parameters).items()})


def _four_digits(value: float) -> float:
    return float(f"{value:.4g}")


def _items(values: Mapping[str, float | Sequence[float]]) -> str:
    lines = []
    for name, value in values.items():
        shown = repr(float(value)) if isinstance(value, (int, float)) else repr(tuple(map(float, value)))
        lines.append(f'    "{name}": {shown},\n')
    return "".join(lines)
