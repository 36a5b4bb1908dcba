"""What `advpipe audit` says of a data set, for its card."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import groupby

from advpipe.pipeline.audit.result import Audit, ProbeResult
from advpipe.pipeline.audit.run import audit
from advpipe.pipeline.core.errors import AdvpipeError
from advpipe.pipeline.dataset.layout import Layout

CLOUDS = 20
"""Clouds of a bag that are measured, at most."""


@dataclass(frozen=True)
class AuditRow:
    """The probes of one attack's units of one kind, each with its area and interval."""

    attack: str
    unit: str
    probes: str


@dataclass(frozen=True)
class AuditTable:
    """rows: of each attack. findings, implied: a sentence for each probe that tells its units apart, and for
    each that the attack implies. why_not: why there is no audit; "" if there is one."""

    rows: tuple[AuditRow, ...] = ()
    findings: tuple[str, ...] = ()
    implied: tuple[str, ...] = ()
    why_not: str = ""


def audit_table(found: Layout) -> AuditTable:
    """The audit of a data set by itself; empty where no attack touched anything."""
    try:
        result = audit([found.folder], most_clouds=CLOUDS)
    except AdvpipeError as error:
        return AuditTable(why_not=str(error))
    return AuditTable(
        tuple(_rows(result)),
        tuple(str(each) for each in result.findings),
        tuple(str(each) for each in result.implied),
    )


def _rows(result: Audit) -> list[AuditRow]:
    groups = groupby(result.results, key=lambda each: (each.attack, each.unit))
    return [AuditRow(attack, unit, ", ".join(map(_cell, own))) for (attack, unit), own in groups]


def _cell(result: ProbeResult) -> str:
    if result.low is None or result.high is None:
        return f"{result.probe} {result.area:.2f}"
    return f"{result.probe} {result.area:.2f} ({result.low:.2f} to {result.high:.2f})"
