"""Measures the time of attacks on clouds relative to the detector's passes, and frames per hour by preset.

    python benchmarks/attack.py [BAG] [--parts cost recipes] [--presets small 360 kitti]
                                [--attacks perturb detach attach] [--rounds 5] [--steps 40] [--recipes ...]
    python benchmarks/attack.py [BAG] --frames 30 [--attacks perturb detach attach]
    python benchmarks/attack.py [BAG] --device cuda [--batches 1 4 8 16]

The part `cost`: processor and wall seconds of one cloud of each attack at the budget of the paper's Table I,
as a ratio to the bare passes that it replaces (`attack_cost.py`). The mark: at most 0.4, `kitti` without one.
The shipped detector is attacked; the presets with random weights are shown the same clouds.

With `--frames N`, instead: the mAP ratio of each attack on N clouds, strict and loose, with the shipped
detector; and the same when the detector is shown and computes all of each cloud. The mark: at most one
percentage point apart.

The part `recipes`: the peer of `perturb --recipe paper` is as many bare passes of the same detector on the
same cloud: its loss, forward, and the gradient to the points, backward. The mark: at most 1.15 times as long.
All other recipes are timed once each, against nothing. One thread computes, as in advpipe; random weights
take as long as trained ones.

On a GPU, instead: frames a second of each attack at its usual budget with the shipped detector, so many
frames at once. BAG is a recorded drive; by default two seconds of the boulevard are simulated.
"""

from __future__ import annotations

import argparse
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
import torch
from attack_cost import report_cost, report_effect
from common import compare, finish, machine

from advpipe.pipeline.adversary.targets import find_targets
from advpipe.pipeline.bag.frames import Frame, FrameSlice, count_frames, find_lidar_topic, read_frames
from advpipe.pipeline.bag.locate import resolve_bag
from advpipe.pipeline.bag.reader import BagReader
from advpipe.pipeline.detector.batching import run_batched
from advpipe.pipeline.detector.device import CPU
from advpipe.pipeline.detector.protocol import BatchDetector, ObjectDetector
from advpipe.pipeline.detector.registry import load_detector
from advpipe.pipeline.detector.second.model import Second, SecondNet
from advpipe.pipeline.detector.second.presets import PRESETS
from advpipe.pipeline.detector.threads import fixed_torch_threads
from advpipe.pipeline.messages.cloud import xyzi
from advpipe.pipeline.scenario import load_scenario
from advpipe.stages.attack.lidar.attach import Attach
from advpipe.stages.attack.lidar.base import LidarAttack, LidarResult
from advpipe.stages.attack.lidar.detach import Detach
from advpipe.stages.attack.lidar.perturb import RECIPES, Perturb

MOST = 1.15

ATTACKS: dict[str, LidarAttack] = {
    "perturb": Perturb(eps_cm=10),
    "detach": Detach(ratio=0.01),
    "attach": Attach(eps_m=0.5),
}


def report(preset: str, frame: Frame, given: argparse.Namespace) -> bool:
    """Print one preset's lines; whether PGD reaches its mark."""
    torch.manual_seed(0)
    detector = Second(SecondNet(PRESETS[preset]))
    targets = find_targets(detector, frame.cloud, frame.boxes)
    points = torch.from_numpy(xyzi(frame.cloud))

    def bare() -> None:
        for _ in range(given.steps):
            leaf = points.clone().requires_grad_()
            torch.autograd.grad(detector.loss(leaf, targets.boxes, targets.labels), leaf)

    def attacked(recipe: str, steps: int) -> None:
        attack = Perturb(eps_cm=5, recipe=recipe, steps=steps)
        attack(frame.cloud, frame.boxes, detector, np.random.default_rng(0))

    timed = compare(
        f"{preset}: PGD-{given.steps}", lambda: attacked("paper", given.steps), bare, given.rounds
    )
    print(timed.line(3600, "frames/h", 1 / MOST), flush=True)
    for recipe in given.recipes:
        start_s = time.perf_counter()
        attacked(recipe, 0)
        print(f"{preset}: {recipe:<26} {3600 / (time.perf_counter() - start_s):9,.1f} frames/h", flush=True)
    return timed.ratio >= 1 / MOST


def report_costs(frame: Frame, presets: list[str], names: list[str]) -> bool:
    """Print the costs of each attack on a cloud; whether all reach their mark."""
    shipped = load_detector("small")
    assert isinstance(shipped, Second)
    torch.manual_seed(0)
    others = {name: Second(SecondNet(PRESETS[name])) for name in presets if name != "small"}
    detectors = {"small": shipped, **others}
    passed = [report_cost(name, ATTACKS[name], frame, detectors) for name in names]
    return all(passed)


def report_batches(frames: list[Frame], device: str, batches: list[int]) -> None:
    """Print frames a second of each attack, by how many frames there are in a batch."""
    detector = load_detector("small", device)
    assert isinstance(detector, BatchDetector)

    def work(attack: LidarAttack, number: int) -> Callable[[ObjectDetector], LidarResult]:
        frame = frames[number % len(frames)]
        return lambda seen: attack(frame.cloud, frame.boxes, seen, np.random.default_rng(number))

    for name, attack in ATTACKS.items():
        run_batched(detector, [work(attack, 0)])  # warms up, and does not count
        for size in batches:
            count = max(batches)
            start_s = time.perf_counter()
            for first in range(0, count, size):
                run_batched(detector, [work(attack, n) for n in range(first, min(first + size, count))])
            rate_hz = count / (time.perf_counter() - start_s)
            print(f"{name}: {size:>3} at once {rate_hz:9.3f} frames/s", flush=True)


def spread(bag: Path, count: int) -> FrameSlice:
    """So many clouds of a bag, evenly; all of them where it has fewer."""
    reader = BagReader(bag)
    step = max(1, reader.topics[find_lidar_topic(reader)].count // max(1, count))
    return FrameSlice(step // 2, step // 2 + step * count, step)


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n")[0])
    parser.add_argument("bag", type=Path, nargs="?")
    parser.add_argument("--parts", nargs="+", default=["cost", "recipes"], choices=["cost", "recipes"])
    parser.add_argument("--frames", type=int, help="compare the effect on so many clouds, and nothing else")
    parser.add_argument("--attacks", nargs="+", default=list(ATTACKS), choices=list(ATTACKS))
    parser.add_argument("--rounds", type=int, default=5)
    parser.add_argument("--steps", type=int, default=40)
    parser.add_argument("--presets", nargs="+", default=list(PRESETS), choices=list(PRESETS))
    parser.add_argument("--recipes", nargs="*", default=list(RECIPES), choices=list(RECIPES))
    parser.add_argument("--device", default=CPU)
    parser.add_argument("--batches", type=int, nargs="+", help="default: 1 4 8 16, on a GPU alone")
    given = parser.parse_args()
    batches = given.batches or ([] if given.device == CPU else [1, 4, 8, 16])
    with tempfile.TemporaryDirectory() as folder, fixed_torch_threads():
        bag = given.bag
        if bag is None:
            from advpipe.stages.simulate.run import simulate  # a machine that only times a GPU has no SUMO

            bag = Path(folder) / "boulevard"
            simulate(load_scenario("boulevard", ["simulation.duration_s=2"]), bag)
        bag = resolve_bag(bag)
        if given.frames is not None:
            chosen = list(read_frames(bag, spread(bag, given.frames)))
            detector = load_detector("small")
            assert isinstance(detector, Second)
            print(f"{machine()}; PyTorch {torch.__version__}; {len(chosen)} clouds", flush=True)
            finish(report_effect({name: ATTACKS[name] for name in given.attacks}, chosen, detector))
        first = min(10, count_frames(bag) - 1)
        frames = list(read_frames(bag, FrameSlice(first, first + max([1, *batches]), 1)))
        frame = frames[0]
        print(f"{machine()}; PyTorch {torch.__version__}; {len(frame.cloud)} points")
        if batches:
            report_batches(frames, given.device, batches)
            return
        passed = []
        if "cost" in given.parts:
            passed.append(report_costs(frame, given.presets, given.attacks))
        if "recipes" in given.parts:
            passed += [report(preset, frame, given) for preset in given.presets]
    finish(all(passed))


if __name__ == "__main__":
    main()
