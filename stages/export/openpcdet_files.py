"""What OpenPCDet needs beside its folders of points and labels: configurations, and how to run them."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

_SECOND = """\
# SECOND on this export, for OpenPCDet 0.6: its own model for KITTI, all around, on custom data.
_BASE_CONFIG_: cfgs/kitti_models/second.yaml
CLASS_NAMES: [Car, Pedestrian, Cyclist]
DATA_CONFIG:
  _BASE_CONFIG_: cfgs/dataset_configs/custom_dataset.yaml
  DATA_PATH: ../data/advpipe/{clean}
  POINT_CLOUD_RANGE: [-70.4, -40, -3, 70.4, 40, 1]
  MAP_CLASS_TO_KITTI: {{Car: Car, Pedestrian: Pedestrian, Cyclist: Cyclist}}
  DATA_AUGMENTOR:
    DISABLE_AUG_LIST: [placeholder]
    AUG_CONFIG_LIST:
      - NAME: gt_sampling
        USE_ROAD_PLANE: False
        DB_INFO_PATH: [custom_dbinfos_train.pkl]
        PREPARE:
          filter_by_min_points: ['Car:5', 'Pedestrian:5', 'Cyclist:5']
        SAMPLE_GROUPS: ['Car:20', 'Pedestrian:15', 'Cyclist:15']
        NUM_POINT_FEATURES: 4
        DATABASE_WITH_FAKELIDAR: False
        REMOVE_EXTRA_WIDTH: [0.0, 0.0, 0.0]
        LIMIT_WHOLE_SCENE: True
      - NAME: random_world_flip
        ALONG_AXIS_LIST: [x, y]
      - NAME: random_world_rotation
        WORLD_ROT_ANGLE: [-0.78539816, 0.78539816]
      - NAME: random_world_scaling
        WORLD_SCALE_RANGE: [0.95, 1.05]
  DATA_PROCESSOR:
    - NAME: mask_points_and_boxes_outside_range
      REMOVE_OUTSIDE_BOXES: True
    - NAME: shuffle_points
      SHUFFLE_ENABLED: {{train: True, test: False}}
    - NAME: transform_points_to_voxels
      VOXEL_SIZE: [0.05, 0.05, 0.1]
      MAX_POINTS_PER_VOXEL: 5
      MAX_NUMBER_OF_VOXELS: {{train: 60000, test: 90000}}
"""

_INFOS = '''\
"""Makes OpenPCDet's info files of every folder of this export; run it from OpenPCDet's folder `tools`."""

from pathlib import Path

from easydict import EasyDict
from pcdet.config import cfg_from_yaml_file
from pcdet.datasets.custom import custom_dataset

custom_dataset.Path = Path  # which that file imports only when it runs by itself
here = Path(__file__).resolve().parent
config = cfg_from_yaml_file(here / "second.yaml", EasyDict())
for sets in sorted(here.parent.glob("*/ImageSets")):
    custom_dataset.create_custom_infos(config.DATA_CONFIG, config.CLASS_NAMES, sets.parent, sets.parent)
'''

_README = """\
# Bags of advpipe as custom data sets of OpenPCDet

Each folder with `points/`, `labels/` and `ImageSets/` is a data set: {folders}. A frame has the same name
and labels in each. `points/*.npy` hold x, y, z and intensity as float32 in the LiDAR's frame; a line of
`labels/*.txt` has x y z dx dy dz heading class, in metres and radians, with every digit.
`ImageSets/val.txt` lists the last fifth of the frames.

From OpenPCDet's folder `tools`, with EXPORT for this folder; the last line tests on an attacked copy:

    ln -s EXPORT ../data/advpipe
    python ../data/advpipe/openpcdet/create_infos.py
    python train.py --cfg_file ../data/advpipe/openpcdet/second.yaml
    python test.py --cfg_file ../data/advpipe/openpcdet/second.yaml --ckpt CHECKPOINT
    python test.py --cfg_file ../data/advpipe/openpcdet/second.yaml --ckpt CHECKPOINT \\
        --set DATA_CONFIG.DATA_PATH ../data/advpipe/{example}

Training samples objects from other frames, for which every class has to be in `ImageSets/train.txt`; else add
`--set DATA_CONFIG.DATA_AUGMENTOR.DISABLE_AUG_LIST gt_sampling`.
"""


def write_openpcdet_configurations(folder: Path, clean: str, attacked: Sequence[str]) -> None:
    """Write README.md and openpcdet/ beside the folders `clean` and `attacked`."""
    names = ", ".join(f"`{name}`" for name in (clean, *attacked))
    files = {
        "README.md": _README.format(folders=names, example=attacked[0] if attacked else clean),
        "openpcdet/second.yaml": _SECOND.format(clean=clean),
        "openpcdet/create_infos.py": _INFOS,
    }
    for name, text in files.items():
        (folder / name).parent.mkdir(exist_ok=True)
        (folder / name).write_text(text, encoding="utf-8")
