"""What each ingredient of `perturb` brings: AP ratios and Chamfer distances on a validation drive.

    python benchmarks/attack_ingredients.py BAG [--frames 10:150:20] [--eps-cm 1 5 10] [--only WORD ...]

Take a drive that no report is made of. Each line changes one thing of the recipe `best`; the random
lines spend the same reach with the same selection of the best try. Many frames take long: the drive's
clouds are attacked once for each line and reach.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import torch

from advpipe.pipeline.bag.cloud import xyzi
from advpipe.pipeline.bag.frames import Frame, FrameSlice, read_frames
from advpipe.pipeline.bag.locate import resolve_bag
from advpipe.pipeline.detector.protocol import Detector
from advpipe.pipeline.detector.registry import load_detector
from advpipe.pipeline.detector.threads import fixed_torch_threads
from advpipe.pipeline.geometry.boxes import CLASSES
from advpipe.pipeline.geometry.iou import iou_3d
from advpipe.pipeline.metrics.average_precision import LOOSE_IOU, STRICT_IOU, average_precision
from advpipe.pipeline.metrics.chamfer import chamfer_distance
from advpipe.pipeline.metrics.matching import FrameMatches, match_overlaps
from advpipe.pipeline.seeding import named_generator
from advpipe.stages.attack.lidar.base import LidarResult
from advpipe.stages.attack.lidar.perturb import RECIPES, Perturb
from advpipe.stages.attack.lidar.targets import find_targets

Attempt = Callable[[float], Perturb]


def best(steps: int = 0, **tactics: float) -> Attempt:
    """The recipe `best` with other tactics, by the reach in cm."""

    def made(eps_cm: float) -> Perturb:
        attack = Perturb(eps_cm=eps_cm, steps=steps)
        attack.tactics = replace(attack.tactics, **tactics)  # type: ignore[arg-type]
        return attack

    return made


def recipe(name: str, **parameters: float) -> Attempt:
    return lambda eps_cm: Perturb(eps_cm=eps_cm, recipe=name, **parameters)  # type: ignore[arg-type]


LINES: Mapping[str, Attempt] = {
    "best": best(),
    "random": recipe("random"),
    "random-best": recipe("random-best"),
    "paper": recipe("paper"),
    "random-near": recipe("random-near"),
    "robust": recipe("robust"),
    "no selection": best(keep=False),
    "no groups": best(groups=False),
    "no decoys": best(decoys=False),
    "no lie": best(lie=False),
    "neither": best(decoys=False, lie=False),
    "no momentum": best(momentum=0.0),
    "momentum .8": best(momentum=0.8),
    "crosses .2": best(eager=0.2, calm=0.2),
    "crosses .5": best(eager=0.5, calm=0.5),
    "crosses .9": best(eager=0.9, calm=0.9),
    "cycles of 6": best(rounds_a_cycle=6),
    "cycles of 4": best(rounds_a_cycle=4),
    "no cycles": best(rounds_a_cycle=1000),
    "in boxes": best(margin_m=0.0),
    "within 30 cm": best(margin_m=0.3),
    "within 3 m": best(margin_m=3.0),
    "2 cm past": best(landing_m=0.02),
    "twice the steps": best(steps=2 * RECIPES["best"]),
    "half the steps": best(steps=RECIPES["best"] // 2),
}


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n")[0])
    parser.add_argument("bag", type=Path)
    parser.add_argument("--frames", default="10:150:20", help="which clouds, as start:stop:step")
    parser.add_argument("--eps-cm", type=float, nargs="+", default=[1.0, 5.0, 10.0])
    parser.add_argument("--only", nargs="+", default=list(LINES), choices=list(LINES), metavar="LINE")
    parser.add_argument("--detector", default="small")
    parser.add_argument("--seed", type=int, default=0)
    given = parser.parse_args()
    detector = load_detector(given.detector)
    frames = list(read_frames(resolve_bag(given.bag), FrameSlice.parse(given.frames)))
    with fixed_torch_threads():
        clean = precisions([matches(frame, frame.cloud, detector) for frame in frames])
        print(f"{len(frames)} frames; clean AP strict/loose:", described(clean))
        print(f"{'':<18} eps cm   AP ratio in %, strict/loose: mean of classes, car    CD m²  s/frame")
        for word in given.only:
            for eps_cm in given.eps_cm:
                report(word, eps_cm, frames, detector, clean, given.seed)


def report(
    word: str,
    eps_cm: float,
    frames: Sequence[Frame],
    detector: Detector,
    clean: Mapping[str, float],
    seed: int,
) -> None:
    """Attack all frames and print one line."""
    attack = LINES[word](eps_cm)
    start_s = time.perf_counter()
    results: list[LidarResult] = []
    for frame in frames:
        rng = named_generator(seed, "ingredients", frame.index)
        results.append(attack(frame.cloud, frame.boxes, detector, rng))
    spent_s = (time.perf_counter() - start_s) / len(frames)
    found = [matches(f, r.cloud, detector) for f, r in zip(frames, results, strict=True)]
    attacked = precisions(found)
    distances = [
        chamfer_distance(finite_xyz(f.cloud), finite_xyz(r.cloud))
        for f, r in zip(frames, results, strict=True)
    ]
    ratio = {name: 100 * attacked[name] / clean[name] for name in clean if clean[name] > 0}
    print(
        f"{word:<18} {eps_cm:6g}   {described(ratio):<50} {np.mean(distances):.5f}  {spent_s:.1f}", flush=True
    )


def described(figures: Mapping[str, float]) -> str:
    """`mean/mean, car/car` of strict and loose figures."""
    words = {kind: [v for k, v in figures.items() if k.endswith(kind)] for kind in ("strict", "loose")}
    mean = "/".join(f"{np.mean(values):.4g}" for values in words.values() if values)
    car = "/".join(f"{figures[f'car {kind}']:.4g}" for kind in words if f"car {kind}" in figures)
    return f"{mean}, {car}"


def matches(frame: Frame, cloud: np.ndarray, detector: Detector) -> dict[str, FrameMatches]:  # type: ignore[type-arg]
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


def precisions(frames: Sequence[Mapping[str, FrameMatches]]) -> dict[str, float]:
    """Average precision of each class and overlap with at least 20 objects in these frames."""
    kinds = [k for k in frames[0] if sum(frame[k].n_truth for frame in frames) >= 20]
    return {kind: average_precision([frame[kind] for frame in frames]) for kind in kinds}


def finite_xyz(cloud: np.ndarray) -> np.ndarray:  # type: ignore[type-arg]
    points = xyzi(cloud)
    return points[np.isfinite(points).all(axis=1), :3]


if __name__ == "__main__":
    torch.manual_seed(0)
    main()
