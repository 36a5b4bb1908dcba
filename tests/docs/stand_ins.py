"""Modules in the place of OpenPCDet and MMDetection3D, which take the same calls as those.

They stand for what docs/extending.md calls of them, no more; the packages are not installed here.
"""

from __future__ import annotations

import sys
from types import ModuleType, SimpleNamespace

import torch
from torch import nn
from torch.nn import functional as F

RANGE_M, SIZE_M, MOST = [0.0, -20.0, -3.0, 40.0, 20.0, 1.0], [0.5, 0.5, 4.0], 5
CLASSES = ["Car", "Pedestrian", "Cyclist"]
ANCHORS = torch.tensor(
    [
        [10.0, 2.0, -1.0, 4.0, 2.0, 1.6, 0.1, 0],
        [6.0, -2.0, -0.8, 0.8, 0.6, 1.8, 0.0, 1],
        [5.0, 9.0, -1.0, 4.0, 2.0, 1.6, 0.0, 0],
    ]
)
"""Boxes and labels; the third is beyond the view."""


class AnchorNetwork(nn.Module):
    """Scores each anchor by the means of voxels near it, after a batch norm that must not learn."""

    def __init__(self):
        super().__init__()
        self.norm = nn.BatchNorm1d(3)
        self.device = torch.device("cpu")

    def logits(self, voxels, counts, cells):
        assert voxels.shape[1:] == (MOST, 4)
        assert cells.dtype == torch.int32
        assert not (cells[:, 0]).any()
        assert not self.norm.training
        means = self.norm(voxels[..., :3].sum(1) / counts[:, None])
        near = torch.exp(-(means[:, None] - ANCHORS[None, :, :3]).square().sum(2) / 2)
        return near.sum(0) - 5

    def loss_of(self, logits, boxes, labels):
        """Boxes by their centres; labels from 0."""
        nearest = torch.cdist(boxes[:, :2], ANCHORS[:, :2]).argmin(1)
        return (F.softplus(-logits[nearest]) * (1 + labels)).sum()


class PcdetNetwork(AnchorNetwork):
    """Called with a batch, as OpenPCDet's models are."""

    def load_params_from_file(self, filename, logger, to_cpu=False):
        logger.info(filename)

    def forward(self, batch):
        assert batch["batch_size"] == 1
        assert batch["points"].shape[1] == 5
        logits = self.logits(batch["voxels"], batch["voxel_num_points"], batch["voxel_coords"])
        if self.training:
            (targets,) = batch["gt_boxes"]
            return {"loss": self.loss_of(logits, targets[:, :7], targets[:, 7] - 1)}, {}, {}
        boxes, labels = ANCHORS[:, :7], ANCHORS[:, 7].long() + 1
        found = {"pred_boxes": boxes, "pred_scores": logits.sigmoid(), "pred_labels": labels}
        return [found], {}


class Boxes:
    """LiDARInstance3DBoxes: the centre of the bottom; `origin`: where in the box a given centre lies."""

    def __init__(self, tensor, origin=(0.5, 0.5, 0.0)):
        self.tensor = tensor.clone()
        self.tensor[:, 2] -= origin[2] * tensor[:, 5]

    @property
    def gravity_center(self):
        centre = self.tensor[:, :3].clone()
        centre[:, 2] += self.tensor[:, 5] / 2
        return centre


class Mmdet3dNetwork(AnchorNetwork):
    """Has the methods of a detector of MMDetection3D 1.x; it never trains here.

    Without `train_cfg` its head has nothing that assigns targets to anchors, and no loss.
    """

    def __init__(self, model_cfg):
        super().__init__()
        self.train_cfg = model_cfg.train_cfg

    data_preprocessor = SimpleNamespace(
        voxel_layer=SimpleNamespace(point_cloud_range=RANGE_M, voxel_size=SIZE_M, max_num_points=MOST)
    )

    def predict(self, inputs, samples):
        (sample,), voxels = samples, inputs["voxels"]
        logits = self.logits(voxels["voxels"], voxels["num_points"], voxels["coors"])
        boxes = sample.metainfo["box_type_3d"](ANCHORS[:, :7], origin=(0.5, 0.5, 0.5))
        sample.pred_instances_3d = SimpleNamespace(
            bboxes_3d=boxes, scores_3d=logits.sigmoid(), labels_3d=ANCHORS[:, 7].long()
        )
        return [sample]

    def loss(self, inputs, samples):
        assert self.train_cfg is not None
        (sample,), voxels = samples, inputs["voxels"]
        logits = self.logits(voxels["voxels"], voxels["num_points"], voxels["coors"])
        truth = sample.gt_instances_3d
        centres = torch.cat([truth.bboxes_3d.gravity_center, truth.bboxes_3d.tensor[:, 3:]], dim=1)
        return {"loss_cls": [self.loss_of(logits, centres, truth.labels_3d)]}

    def parse_losses(self, losses):
        return sum(losses["loss_cls"]), {}


class Bunch(SimpleNamespace):
    """Keyword arguments as attributes, as InstanceData and Det3DDataSample have them."""


def _modules():
    step = SimpleNamespace(NAME="transform_points_to_voxels", VOXEL_SIZE=SIZE_M, MAX_POINTS_PER_VOXEL=MOST)
    cfg = SimpleNamespace(MODEL=None, CLASS_NAMES=CLASSES, DATA_CONFIG=SimpleNamespace(DATA_PROCESSOR=[step]))

    mm_config = SimpleNamespace(
        model=SimpleNamespace(train_cfg={}), metainfo=SimpleNamespace(classes=CLASSES)
    )

    class DatasetTemplate:
        def __init__(self, dataset_cfg, class_names, training, root_path, logger):
            assert not training
            self.point_cloud_range = RANGE_M

    return {
        "pcdet": {},
        "pcdet.config": {"cfg": cfg, "cfg_from_yaml_file": lambda file, config: config},
        "pcdet.datasets": {"DatasetTemplate": DatasetTemplate},
        "pcdet.models": {"build_network": lambda model_cfg, num_class, dataset: PcdetNetwork()},
        "mmdet3d": {},
        "mmdet3d.registry": {"MODELS": SimpleNamespace(build=Mmdet3dNetwork)},
        "mmdet3d.structures": {"Det3DDataSample": Bunch, "LiDARInstance3DBoxes": Boxes},
        "mmengine": {},
        "mmengine.config": {"Config": SimpleNamespace(fromfile=lambda file: mm_config)},
        "mmengine.registry": {"init_default_scope": lambda scope: None},
        "mmengine.runner": {"load_checkpoint": lambda model, file, map_location: {}},
        "mmengine.structures": {"InstanceData": Bunch},
    }


def install(monkeypatch):
    """Put them where Python looks for modules, for the time of a test."""
    for name, contents in _modules().items():
        module = ModuleType(name)
        vars(module).update(contents)
        monkeypatch.setitem(sys.modules, name, module)
