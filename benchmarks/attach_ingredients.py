"""What each ingredient of `detach` and `attach` brings: AP ratios and Chamfer distances.

    python benchmarks/attach_ingredients.py BAG detach|attach [--frames 10:150:20] [--budgets 0.3 1]

Take a validation drive, one that no report is made of. Each line changes one thing of the recipe `best`; the
random lines spend the same budget. Budgets are per cent of the points for detach, eps in metres for attach.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Mapping, Sequence
from pathlib import Path
from types import ModuleType
from typing import Any
from unittest.mock import patch

import numpy as np
from attack_ingredients import described, finite_xyz, matches, precisions

from advpipe.pipeline.bag.frames import Frame, FrameSlice, read_frames
from advpipe.pipeline.bag.locate import resolve_bag
from advpipe.pipeline.detector.protocol import Detector
from advpipe.pipeline.detector.registry import load_detector
from advpipe.pipeline.detector.threads import fixed_torch_threads
from advpipe.pipeline.metrics.chamfer import chamfer_distance
from advpipe.pipeline.seeding import named_generator
from advpipe.stages.attack.lidar import attach, attach_game, climb, detach, detach_game, harm
from advpipe.stages.attack.lidar.attach import Attach
from advpipe.stages.attack.lidar.detach import Detach

Line = tuple[dict[str, Any], tuple[ModuleType, str, float] | None]
"""Parameters of the attack, and a constant of ours that is another one in this line."""

RECIPES: Mapping[str, Line] = {
    name: ({"recipe": name}, None)
    for name in ("best", "robust", "paper", "random", "random-near", "random-best")
}
COMMON: Mapping[str, Line] = {
    **RECIPES,
    "5 rounds": ({"rounds": 5}, None),
    "20 rounds": ({"rounds": 20}, None),
    "even rounds": ({}, (climb, "CURVE", 1.0)),
    "scores do not count": ({}, (harm, "FAINT", 0.0)),
    "no second look": ({}, (climb, "REPAIRS", 1)),
}
LINES: Mapping[str, Mapping[str, Line]] = {
    "detach": {
        **COMMON,
        "in boxes": ({}, (detach, "MARGIN_M", 0.0)),
        "within 1 m": ({}, (detach, "MARGIN_M", 1.0)),
        "half an object": ({}, (detach_game, "MOST", 0.5)),
    },
    "attach": {
        **COMMON,
        "in boxes": ({}, (attach, "MARGIN_M", 0.0)),
        "within 1 m": ({}, (attach, "MARGIN_M", 1.0)),
        "30 an object": ({}, (attach_game, "MOST", 30)),
        "120 an object": ({}, (attach_game, "MOST", 120)),
        "200 fresh places": ({}, (attach_game, "FRESH", 200)),
        "2000 fresh places": ({}, (attach_game, "FRESH", 2000)),
        "no decay": ({"decay_m": 100.0}, None),
        "decay .3 m": ({"decay_m": 0.3}, None),
        "along rays": ({"along_ray": True}, None),
        "order kept": ({"keep_occlusion_order": True}, None),
    },
}


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n")[0])
    parser.add_argument("bag", type=Path)
    parser.add_argument("attack", choices=list(LINES))
    parser.add_argument("--frames", default="10:150:20", help="which clouds, as start:stop:step")
    parser.add_argument("--budgets", type=float, nargs="+", default=[0.3, 1.0])
    parser.add_argument("--only", nargs="+", metavar="LINE")
    parser.add_argument("--detector", default="small")
    parser.add_argument("--seed", type=int, default=0)
    given = parser.parse_args()
    lines = LINES[given.attack]
    words = given.only or list(lines)
    if unknown := [word for word in words if word not in lines]:
        parser.error(f"unknown line {unknown[0]!r}; known: {', '.join(lines)}")
    detector = load_detector(given.detector)
    frames = list(read_frames(resolve_bag(given.bag), FrameSlice.parse(given.frames)))
    with fixed_torch_threads():
        clean = precisions([matches(frame, frame.cloud, detector) for frame in frames])
        print(f"{len(frames)} frames; clean AP strict/loose:", described(clean))
        print(f"{'':<20} budget   AP ratio in %, strict/loose: mean of classes, car    CD m²  s/frame")
        for word in words:
            for budget in given.budgets:
                report(given.attack, word, budget, frames, detector, clean, given.seed)


def report(
    name: str,
    word: str,
    budget: float,
    frames: Sequence[Frame],
    detector: Detector,
    clean: Mapping[str, float],
    seed: int,
) -> None:
    """Attack all frames and print one line."""
    parameters, constant = LINES[name][word]
    attack: Detach | Attach
    attack = (
        Attach(eps_m=budget, **parameters) if name == "attach" else Detach(ratio=budget / 100, **parameters)
    )
    start_s = time.perf_counter()
    with patch.object(*constant) if constant else patch.object(climb, "CURVE", climb.CURVE):
        results = [
            attack(f.cloud, f.boxes, detector, named_generator(seed, "ingredients", f.index)) for f in frames
        ]
    spent_s = (time.perf_counter() - start_s) / len(frames)
    attacked = precisions([matches(f, r.cloud, detector) for f, r in zip(frames, results, strict=True)])
    distances = [
        chamfer_distance(finite_xyz(f.cloud), finite_xyz(r.cloud))
        for f, r in zip(frames, results, strict=True)
    ]
    ratio = {kind: 100 * attacked[kind] / clean[kind] for kind in clean if clean[kind] > 0}
    print(
        f"{word:<20} {budget:6g}   {described(ratio):<50} {np.mean(distances):.5f}  {spent_s:.1f}", flush=True
    )


if __name__ == "__main__":
    main()
