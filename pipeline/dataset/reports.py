"""The parts of a data set's report that are read again: its bags, and the figures that a card shows."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from pydantic import Field

from advpipe.pipeline.core.document import Count, Document, Number, Word, read_json, read_text

LIMIT_BYTES = 1 << 24
"""The longest report that is read: one of a drive of five minutes has 0.2 MB."""

_HINT = "evaluate again with --overwrite"
_MOST_RECORDS = 100_000
_FileName = Annotated[str, Field(max_length=255)]
_Banner = Annotated[str, Field(max_length=2000)]


class _Clean(Document):
    bag: _FileName
    sha256: Word


class _Compared(Document):
    """sha256: None of a random baseline, which is in no bag."""

    bag: _FileName
    sha256: Word | None


class _Detector(Document):
    sha256: Word


class ReportOrigin(Document):
    """The bags, detectors and code that a report was made with."""

    clean: _Clean
    compared: Annotated[tuple[_Compared, ...], Field(max_length=_MOST_RECORDS)]
    detectors: Annotated[tuple[_Detector, ...], Field(max_length=1000)] = ()
    device: Word = "cpu"
    code_sha256: Word = ""


class DetectionRow(Document):
    """An attack's effect on detection; None for what is undefined."""

    bag: _FileName | None = None
    frames: Number | None = None
    map_clean: Number | None = None
    map_adv: Number | None = None
    map_ratio_percent: Number | None = None
    map_ratio_ci95: tuple[Number | None, Number | None] | None = None
    baseline_map_ratio_percent: Number | None = None
    lost_objects: Count | None = None
    working_score: Number | None = None
    objects_found_clean: Count | None = None
    chamfer_distance_m2: Number | None = None


class LocalisationRow(Document):
    """An attack's effect on one vehicle's localisation."""

    bag: _FileName | None = None
    vehicle: Word = ""
    clean_mean_m: Number | None = None
    adv_mean_m: Number | None = None
    detection_rate: Number | None = None


class V2xRow(Document):
    """What one receiver made of an attack's messages."""

    bag: _FileName | None = None
    vehicle: Word = ""
    messages: Number | None = None
    lies: Number | None = None
    f1: Number | None = None


class ReportDocument(Document):
    """The part of report.json that is read again."""

    provenance: ReportOrigin
    banners: Annotated[tuple[_Banner, ...], Field(max_length=100)] = ()
    rows: Annotated[tuple[DetectionRow, ...], Field(max_length=_MOST_RECORDS)] = ()
    localisation: Annotated[tuple[LocalisationRow, ...], Field(max_length=_MOST_RECORDS)] = ()
    v2x: Annotated[tuple[V2xRow, ...], Field(max_length=_MOST_RECORDS)] = ()

    @property
    def bags(self) -> dict[str, str]:
        """The SHA-256 (`parent_sha256`) of each bag that it compared, by the bag's name."""
        origin = self.provenance
        stated = {Path(origin.clean.bag).name: origin.clean.sha256}
        return stated | {each.bag: each.sha256 for each in origin.compared if each.sha256 is not None}


def read_report(path: Path) -> ReportDocument:
    """A report.json; raises AdvpipeError for a file that is none, or that cannot be read."""
    where = f"{path} is not a report of this version"
    text = read_text(path, LIMIT_BYTES)
    found: ReportDocument = read_json(text, ReportDocument, where, _HINT, LIMIT_BYTES)
    return found
