"""Reproducers on disk: a folder for each different fault, with the input, what it is for, and the stack."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from tests.fuzz.case import Case, Fault

ABOUT, TRACE = "about.json", "traceback.txt"


@dataclass(frozen=True)
class Finding:
    """A fault that some inputs triggered; folder: holds the smallest of them."""

    folder: Path
    target: str
    case: Case
    fault: Fault
    count: int = 1

    def __str__(self) -> str:
        return (
            f"{self.target}: {self.fault.kind} in {self.case.call}: {self.fault.what} "
            f"[{self.fault.where or '?'}] {self.folder}"
        )


def save(findings: Path, target: str, case: Case, fault: Fault) -> Finding:
    """Keeps an input, unless a smaller one showed the same; counts it in any case."""
    key = hashlib.sha256(repr(fault.key).encode()).hexdigest()[:10]
    folder, count = findings / target / key, 1
    if (folder / ABOUT).is_file():
        old = load(folder)
        count += old.count
        if len(old.case.data) <= len(case.data):
            case, fault = old.case, old.fault
    folder.mkdir(parents=True, exist_ok=True)
    data_file = folder / Path(case.place).name
    data_file.write_bytes(case.data)
    (folder / TRACE).write_text(fault.trace, encoding="utf-8", errors="backslashreplace")
    about = {
        "target": target,
        "call": case.call,
        "place": case.place,
        "note": case.note,
        "kind": fault.kind,
        "what": fault.what,
        "where": fault.where,
        "count": count,
    }
    (folder / ABOUT).write_text(json.dumps(about, indent=2) + "\n", encoding="utf-8")
    return Finding(folder, target, case, fault, count)


def load(folder: Path) -> Finding:
    """What `save` kept in a folder."""
    about = json.loads((folder / ABOUT).read_text(encoding="utf-8"))
    data = (folder / Path(about["place"]).name).read_bytes()
    case = Case(about["call"], about["place"], data, about["note"])
    trace = (folder / TRACE).read_text(encoding="utf-8")
    fault = Fault(about["kind"], about["what"], about["where"], trace)
    return Finding(folder, about["target"], case, fault, about["count"])


def all_of(findings: Path) -> Iterator[Finding]:
    """Every finding, by target and key."""
    for about in sorted(findings.glob(f"*/*/{ABOUT}")):
        yield load(about.parent)
