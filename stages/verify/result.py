"""What verifying finds, and what it cannot tell."""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Iterable
from dataclasses import asdict, dataclass, field
from typing import NamedTuple

from advpipe.pipeline.core.errors import one_line
from advpipe.pipeline.core.tabular import Rows, Tabular

FAULTS_A_PLACE = 5
"""Of faults of one check at one place, so many are reported one by one; the others are counted."""

NOT_DECLARED = "not checked: the bag comes from a version that did not record attack declarations"


class Fault(NamedTuple):
    """Something is not as it is claimed to be. where: a relative path, perhaps with more behind it."""

    where: str
    what: str


class Unchecked(NamedTuple):
    """Something cannot be checked, and why."""

    where: str
    what: str


Result = Fault | Unchecked


@dataclass(frozen=True)
class Finding:
    """A fault, or a gap, with the name of the check that found it; `str` is one line."""

    check: str
    where: str
    what: str

    def __str__(self) -> str:
        return one_line(f"{self.where}: {self.what} [{self.check}]")


@dataclass(repr=False)
class Verification(Tabular):
    """findings: what is wrong. unchecked: what could not be checked. checks: those that ran.

    scratch: where an archive lies unpacked; findings leave it out.

    In both lists, faults of one check at one place beyond `FAULTS_A_PLACE` are one line with their number.
    """

    path: str
    checks: tuple[str, ...]
    findings: list[Finding] = field(default_factory=list)
    unchecked: list[Finding] = field(default_factory=list)
    scratch: str = ""
    _counts: Counter[tuple[type, str, str]] = field(default_factory=Counter)

    @property
    def is_good(self) -> bool:
        return not self.findings

    def __str__(self) -> str:
        faults = len(self.findings)
        outcome = f"{faults} findings" if faults > 1 else "1 finding" if faults else "good"
        return f"{one_line(self.path)}: {outcome}"

    def to_dicts(self) -> Rows:
        """A row for each finding, and then for each thing that could not be checked."""
        both = ((True, self.findings), (False, self.unchecked))
        return [{"is_fault": is_fault, **asdict(found)} for is_fault, kept in both for found in kept]

    def add(self, check: str, results: Iterable[Result]) -> None:
        """Keep what a check found."""
        for result in results:
            place = type(result), check, result.where
            self._counts[place] += 1
            if self._counts[place] <= FAULTS_A_PLACE:
                kept = self.findings if isinstance(result, Fault) else self.unchecked
                kept.append(Finding(check, result.where, result.what.replace(self.scratch, "")))

    def close(self) -> None:
        """Say how many were left out."""
        for (kind, check, where), count in self._counts.items():
            if count > FAULTS_A_PLACE:
                kept = self.findings if kind is Fault else self.unchecked
                kept.append(Finding(check, where, f"and {count - FAULTS_A_PLACE} more like this"))
        self._counts.clear()

    def to_json(self) -> str:
        plain = {
            "path": self.path,
            "good": self.is_good,
            "checks": self.checks,
            "findings": [asdict(finding) for finding in self.findings],
            "unchecked": [asdict(finding) for finding in self.unchecked],
        }
        return json.dumps(plain, indent=2)
