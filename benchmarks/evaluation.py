"""Measures the time of scoring relative to detection: rotated overlaps, average precision, intervals.

    python benchmarks/evaluation.py [BAG] [--frames 20] [--scored 1000]

A detector looks at some frames of a drive, three seconds of `boulevard` without a BAG; then as many frames
as are to be scored, copies of those with other stamps, are matched and summarised with every interval that a
report holds. Exit code 1 where scoring takes more than a tenth of the time of detecting as many frames.
"""

from __future__ import annotations

import argparse
import tempfile
import time
from dataclasses import replace
from itertools import cycle, islice
from pathlib import Path

import numpy as np
from common import finish, machine

from advpipe.pipeline.bag.frames import FrameSlice, read_frames
from advpipe.pipeline.bag.locate import resolve_bag
from advpipe.pipeline.detector.protocol import Detections
from advpipe.pipeline.detector.registry import load_detector
from advpipe.pipeline.detector.threads import fixed_torch_threads
from advpipe.pipeline.scenario import load_scenario
from advpipe.stages.evaluate.detection.comparison import CloudResult, Comparison, FrameResult
from advpipe.stages.evaluate.detection.detection_run import DetectionRun
from advpipe.stages.evaluate.detection.scoring import known_classes, match
from advpipe.stages.evaluate.detection.summary import summarise
from advpipe.stages.evaluate.options import Options
from advpipe.stages.simulate.run import simulate

MARK = 0.1
PERIOD_NS = 100_000_000
DRAWS = 1000


def shaken(found: Detections, rng: np.random.Generator) -> Detections:
    """The detections a little displaced and scored anew, so that no frame is the copy of another one."""
    boxes = found.boxes + rng.normal(0, 0.02, found.boxes.shape)
    scores = np.sort(np.clip(found.scores + rng.normal(0, 0.02, len(found)), 0, 1))[::-1]
    return replace(found, boxes=boxes, scores=scores)


def time_to_detect_s(bag: Path, name: str, frames: int) -> float:
    """Seconds a frame, without reading the bag; the median."""
    detector, times_s = load_detector(name), []
    with fixed_torch_threads():
        for frame in read_frames(bag, FrameSlice(0, frames + 1)):
            start_s = time.perf_counter()
            detector.detect(frame.cloud)
            times_s.append(time.perf_counter() - start_s)
    return float(np.median(times_s[1:]))  # the first one warms up


def time_to_score_s(
    looked: list[FrameResult], scored: int, classes: tuple[str, ...]
) -> tuple[float, float, int]:
    """Seconds to match the frames, seconds to summarise them, and the detections in them."""
    rng = np.random.default_rng(0)
    found = [shaken(frame.clean.detections, rng) for frame in islice(cycle(looked), scored)]
    frames, start_s = [], time.perf_counter()
    for number, (frame, detections) in enumerate(zip(cycle(looked), found, strict=False)):
        result: CloudResult = replace(
            frame.clean, detections=detections, matches=match(frame.truth, detections, classes)
        )
        frames.append(replace(frame, index=number, stamp_ns=number * PERIOD_NS, clean=result))
    matched_s = time.perf_counter()
    summary = summarise(Comparison(None, {}, tuple(frames), classes=classes), DRAWS, seed=0)
    end_s = time.perf_counter()
    print(
        f"{summary.result.counts.blocks} blocks, {DRAWS} draws, "
        f"mAP {summary.result.clean.means['strict'].map_r40:.3f}"
    )
    return matched_s - start_s, end_s - matched_s, sum(map(len, found))


def main() -> None:
    parser = argparse.ArgumentParser(description="Scoring beside detecting.")
    parser.add_argument("bag", nargs="?", type=Path)
    parser.add_argument("--frames", type=int, default=20)
    parser.add_argument("--scored", type=int, default=1000)
    parser.add_argument("--detector", default="small")
    options = parser.parse_args()
    print(machine())
    with tempfile.TemporaryDirectory() as folder:
        bag = options.bag
        if bag is None:
            bag = Path(folder) / "drive"
            simulate(load_scenario("boulevard", ["simulation.duration_s=3"]), bag)
        bag = resolve_bag(bag)
        detect_s = time_to_detect_s(bag, options.detector, options.frames)
        run = DetectionRun(options.detector, bag, options=Options(frames=FrameSlice(0, options.frames)))
        (comparison,) = run.comparisons(workers=1)
    classes = known_classes(load_detector(options.detector))
    match_s, summarise_s, detections = time_to_score_s(list(comparison.frames), options.scored, classes)
    ratio = (match_s + summarise_s) / (options.scored * detect_s)
    print(f"detecting with {options.detector}: {1000 * detect_s:.0f} ms a frame")
    print(
        f"scoring {options.scored} frames with {detections:,} detections: overlaps and matching "
        f"{match_s:.1f} s, average precision and intervals {summarise_s:.1f} s"
    )
    verdict = "ok" if ratio <= MARK else "ABOVE"
    print(f"scoring / detecting  {100 * ratio:.1f} %  mark {100 * MARK:.0f} %  {verdict}")
    finish(ratio <= MARK)


if __name__ == "__main__":
    main()
