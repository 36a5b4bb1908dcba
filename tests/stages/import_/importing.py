"""Imports for tests: a form's drive without a bag, and with one."""

from __future__ import annotations

from pathlib import Path

from advpipe.stages.import_.drive import DriveFrame
from advpipe.stages.import_.options import ImportOptions, ImportRequest
from advpipe.stages.import_.registry import FORMS
from advpipe.stages.import_.run import ImportSummary, import_drive


def drive_frames(form: str, source: Path, **options) -> list[DriveFrame]:
    """What the form says of a source."""
    return list(FORMS[form].open(source, ImportOptions(**options)).frames())


def import_form(form: str, source: Path, out: Path, **options) -> ImportSummary:
    """The data set that an import makes."""
    return import_drive(ImportRequest(form, source, ImportOptions(**options)), out)
