"""SECOND as a family of detectors."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING

from advpipe.pipeline.detector.family import Family
from advpipe.pipeline.detector.second.presets import KITTI, PRESETS, SecondPreset

if TYPE_CHECKING:
    from advpipe.pipeline.detector.second.model import SecondNet

SHIPPED = {"small": Path(__file__).parent / "checkpoints" / "small.safetensors"}


class SecondFamily(Family):
    """SECOND in pure PyTorch, and OpenPCDet's weights for its preset `kitti`."""

    @property
    def presets(self) -> Mapping[str, SecondPreset]:
        return PRESETS

    @property
    def shipped(self) -> Mapping[str, Path]:
        return SHIPPED

    def network(self, preset: str) -> SecondNet:
        from advpipe.pipeline.detector.second.model import SecondNet

        return SecondNet(self.presets[preset])

    def import_weights(self, file: Path) -> tuple[SecondNet, dict[str, str]]:
        from advpipe.pipeline.detector.common.openpcdet import import_openpcdet

        net = self.network(KITTI.name)
        return net, import_openpcdet(file, net)
