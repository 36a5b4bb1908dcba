"""The forms that can be exported, by their names on the command line."""

from __future__ import annotations

from collections.abc import Mapping

from advpipe.stages.export.form import ExportForm
from advpipe.stages.export.kitti.form import KittiExport
from advpipe.stages.export.openpcdet import OpenPcdetExport

EXPORT_FORMS: Mapping[str, ExportForm] = {
    "kitti": KittiExport(),
    "openpcdet": OpenPcdetExport(),
}
