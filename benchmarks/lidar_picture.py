"""Draws the range and the intensity of one turn of each LiDAR, ring by ring, as published range images are.

    python benchmarks/lidar_picture.py PICTURE BAG@FRAME [BAG@FRAME ...]

docs/images/lidar.png is frame 40 of three drives of `boulevard` with the preset hdl-64e: with all
imperfections turned off and a linear intensity (docs/scenarios.md has the keys), as it is, and in rain of
10 mm/h.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import matplotlib
import numpy as np
import numpy.typing as npt

matplotlib.use("Agg")
import matplotlib.pyplot as plt

from advpipe.pipeline.bag.frames import read_frames
from advpipe.pipeline.bag.locate import resolve_bag
from advpipe.pipeline.bag.reader import BagReader
from advpipe.pipeline.core.frame_slice import FrameSlice
from advpipe.pipeline.messages.cloud import Cloud, xyz

AHEAD_DEG, COLUMN_DEG = 60.0, 0.18
FARTHEST_M, BRIGHTEST = 50.0, 0.6


def images(cloud: Cloud) -> tuple[npt.NDArray[np.float64], npt.NDArray[np.float64]]:
    """Range and intensity (rings, columns), the highest ring first; NaN without a return."""
    points = xyz(cloud)
    azimuth_deg = np.rad2deg(np.arctan2(points[:, 1], points[:, 0]))
    rings, columns = int(cloud["ring"].max()) + 1, int(2 * AHEAD_DEG / COLUMN_DEG)
    column = np.floor((AHEAD_DEG - azimuth_deg) / COLUMN_DEG).astype(int)
    ahead = (column >= 0) & (column < columns)
    pair = np.full((2, rings, columns), np.nan)
    at = rings - 1 - cloud["ring"][ahead], column[ahead]
    pair[0][at], pair[1][at] = np.linalg.norm(points[ahead], axis=1), cloud["intensity"][ahead]
    return pair[0], pair[1]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("picture", type=Path)
    parser.add_argument("bags", nargs="+", metavar="BAG@FRAME")
    given = parser.parse_args()
    colours = plt.get_cmap("turbo").with_extremes(bad="black")
    greys = plt.get_cmap("gray").with_extremes(bad="#3a0d2e")
    figure, panels = plt.subplots(2 * len(given.bags), 1, figsize=(8, 2.4 * len(given.bags)), dpi=90)
    for index, name in enumerate(given.bags):
        bag, _, frame = name.partition("@")
        number = int(frame or 0)
        reader = BagReader(resolve_bag(Path(bag)))
        cloud = next(iter(read_frames(reader, FrameSlice.parse(f"{number}:{number + 1}")))).cloud
        range_m, intensity = images(cloud)
        shown = {"aspect": "auto", "interpolation": "nearest", "vmin": 0}
        panels[2 * index].imshow(range_m, cmap=colours, vmax=FARTHEST_M, **shown)
        panels[2 * index + 1].imshow(intensity, cmap=greys, vmax=BRIGHTEST, **shown)
    for panel in panels:
        panel.axis("off")
    figure.subplots_adjust(0, 0, 1, 1, 0, 0.04)
    figure.savefig(given.picture)


if __name__ == "__main__":
    main()
