"""SECOND (Yan, Mao, Li: "SECOND: Sparsely Embedded Convolutional Detection", Sensors 2018)."""

from __future__ import annotations

from collections.abc import Mapping

from advpipe.pipeline.detector.common.anchor_network import AnchorNetwork
from advpipe.pipeline.detector.common.head import Head, Predictions
from advpipe.pipeline.detector.common.sparse_network import SparseNetwork
from advpipe.pipeline.detector.common.voxel_detector import VoxelNetworkDetector
from advpipe.pipeline.detector.common.voxels import Voxels
from advpipe.pipeline.detector.second.presets import SecondPreset


class SecondNet(SparseNetwork[Predictions], AnchorNetwork[Voxels]):
    """Voxels, sparse 3D backbone, bird's-eye backbone, anchor head."""

    preset: SecondPreset

    def __init__(self, preset: SecondPreset) -> None:
        super().__init__(preset)
        self.head = Head(preset, self.backbone2d.out_channels)

    def detector(self, provenance: Mapping[str, str]) -> Second:
        return Second(self, provenance)


class Second(VoxelNetworkDetector[SecondNet]):
    """A trained SECOND as a `BatchDetector`."""

    @property
    def preset(self) -> SecondPreset:
        """The preset of the network."""
        return self.net.preset
