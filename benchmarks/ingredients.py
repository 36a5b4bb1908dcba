"""Ablation of the recipe `best`: mAP ratios and Chamfer distances on a validation drive.

    python benchmarks/ingredients.py BAG perturb|detach|attach [--budgets 5] [--only LINE ...] [--write]

Take a drive that no report is made of. Each line changes one thing of the recipe `best`, or is another
recipe; the random ones spend the same budget. Budgets are those of the paper's tables: eps in cm for perturb,
per cent of the points for detach, eps in m for attach. Figures are those of `advpipe evaluate`, of the
classes with at least 20 objects in these frames: ratios to the clean clouds under the same treatment. All
frames are attacked once for each line and budget, which takes long, two lines at a time.

`--write` puts the lines into the table that reports of `advpipe sweep` show.
"""

from __future__ import annotations

import argparse
import json
import time
from collections.abc import Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from contextlib import ExitStack
from dataclasses import dataclass, field, replace
from functools import cache
from pathlib import Path
from types import ModuleType
from typing import Any
from unittest.mock import patch

import numpy as np

from advpipe.pipeline.adversary import addition_problem, attack_objective, greedy_allocation, removal_problem
from advpipe.pipeline.adversary.targets import find_targets
from advpipe.pipeline.bag.frames import Frame, FrameSlice, read_frames
from advpipe.pipeline.bag.locate import resolve_bag
from advpipe.pipeline.bag.provenance import parent_sha256
from advpipe.pipeline.campaigns.sweep import ingredients
from advpipe.pipeline.core.code import source_commit
from advpipe.pipeline.core.seeding import named_generator
from advpipe.pipeline.defences.registry import parse_defences
from advpipe.pipeline.detector.protocol import ObjectDetector
from advpipe.pipeline.detector.registry import detector_sha256, load_detector
from advpipe.pipeline.detector.threads import fixed_torch_threads
from advpipe.pipeline.geometry.boxes import CLASSES
from advpipe.pipeline.geometry.iou import iou_3d
from advpipe.pipeline.messages.cloud import Cloud, xyzi
from advpipe.pipeline.metrics.average_precision import LOOSE_IOU, STRICT_IOU, average_precision
from advpipe.pipeline.metrics.chamfer import chamfer_distance
from advpipe.pipeline.metrics.matching import FrameMatches, match_overlaps
from advpipe.stages.attack.lidar import attach, detach
from advpipe.stages.attack.lidar.attach import Attach
from advpipe.stages.attack.lidar.detach import Detach
from advpipe.stages.attack.lidar.perturb import RECIPES, Perturb

OBJECTS = 20
"""With fewer objects of a class in the chosen frames, its average precision is not meaningful."""

TREATMENTS = {"plain": "", "jitter": "jitter:0.01", "rounding": "quantise:0.01"}
"""What is done to clean and attacked clouds before the detector sees them."""


@dataclass(frozen=True)
class Line:
    """Parameters of the attack, settings of `perturb`, and constants of ours that are others in this line."""

    parameters: Mapping[str, Any] = field(default_factory=dict)
    settings: Mapping[str, Any] = field(default_factory=dict)
    constant: tuple[ModuleType, str, float] | None = None


def settings(**changed: float) -> Line:
    return Line(settings=changed)


def constant(module: ModuleType, name: str, value: float) -> Line:
    return Line(constant=(module, name, value))


OTHER_RECIPES: Mapping[str, Line] = {
    f"recipe {name}": Line({"recipe": name})
    for name in ("best", "hide", "robust", "paper", "random", "random-near", "random-best")
}
CLIMBING: Mapping[str, Line] = {
    **OTHER_RECIPES,
    "half the rounds": Line({"rounds": 5}),
    "twice the rounds": Line({"rounds": 20}),
    "rounds of equal size": constant(greedy_allocation, "GROWTH_POWER", 1.0),
    "lower scores do not count": constant(attack_objective, "SCORE_LOSS_SHARE", 0.0),
    "no second look at the choice": constant(greedy_allocation, "MAX_REVISIONS", 1),
}
LINES: Mapping[str, Mapping[str, Line]] = {
    "perturb": {
        **OTHER_RECIPES,
        "the last try, not the best": settings(keep_best=False),
        "points cross singly": settings(groups=False),
        "no false boxes made surer": settings(decoys=False),
        "no gradient of a false truth": settings(decoy_gradients=False),
        "false boxes play no part": settings(decoys=False, decoy_gradients=False),
        "no momentum": settings(momentum=0.0),
        "momentum .8": settings(momentum=0.8),
        "half of the crossings, always": settings(first_probability=0.5, last_probability=0.5),
        "no new start from the best": settings(rounds_per_cycle=1000),
        "points in boxes only": settings(margin_m=0.0),
        "points within 3 m of boxes": settings(margin_m=3.0),
        "2 cm past a face": settings(landing_m=0.02),
        "half the steps": Line({"steps": RECIPES["best"] // 2}),
        "twice the steps": Line({"steps": 2 * RECIPES["best"]}),
    },
    "detach": {
        **CLIMBING,
        "points in boxes only": constant(detach, "MARGIN_M", 0.0),
        "points within 1 m of boxes": constant(detach, "MARGIN_M", 1.0),
        "at most half of an object": constant(removal_problem, "MAX_SHARE_PER_OBJECT", 0.5),
    },
    "attach": {
        **CLIMBING,
        "places in boxes only": constant(attach, "MARGIN_M", 0.0),
        "places within 1 m of boxes": constant(attach, "MARGIN_M", 1.0),
        "30 points an object": constant(addition_problem, "MAX_POINTS_PER_OBJECT", 30),
        "120 points an object": constant(addition_problem, "MAX_POINTS_PER_OBJECT", 120),
        "200 fresh places a round": constant(addition_problem, "NEW_CANDIDATES", 200),
        "far places as dear as near ones": Line({"decay_m": 100.0}),
        "points along rays": Line({"along_ray": True}),
        "occlusion order kept": Line({"keep_occlusion_order": True}),
    },
}
BUDGETS = {"perturb": [5.0], "detach": [0.3], "attach": [0.3]}


def attack_of(name: str, line: Line, budget: float) -> Perturb | Detach | Attach:
    if name == "perturb":
        attack = Perturb(eps_cm=budget, **line.parameters)
        attack.settings = replace(attack.settings, **line.settings)
        return attack
    if name == "detach":
        return Detach(ratio=budget / 100, **line.parameters)
    return Attach(eps_m=budget, **line.parameters)


@dataclass(frozen=True)
class Drive:
    """The clouds of a bag, the detector, and the seed of all draws."""

    bag: Path
    frames: str
    detector: str
    seed: int

    def scores(self, clouds: Sequence[Cloud]) -> dict[str, dict[str, float]]:
        """Average precision of `class kind` by treatment; classes with at least `OBJECTS` objects."""
        frames, detector = opened(self)
        found: dict[str, dict[str, float]] = {}
        for treatment, text in TREATMENTS.items():
            matched = []
            for frame, cloud in zip(frames, clouds, strict=True):
                for name, defence in parse_defences([text] if text else []).items():
                    rng = named_generator(self.seed, "ingredients", name, frame.index)
                    cloud = defence(cloud, rng).cloud
                matched.append(matches(frame, cloud, detector))
            kinds = [k for k in matched[0] if sum(m[k].n_truth for m in matched) >= OBJECTS]
            found[treatment] = {kind: average_precision([m[kind] for m in matched]) for kind in kinds}
        return found


@cache
def opened(drive: Drive) -> tuple[list[Frame], ObjectDetector]:
    """Once a process."""
    return list(read_frames(drive.bag, FrameSlice.parse(drive.frames))), load_detector(drive.detector)


@cache
def clean_scores(drive: Drive) -> dict[str, dict[str, float]]:
    return drive.scores([frame.cloud for frame in opened(drive)[0]])


def measure(drive: Drive, name: str, line_name: str, budget: float) -> dict[str, Any]:
    """One line: attack every cloud and score what is left."""
    frames, detector = opened(drive)
    line = LINES[name][line_name]
    attack = attack_of(name, line, budget)
    with fixed_torch_threads(), ExitStack() as changed:
        clean = clean_scores(drive)
        if line.constant:
            changed.enter_context(patch.object(*line.constant))
        start_s = time.perf_counter()
        results = [
            attack(f.cloud, f.boxes, detector, named_generator(drive.seed, "ingredients", f.index))
            for f in frames
        ]
        spent_s = time.perf_counter() - start_s
        left = drive.scores([result.cloud for result in results])
    distances = [
        chamfer_distance(finite_xyz(f.cloud), finite_xyz(r.cloud))
        for f, r in zip(frames, results, strict=True)
    ]
    car = {kind: left["plain"][f"car {kind}"] / clean["plain"][f"car {kind}"] for kind in ("strict", "loose")}
    return {
        "line": line_name,
        "budget": budget,
        **{
            f"map_ratio_{treatment}_percent": 100 * mean_of(left, treatment) / mean_of(clean, treatment)
            for treatment in TREATMENTS
        },
        "map_ratio_loose_percent": 100 * mean_of(left, "plain", "loose") / mean_of(clean, "plain", "loose"),
        "car_ratio_percent": 100 * car["strict"],
        "car_ratio_loose_percent": 100 * car["loose"],
        "chamfer_distance_m2": float(np.mean(distances)),
        "s_per_frame": round(spent_s / len(frames), 1),
    }


def mean_of(scores: Mapping[str, Mapping[str, float]], treatment: str, kind: str = "strict") -> float:
    return float(np.mean([value for name, value in scores[treatment].items() if name.endswith(kind)]))


def matches(frame: Frame, cloud: Cloud, detector: ObjectDetector) -> dict[str, FrameMatches]:
    """What the detector finds of each class in a cloud, matched by the strict and the loose overlap."""
    found = detector.detect(cloud)
    evaluated = find_targets(detector, frame.cloud, frame.boxes).boxes.numpy().astype(np.float64)
    result = {}
    for label, name in enumerate(detector.classes):
        truth = frame.boxes.geometry[frame.boxes.labels == CLASSES.index(name)]
        counts = np.array([(np.abs(evaluated - box) < 1e-4).all(axis=1).any() for box in truth], bool)
        mine = found.labels == label
        overlap = iou_3d(found.boxes[mine], truth)
        for kind, least in (("strict", STRICT_IOU), ("loose", LOOSE_IOU)):
            result[f"{name} {kind}"] = match_overlaps(overlap, counts, found.scores[mine], least[name])
    return result


def finite_xyz(cloud: Cloud) -> np.ndarray:
    points = xyzi(cloud)
    return points[np.isfinite(points).all(axis=1), :3]


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("bag", type=Path)
    parser.add_argument("attack", choices=list(LINES))
    parser.add_argument("--budgets", type=float, nargs="+")
    parser.add_argument("--frames", default="10:150:18", help="which clouds, as start:stop:step")
    parser.add_argument("--only", nargs="+", metavar="LINE")
    parser.add_argument("--detector", default="small")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--write", action="store_true", help="into the table of the sweep's reports")
    given = parser.parse_args()
    line_names = given.only or list(LINES[given.attack])
    if unknown := [line_name for line_name in line_names if line_name not in LINES[given.attack]]:
        parser.error(f"unknown line {unknown[0]!r}; known: {', '.join(LINES[given.attack])}")
    drive = Drive(resolve_bag(given.bag), given.frames, given.detector, given.seed)
    with fixed_torch_threads():
        clean = clean_scores(drive)
    classes = [name.removesuffix(" strict") for name in clean["plain"] if name.endswith("strict")]
    if "car" not in classes:
        parser.error(f"fewer than {OBJECTS} cars in these frames; choose more with --frames")
    indices = [frame.index for frame in opened(drive)[0]]
    print(f"{len(indices)} frames, classes {', '.join(classes)}; clean AP {clean['plain']}")
    print(f"{'':<32} budget  mAP ratio %  loose  jitter  rounded    cars  loose    CD m²  s a frame")
    with ProcessPoolExecutor(given.workers) as pool:
        jobs = [
            pool.submit(measure, drive, given.attack, line_name, budget)
            for line_name in line_names
            for budget in given.budgets or BUDGETS[given.attack]
        ]
        lines = []
        for job in jobs:
            lines.append(line := job.result())
            print(
                f"{line['line']:<32} {line['budget']:6g} {line['map_ratio_plain_percent']:12.1f} "
                f"{line['map_ratio_loose_percent']:6.1f} {line['map_ratio_jitter_percent']:7.1f} "
                f"{line['map_ratio_rounding_percent']:8.1f} {line['car_ratio_percent']:7.1f} "
                f"{line['car_ratio_loose_percent']:6.1f} {line['chamfer_distance_m2']:8.5f} "
                f"{line['s_per_frame']:9.1f}",
                flush=True,
            )
    if given.write:
        stored = json.loads(ingredients.PATH.read_text(encoding="utf-8")) if ingredients.PATH.exists() else {}
        stored[given.attack] = {
            "detector": given.detector,
            "detector_sha256": detector_sha256(given.detector),
            "clean_sha256": parent_sha256(drive.bag),
            "commit": source_commit(),
            "seed": given.seed,
            "frames": given.frames,
            "frame_list": indices,
            "classes": classes,
            "clean": clean,
            "lines": lines,
        }
        ingredients.PATH.write_text(json.dumps(stored, indent=1, sort_keys=True) + "\n", encoding="utf-8")
        print(f"written: {ingredients.PATH}")


if __name__ == "__main__":
    main()
