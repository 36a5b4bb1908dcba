"""Results of verification: faults, and things that could not be checked."""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Iterable
from dataclasses import asdict, dataclass, field
from typing import NamedTuple

from advpipe.pipeline.core.errors import one_line
from advpipe.pipeline.core.tabular import Rows, Tabular
from advpipe.pipeline.core.text import counted

FAULTS_A_PLACE = 5
"""Number of faults of one check at one place that are reported individually; the others are counted."""

NOT_DECLARED = "not checked: the bag comes from a version that did not record attack declarations"


class Fault(NamedTuple):
    """Something that is wrong. where: a relative path, perhaps followed by a topic."""

    where: str
    what: str


class Unchecked(NamedTuple):
    """Something that cannot be checked, and the reason."""

    where: str
    what: str


Result = Fault | Unchecked


@dataclass(frozen=True)
class Finding:
    """A `Fault` or `Unchecked` with the name of its check; `str` is one line."""

    check: str
    where: str
    what: str

    def __str__(self) -> str:
        return one_line(f"{self.where}: {self.what} [{self.check}]")


@dataclass(repr=False)
class Verification(Tabular):
    """The outcome of a verification.

    findings: everything wrong. unchecked: everything that could not be checked. checks: the checks that ran.
    scratch: folder of an unpacked archive, which is removed from findings.

    In both lists, results of one check at one place beyond `FAULTS_A_PLACE` are one line with their number.
    """

    path: str
    checks: tuple[str, ...]
    findings: list[Finding] = field(default_factory=list)
    unchecked: list[Finding] = field(default_factory=list)
    scratch: str = ""
    _counts: Counter[tuple[type, str, str]] = field(default_factory=Counter)

    @property
    def is_good(self) -> bool:
        """Whether nothing is wrong."""
        return not self.findings

    def __str__(self) -> str:
        faults = len(self.findings)
        outcome = counted(faults, "finding") if faults else "good"
        return f"{one_line(self.path)}: {outcome}"

    def to_dicts(self) -> Rows:
        """A row for each finding, and then for each thing that could not be checked."""
        both = ((True, self.findings), (False, self.unchecked))
        return [{"is_fault": is_fault, **asdict(found)} for is_fault, kept in both for found in kept]

    def add(self, check: str, results: Iterable[Result]) -> None:
        """Add the results of a check."""
        for result in results:
            place = type(result), check, result.where
            self._counts[place] += 1
            if self._counts[place] <= FAULTS_A_PLACE:
                kept = self.findings if isinstance(result, Fault) else self.unchecked
                kept.append(Finding(check, result.where, result.what.replace(self.scratch, "")))

    def close(self) -> None:
        """Add the numbers of results that were not listed individually."""
        for (result_type, check, where), count in self._counts.items():
            if count > FAULTS_A_PLACE:
                kept = self.findings if result_type is Fault else self.unchecked
                kept.append(Finding(check, where, f"and {count - FAULTS_A_PLACE} more like this"))
        self._counts.clear()

    def to_json(self) -> str:
        """The outcome as a JSON document."""
        plain = {
            "path": self.path,
            "good": self.is_good,
            "checks": self.checks,
            "findings": [asdict(finding) for finding in self.findings],
            "unchecked": [asdict(finding) for finding in self.unchecked],
        }
        return json.dumps(plain, indent=2)
