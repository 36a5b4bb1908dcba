"""Draws one scan of a radar from above, clean and attacked, with the true road users.

    python benchmarks/radar_picture.py CLEAN ATTACKED FRAME PICTURE [--radar front] [--beyond 90]

docs/images/radar.png is of a drive on the shipped map `highway` with guard rails and the preset `imaging-4d`,
attacked with radar-spoof.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import matplotlib
import numpy as np
import pyarrow.parquet as pq

matplotlib.use("Agg")
import matplotlib.pyplot as plt

from advpipe.pipeline.bag.ground_truth import GroundTruth
from advpipe.pipeline.bag.reader import BagReader
from advpipe.pipeline.geometry.boxes import box_corners
from advpipe.pipeline.labels.scans import ADDED, FILE
from advpipe.pipeline.messages.radar import StampedScan, scan_from_cdr, xyz_of_returns
from advpipe.pipeline.messages.topics import VehicleTopics

STILL, COMING, LEAVING = "#9aa5b1", "#d61f26", "#1f5fd6"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("clean", type=Path)
    parser.add_argument("attacked", type=Path)
    parser.add_argument("frame", type=int)
    parser.add_argument("picture", type=Path)
    parser.add_argument("--radar", default="front")
    parser.add_argument("--beyond", type=float, default=90.0, help="metres ahead that are shown")
    options = parser.parse_args()
    figure, panels = plt.subplots(2, 1, figsize=(9.2, 5.6), dpi=110, sharex=True, layout="constrained")
    for axes, bag, title in zip(
        panels, (options.clean, options.attacked), ("clean", "attacked: radar-spoof"), strict=True
    ):
        draw(axes, options.clean, scan_of(bag, options), options)
        mark_added(axes, bag, scan_of(bag, options))
        axes.set_title(title, loc="left", fontsize=10)
    panels[-1].set_xlabel("ahead [m]")
    handles, labels = panels[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=5, frameon=False, fontsize=9)
    figure.savefig(options.picture)


def scan_of(bag: Path, options: argparse.Namespace) -> StampedScan:
    raws = list(BagReader(bag).raw_messages([VehicleTopics().radar_scan(options.radar).name]))
    return scan_from_cdr(raws[options.frame].cdr)


def mark_added(axes: plt.Axes, bag: Path, scan: StampedScan) -> None:
    """Rings around what an attack added."""
    path = bag / FILE
    rows = pq.read_table(path).to_pylist() if path.exists() else []
    places = [row["attacked"] for row in rows if row["stamp_ns"] == scan.stamp_ns and row["action"] == ADDED]
    place_m = xyz_of_returns(scan.returns[np.array(places, int)])
    if len(place_m):
        axes.scatter(*place_m[:, :2].T, s=110, facecolors="none", edgecolors=COMING, linewidths=1.2)
        axes.annotate(
            "forged", place_m[0, :2], (8, -16), textcoords="offset points", color=COMING, fontsize=9
        )


def draw(axes: plt.Axes, clean: Path, scan: StampedScan, options: argparse.Namespace) -> None:
    """Returns by their velocity over the ground, as large as their RCS, and boxes in the radar's frame."""
    reader, topics = BagReader(clean), VehicleTopics()
    truth = GroundTruth(reader, topics, topics.objects.name)
    speed_mps = 0.0
    for raw in reader.raw_messages(
        sorted({*truth.topic_names} & reader.topics.keys()), last_ns=scan.stamp_ns
    ):
        truth.take(raw)
        if raw.topic.name == topics.true_odometry.name:
            speed_mps = reader.decode(raw).twist.twist.linear.x
    boxes = truth.boxes(scan.stamp_ns, scan.frame_id)
    for number, corners in enumerate(box_corners(boxes.geometry)):
        label = "true road users" if number == 0 else "_"
        axes.plot(*corners[[0, 1, 2, 3, 0], :2].T, color="#1b2430", linewidth=1, label=label)
    place_m = xyz_of_returns(scan.returns)
    over_ground = scan.returns["velocity"] + speed_mps * place_m[:, 0] / scan.returns["range"]
    for chosen, colour, label in (
        (np.abs(over_ground) <= 1, STILL, "stands still"),
        (over_ground > 1, LEAVING, "moves away over the ground"),
        (over_ground < -1, COMING, "comes nearer over the ground"),
    ):
        axes.scatter(*place_m[chosen][:, :2].T, s=7, color=colour, linewidths=0, label=label)
    axes.plot(0, 0, ">", color="#0a7f7f", markersize=8, label="radar")
    axes.set(xlim=(-4, options.beyond), ylim=(-19, 19), ylabel="to the left [m]", aspect="equal")


if __name__ == "__main__":
    main()
