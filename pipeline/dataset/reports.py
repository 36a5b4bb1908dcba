"""The reports of a data set, read again: the bags that they compare, and the values that a card shows."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

from pydantic import Field

from advpipe.pipeline.core.document import Count, Document, Number, ShortText, read_json, read_text, validated
from advpipe.pipeline.results.deprecated import with_new_keys

LIMIT_BYTES = 1 << 24
"""The longest report that is read: one of a drive of five minutes has 0.2 MB."""

_HINT = "evaluate again with --overwrite"
_MOST_RECORDS = 100_000
_FileName = Annotated[str, Field(max_length=255)]
_Warning = Annotated[str, Field(max_length=2000)]


class _Clean(Document):
    bag: _FileName
    sha256: ShortText


class _Compared(Document):
    """sha256: None of a random baseline, which is in no bag."""

    bag: _FileName
    sha256: ShortText | None


class _Detector(Document):
    sha256: ShortText


class _Adaptation(Document):
    """The arguments of an `Adaptation`."""

    lidar_height_m: Number | None = None
    level: bool = False
    scale_intensity: Number = 1.0


class ReportOrigin(Document):
    """The bags, detectors and code that a report was made with."""

    clean: _Clean
    compared: Annotated[tuple[_Compared, ...], Field(max_length=_MOST_RECORDS)]
    detectors: Annotated[tuple[_Detector, ...], Field(max_length=1000)] = ()
    device: ShortText = "cpu"
    code_sha256: ShortText = ""
    adaptation: _Adaptation | None = None


class DetectionRow(Document):
    """An attack's effect on detection; None for what is undefined."""

    bag: _FileName | None = None
    detector: ShortText = ""
    frames: Number | None = None
    map_clean: Number | None = None
    map_adv: Number | None = None
    map_ratio_percent: Number | None = None
    map_ratio_ci95: tuple[Number | None, Number | None] | None = None
    map_ratio_reason: ShortText = ""
    baseline_map_ratio_percent: Number | None = None
    random_best_map_ratio_percent: Number | None = None
    lost_objects: Count | None = None
    working_score: Number | None = None
    objects_found_clean: Count | None = None
    chamfer_distance_m2: Number | None = None


class LocalisationRow(Document):
    """An attack's effect on one vehicle's localisation."""

    bag: _FileName | None = None
    vehicle: ShortText = ""
    clean_mean_m: Number | None = None
    adv_mean_m: Number | None = None
    detection_rate: Number | None = None


class V2xRow(Document):
    """What one receiver made of an attack's messages."""

    bag: _FileName | None = None
    vehicle: ShortText = ""
    messages: Number | None = None
    false_messages: Number | None = None
    f1: Number | None = None


class ReportDocument(Document):
    """The part of report.json that is read again."""

    provenance: ReportOrigin
    warnings: Annotated[tuple[_Warning, ...], Field(max_length=100)] = ()
    rows: Annotated[tuple[DetectionRow, ...], Field(max_length=_MOST_RECORDS)] = ()
    localisation: Annotated[tuple[LocalisationRow, ...], Field(max_length=_MOST_RECORDS)] = ()
    v2x: Annotated[tuple[V2xRow, ...], Field(max_length=_MOST_RECORDS)] = ()

    @property
    def bags(self) -> dict[str, str]:
        """The SHA-256 (`parent_sha256`) of each bag that it compared, by the bag's name."""
        origin = self.provenance
        stated = {Path(origin.clean.bag).name: origin.clean.sha256}
        return stated | {each.bag: each.sha256 for each in origin.compared if each.sha256 is not None}

    @property
    def clean_sha256s(self) -> set[str]:
        """Empty: an evaluation names its clean bag, see `bags`."""
        return set()


class _SweepOrigin(Document):
    """The settings of one recipe's cells."""

    clean_sha256: ShortText


class _SweepCell(Document):
    """A recipe at a budget; row: None where it was not run."""

    row: DetectionRow | None = None


class SweepReportDocument(Document):
    """The part of a sweep's report.json that is read again."""

    provenance: Annotated[tuple[_SweepOrigin, ...], Field(max_length=_MOST_RECORDS)]
    cells: Annotated[tuple[_SweepCell, ...], Field(max_length=_MOST_RECORDS)]
    warnings: Annotated[tuple[_Warning, ...], Field(max_length=100)] = ()

    @property
    def rows(self) -> tuple[DetectionRow, ...]:
        """The effects of the cells that were run."""
        return tuple(cell.row for cell in self.cells if cell.row is not None)

    @property
    def localisation(self) -> tuple[LocalisationRow, ...]:
        """Empty: a sweep runs LiDAR attacks alone."""
        return ()

    @property
    def v2x(self) -> tuple[V2xRow, ...]:
        """Empty: a sweep runs LiDAR attacks alone."""
        return ()

    @property
    def bags(self) -> dict[str, str]:
        """Empty: a sweep names no bag of the data set, and its adversarial bags are removed."""
        return {}

    @property
    def clean_sha256s(self) -> set[str]:
        """The SHA-256 (`parent_sha256`) of the clean bags that the cells were made from."""
        return {origin.clean_sha256 for origin in self.provenance}


def read_report(path: Path) -> ReportDocument | SweepReportDocument:
    """The report.json of an evaluation or of a sweep.

    Raises AdvpipeError for a file that is no such report or cannot be read.
    """
    where = f"{path} is not a report of this version"
    text = read_text(path, LIMIT_BYTES)
    stored: dict[str, Any] = with_new_keys(read_json(text, dict[str, Any], where, _HINT, LIMIT_BYTES), path)
    kind = SweepReportDocument if "cells" in stored else ReportDocument
    found: ReportDocument | SweepReportDocument = validated(stored, kind, where, _HINT)
    return found
