"""PointPillars as a family of detectors."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING

from advpipe.pipeline.detector.family import Family
from advpipe.pipeline.detector.pointpillars.presets import KITTI, PRESETS, PointPillarsPreset

if TYPE_CHECKING:
    from advpipe.pipeline.detector.pointpillars.model import PointPillarsNet

SHIPPED = {"pointpillars": Path(__file__).parent / "checkpoints" / "pointpillars.safetensors"}


class PointPillarsFamily(Family):
    """PointPillars in pure PyTorch, and OpenPCDet's weights for its preset `kitti`."""

    @property
    def presets(self) -> Mapping[str, PointPillarsPreset]:
        return PRESETS

    @property
    def shipped(self) -> Mapping[str, Path]:
        return SHIPPED

    def network(self, preset: str) -> PointPillarsNet:
        from advpipe.pipeline.detector.pointpillars.model import PointPillarsNet

        return PointPillarsNet(self.presets[preset])

    def import_weights(self, file: Path) -> tuple[PointPillarsNet, dict[str, str]]:
        from advpipe.pipeline.detector.common.openpcdet import import_openpcdet

        net = self.network(KITTI.name)
        return net, import_openpcdet(file, net)
