"""CenterPoint as a family of detectors."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING

from advpipe.pipeline.detector.centerpoint.presets import PRESETS, WAYMO, CenterPointPreset
from advpipe.pipeline.detector.family import Family

if TYPE_CHECKING:
    from advpipe.pipeline.detector.centerpoint.model import CenterPointNet

SHIPPED = {"centerpoint": Path(__file__).parent / "checkpoints" / "centerpoint.safetensors"}


class CenterPointFamily(Family):
    """CenterPoint in pure PyTorch, and OpenPCDet's weights for its preset `waymo`."""

    @property
    def presets(self) -> Mapping[str, CenterPointPreset]:
        return PRESETS

    @property
    def shipped(self) -> Mapping[str, Path]:
        return SHIPPED

    def network(self, preset: str) -> CenterPointNet:
        from advpipe.pipeline.detector.centerpoint.model import CenterPointNet

        return CenterPointNet(self.presets[preset])

    def import_weights(self, file: Path) -> tuple[CenterPointNet, dict[str, str]]:
        from advpipe.pipeline.detector.common.openpcdet import import_openpcdet

        net = self.network(WAYMO.name)
        return net, import_openpcdet(file, net)
