"""The forms that can be exported, by their names on the command line."""

from __future__ import annotations

from collections.abc import Mapping

from advpipe.stages.export.form import ExportForm
from advpipe.stages.export.kitti.form import KittiExport
from advpipe.stages.export.nuscenes.form import NuscenesExport
from advpipe.stages.export.openpcdet import OpenPcdetExport
from advpipe.stages.export.opv2v.form import Opv2vExport
from advpipe.stages.export.pcd import PcdExport

EXPORT_FORMS: Mapping[str, ExportForm] = {
    "kitti": KittiExport(),
    "openpcdet": OpenPcdetExport(),
    "nuscenes": NuscenesExport(),
    "opv2v": Opv2vExport(),
    "pcd": PcdExport(),
}
