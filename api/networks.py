"""The parts of detectors that `advpipe train` trains: presets, anchors, backbone, head, losses, decoding.

A family of detectors of your own is built from them; `FAMILIES` holds the families by name. Importing this
module loads PyTorch, which `import advpipe` does not.
"""

from __future__ import annotations

from advpipe.pipeline.detector.common.anchors import AnchorGrid as AnchorGrid
from advpipe.pipeline.detector.common.backbone2d import Backbone2d as Backbone2d
from advpipe.pipeline.detector.common.decode import decode_detections as decode_detections
from advpipe.pipeline.detector.common.head import Head as Head
from advpipe.pipeline.detector.common.head import Predictions as Predictions
from advpipe.pipeline.detector.common.loss import LOSS_PARTS as LOSS_PARTS
from advpipe.pipeline.detector.common.loss import losses as losses
from advpipe.pipeline.detector.common.network import DetectionNetwork as DetectionNetwork
from advpipe.pipeline.detector.common.network import LabelledPoints as LabelledPoints
from advpipe.pipeline.detector.common.network import NetworkDetector as NetworkDetector
from advpipe.pipeline.detector.common.padded_voxels import padded_voxels as padded_voxels
from advpipe.pipeline.detector.common.preset import Anchor as Anchor
from advpipe.pipeline.detector.common.preset import AnchorPreset as AnchorPreset
from advpipe.pipeline.detector.common.preset import BevBlock as BevBlock
from advpipe.pipeline.detector.families import FAMILIES as FAMILIES
from advpipe.pipeline.detector.family import Family as Family
