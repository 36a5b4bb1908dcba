"""What `report.json` lists as `kitti`."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

from advpipe.pipeline.results.listed import Listed


@dataclass(frozen=True)
class KittiRecord(Listed):
    """The average precision of a class at a difficulty by KITTI's own rules, on one condition of one bag."""

    bag: Annotated[str, "adversarial bag, or `clean`"]
    detector: Annotated[str, "evaluated detector"]
    condition: Annotated[str, "`clean` or `adv`: the clouds that the detector saw"]
    class_name: Annotated[str, "KITTI's name of the class"]
    difficulty: Annotated[str, "easy, moderate or hard"]
    space: Annotated[str, "`bbox` (2D box in the image), `bev`, `3d`, or `aos` (orientation similarity)"]
    overlaps: Annotated[str, "`official` overlaps, or the `loose` ones of OpenPCDet"]
    min_iou: Annotated[float, "overlap that a detection has to exceed"]
    objects: Annotated[int, "number of objects that count at this difficulty"]
    frames: Annotated[int, "number of frames"]
    r11: Annotated[float, "average precision at 11 recall positions, in [0, 1]"]
    r40: Annotated[float, "average precision at 40 recall positions, in [0, 1]"]
