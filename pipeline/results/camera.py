"""What `report.json` lists as `camera`."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

from advpipe.pipeline.results.listed import Listed


@dataclass(frozen=True)
class CameraRecord(Listed):
    """An image detector on the pictures of one camera: one class at one of KITTI's difficulties. Beside an
    adversarial bag, the clean figures are those of the same moments."""

    bag: Annotated[str, "adversarial bag, or `clean`"]
    vehicle: Annotated[str, "vehicle that carries the camera"]
    camera: Annotated[str, "name of the camera"]
    detector: Annotated[str, "image detector"]
    detector_sha256: Annotated[str, "SHA-256 of its checkpoint, or of the source file of its class"]
    condition: Annotated[str, "`clean` or `adv`: the pictures that the detector saw"]
    class_name: Annotated[str, "class of road users"]
    difficulty: Annotated[
        str, "easy, moderate or hard, by KITTI's limits of height, occlusion and truncation"
    ]
    pictures: Annotated[int, "number of moments that are scored; of an adversarial bag, the attacked ones"]
    objects: Annotated[int, "number of objects that count at this difficulty, in all pictures together"]
    ap: Annotated[
        float, "2D average precision (R40) at KITTI's overlap (car, truck 0.7, others 0.5), in [0, 1]"
    ]
    ap_half: Annotated[float, "the same at an overlap of 0.5 for every class, in [0, 1]"]
    min_score: Annotated[float, "score with the best F1 on the clean pictures, at an overlap of 0.5"]
    found: Annotated[int, "number of these objects that are detected with it, at an overlap of 0.5"]
    lost: Annotated[int, "number of those found in the clean pictures that are not found in these"]
