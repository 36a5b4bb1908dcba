"""What OpenPCDet and MMDetection3D need beside KITTI's folders: configurations, and how to run them."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

_OPENPCDET = """\
# SECOND on this export, for OpenPCDet 0.6: its own configurations with other data, and no road planes.
_BASE_CONFIG_: cfgs/kitti_models/second.yaml
DATA_CONFIG:
  _BASE_CONFIG_: cfgs/dataset_configs/kitti_dataset.yaml
  DATA_PATH: ../data/advpipe/{clean}
  DATA_AUGMENTOR:
    DISABLE_AUG_LIST: [placeholder]
    AUG_CONFIG_LIST:
      - NAME: gt_sampling
        USE_ROAD_PLANE: False
        DB_INFO_PATH: [kitti_dbinfos_train.pkl]
        PREPARE:
          filter_by_min_points: ['Car:5', 'Pedestrian:5', 'Cyclist:5']
          filter_by_difficulty: [-1]
        SAMPLE_GROUPS: ['Car:20', 'Pedestrian:15', 'Cyclist:15']
        NUM_POINT_FEATURES: 4
        DATABASE_WITH_FAKELIDAR: False
        REMOVE_EXTRA_WIDTH: [0.0, 0.0, 0.0]
        LIMIT_WHOLE_SCENE: True
      - NAME: random_world_flip
        ALONG_AXIS_LIST: [x]
      - NAME: random_world_rotation
        WORLD_ROT_ANGLE: [-0.78539816, 0.78539816]
      - NAME: random_world_scaling
        WORLD_SCALE_RANGE: [0.95, 1.05]
"""

_OPENPCDET_INFOS = '''\
"""Makes OpenPCDet's info files of every folder of this export; run it from OpenPCDet's folder `tools`."""

from pathlib import Path

from easydict import EasyDict
from pcdet.config import cfg_from_yaml_file
from pcdet.datasets.kitti import kitti_dataset

kitti_dataset.Path = Path  # which that file imports only when it runs by itself
here = Path(__file__).resolve().parent
data = cfg_from_yaml_file(here / "second.yaml", EasyDict()).DATA_CONFIG
for sets in sorted(here.parent.glob("*/ImageSets")):
    kitti_dataset.create_kitti_infos(data, ["Car", "Pedestrian", "Cyclist"], sets.parent, sets.parent)
'''

_MMDET3D = """\
# SECOND on this export, for MMDetection3D 1.x: its own configuration with other data.
_base_ = 'mmdet3d::second/second_hv_secfpn_8xb6-80e_kitti-3d-3class.py'

data_root = 'data/advpipe/{clean}/'
db_sampler = dict(data_root=data_root, info_path=data_root + 'kitti_dbinfos_train.pkl')
train_pipeline = _base_.train_pipeline
train_pipeline[2]['db_sampler'].update(db_sampler)
train_dataloader = dict(dataset=dict(dataset=dict(data_root=data_root, pipeline=train_pipeline)))
val_dataloader = dict(dataset=dict(data_root=data_root))
test_dataloader = dict(dataset=dict(data_root=data_root))
val_evaluator = dict(ann_file=data_root + 'kitti_infos_val.pkl')
test_evaluator = dict(ann_file=data_root + 'kitti_infos_val.pkl')
"""

_README = """\
# {count} of advpipe in KITTI's form

Each folder with `training/` and `ImageSets/` is a data set of KITTI's object benchmark: {folders}.
A frame has the same name, labels and calibration in each. `velodyne/*.bin` hold x, y, z and intensity as
float32; labels are rounded to .01; `image_2` holds black pictures, from which toolboxes read the size.
`ImageSets/val.txt` lists the last fifth of the frames, `trainval.txt` all of them.

## OpenPCDet

From its folder `tools`, with EXPORT for this folder; the last line tests on an attacked copy:

    ln -s EXPORT ../data/advpipe
    python ../data/advpipe/openpcdet/create_infos.py
    python train.py --cfg_file ../data/advpipe/openpcdet/second.yaml
    python test.py --cfg_file ../data/advpipe/openpcdet/second.yaml --ckpt CHECKPOINT
    python test.py --cfg_file ../data/advpipe/openpcdet/second.yaml --ckpt CHECKPOINT \\
        --set DATA_CONFIG.DATA_PATH ../data/advpipe/{example}

Add `DATA_CONFIG.INFO_PATH.test kitti_infos_trainval.pkl DATA_CONFIG.DATA_SPLIT.test trainval` after `--set`
to test on all frames. Training samples objects from other frames, for which every class has to be in
`ImageSets/train.txt`; else add `--set DATA_CONFIG.DATA_AUGMENTOR.DISABLE_AUG_LIST gt_sampling`.

## MMDetection3D

From its folder, again with EXPORT for this one, and for each folder that is used:

    ln -s EXPORT data/advpipe
    python tools/create_data.py kitti --root-path data/advpipe/{clean} --out-dir data/advpipe/{clean} \\
        --extra-tag kitti
    python tools/train.py data/advpipe/mmdet3d/second.py
    python tools/test.py data/advpipe/mmdet3d/second.py CHECKPOINT
    python tools/test.py data/advpipe/mmdet3d/second.py CHECKPOINT --cfg-options \\
        test_dataloader.dataset.data_root=data/advpipe/{example}/ \\
        test_evaluator.ann_file=data/advpipe/{example}/kitti_infos_val.pkl
"""


def write_kitti_configurations(folder: Path, clean: str, attacked: Sequence[str]) -> None:
    """Write README.md, openpcdet/ and mmdet3d/ beside the folders `clean` and `attacked`."""
    names = [clean, *attacked]
    readme = _README.format(
        count=f"{len(names)} bag{'s' if len(names) > 1 else ''}",
        folders=", ".join(f"`{name}`" for name in names),
        clean=clean,
        example=attacked[0] if attacked else clean,
    )
    files = {
        "README.md": readme,
        "openpcdet/second.yaml": _OPENPCDET.format(clean=clean),
        "openpcdet/create_infos.py": _OPENPCDET_INFOS,
        "mmdet3d/second.py": _MMDET3D.format(clean=clean),
    }
    for name, text in files.items():
        (folder / name).parent.mkdir(exist_ok=True)
        (folder / name).write_text(text, encoding="utf-8")
