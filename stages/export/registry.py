"""The forms that can be exported, by their names on the command line."""

from __future__ import annotations

from collections.abc import Mapping

from advpipe.stages.export.form import ExportForm
from advpipe.stages.export.pcd import PcdExport

EXPORT_FORMS: Mapping[str, ExportForm] = {"pcd": PcdExport()}
