"""Scores an image detector on the labelled pictures of bags: 2D AP (R40) by class and KITTI's difficulties.

    python benchmarks/camera_detector.py BAG... [--detector small]

Each bag is scored by itself, and all of them together. The drives that `benchmarks/train_camera.sh` makes for
it are `test_*`. Prints, too, the processor time of one picture on one thread.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Sequence
from pathlib import Path

from advpipe.pipeline.bag.locate import resolve_bag
from advpipe.pipeline.image_detector.protocol import ImageDetections
from advpipe.pipeline.image_detector.registry import image_detector_named
from advpipe.pipeline.image_detector.scoring import PictureTruth, picture_precisions
from advpipe.stages.train.camera.pictures import labelled_pictures

Scored = tuple[list[PictureTruth], list[ImageDetections]]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("bags", nargs="+", type=Path)
    parser.add_argument("--detector", default="small")
    given = parser.parse_args()
    detector = image_detector_named(given.detector)
    all_of: Scored = [], []
    least_s = float("inf")
    for path in given.bags:
        truths, found = Scored(([], []))
        for picture in labelled_pictures(resolve_bag(path)):
            start_s = time.process_time()
            found.append(detector.detect(picture.rgb))
            least_s = min(least_s, time.process_time() - start_s)
            truths.append(picture.truth)
        all_of[0].extend(truths)
        all_of[1].extend(found)
        report(path.name, truths, found, detector.classes)
    if len(given.bags) > 1:
        report("all", *all_of, detector.classes)
    print(f"one picture: {1000 * least_s:.1f} ms of processor at best")


def report(
    name: str, truths: Sequence[PictureTruth], found: Sequence[ImageDetections], classes: Sequence[str]
) -> None:
    """Prints the rows of a table in Markdown."""
    print(f"\n{name}: {len(truths)} pictures\n")
    print("| class | difficulty | objects | AP % | AP at 0.5 % |\n|---|---|--:|--:|--:|")
    for each in picture_precisions(truths, found, classes):
        print(
            f"| {each.class_name} | {each.difficulty} | {each.objects} | {100 * each.strict:.1f} | "
            f"{100 * each.half:.1f} |"
        )


if __name__ == "__main__":
    main()
