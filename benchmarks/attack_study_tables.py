"""The tables of `attack_study.py`: what rows of frames say, in Markdown."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import numpy.typing as npt

from advpipe.pipeline.attack_detection.temporal import temporal_scores
from advpipe.pipeline.attack_detection.threshold import area_under_roc
from advpipe.pipeline.core.seeding import named_generator
from advpipe.pipeline.detector.protocol import Detections
from advpipe.pipeline.metrics.average_precision import RankedMatches, mean_average_precision
from advpipe.pipeline.metrics.bootstrap import BlockBootstrap, percentile_interval
from advpipe.stages.evaluate.detection.attack_detection import cross_thresholds

Float64 = npt.NDArray[np.float64]
Row = Mapping[str, Any]

KINDS = ("strict", "loose")
ENOUGH_BOXES = 50
DRAWS = 1000
LEAST_BLOCKS = 6
"""With fewer blocks of 5 s there is no interval."""
FOUND_SCORE = 0.3
CLEAN, UNDEFENDED, RANDOM_BEST = "clean/clean", "none", "random-best"

DECIDED: tuple[tuple[str, str, str], ...] = (
    ("hide: less than best loosely?", "hide", "best"),
    ("hide against its own random-best", "hide", "random-best+hide"),
    ("without decoys", "best+no-decoys", "best"),
    ("without gradients to decoys", "best+no-decoy-gradients", "best"),
    ("lost objects get points back", "best", "best+no-line-search"),
    ("restarts by object", "best+patience", "best"),
    ("restarts by object, without decoys", "best+no-decoys+patience", "best+no-decoys"),
    ("twice the steps", "best+twice", "best"),
    ("twice the steps, without decoys", "best+no-decoys+twice", "best+no-decoys"),
    ("four times the steps", "best+four", "best+twice"),
    ("half the steps", "best+half", "best"),
    ("cropped and tiled, against exact", "best", "best+exact"),
    ("knows detections, not true boxes", "best+detections", "best"),
    ("points on their rays", "best+ray", "best"),
    ("order of occlusion kept", "best+order", "best"),
    ("stealthy", "stealthy", "random-best"),
    ("the paper's", "paper", "random-best"),
)


@dataclass(frozen=True)
class Study:
    """The rows of frames by condition, and when the frames were."""

    rows: Sequence[Row]
    stamps_ns: Sequence[int]

    @cached_property
    def by_key(self) -> dict[str, dict[int, Row]]:
        """By `budget/recipe+variants/seed`, then by the number of the frame."""
        found: dict[str, dict[int, Row]] = {}
        for row in self.rows:
            found.setdefault(row["condition"], {})[row["frame"]] = row
        return found

    @property
    def labels(self) -> list[str]:
        """Conditions without their seeds, in the order in which they came."""
        return list(dict.fromkeys(key.rpartition("/")[0] for key in self.by_key))

    def seeds(self, label: str) -> list[int]:
        return sorted(int(key.rpartition("/")[2]) for key in self.by_key if key.rpartition("/")[0] == label)

    def of(self, label: str, seed: int = 0) -> dict[int, Row]:
        return self.by_key.get(f"{label}/{seed}", {})

    @cached_property
    def classes(self) -> tuple[str, ...]:
        """Those with enough objects in the clean clouds; all with any, where none has."""
        count: dict[str, int] = {}
        for row in self.of(CLEAN).values():
            for name, coded in row["views"][UNDEFENDED].items():
                count[name] = count.get(name, 0) + coded[0]
        enough = tuple(name for name, number in count.items() if number >= ENOUGH_BOXES)
        return enough or tuple(name for name, number in count.items() if number)

    def ratio(
        self, label: str, kind: str, view: str = UNDEFENDED, seed: int = 0, frames: Sequence[int] = ()
    ) -> Float64:
        """The mAP in percent of that of the clean clouds without a defence: (1 + draws,), first of all frames
        and then of each draw of blocks; the draws are the same for the same frames."""
        chosen = list(frames) or sorted(self.of(label, seed))
        bootstrap = BlockBootstrap.of(
            [self.stamps_ns[each] for each in chosen], DRAWS, named_generator(0, "study", "bootstrap")
        )
        left = self._map(self.of(label, seed), chosen, kind, view, bootstrap)
        clean = self._map(self.of(CLEAN), chosen, kind, UNDEFENDED, bootstrap)
        with np.errstate(invalid="ignore", divide="ignore"):
            ratio: Float64 = 100 * left / clean
        return ratio

    def common(self, *conditions: tuple[str, int], view: str = UNDEFENDED) -> list[int]:
        """The frames that all of them and the clean clouds have, seen so."""
        held = [
            {number for number, row in self.of(*each).items() if view in row["views"]}
            for each in ((CLEAN, 0), *conditions)
        ]
        return sorted(set.intersection(*held))

    def _map(
        self, rows: Mapping[int, Row], frames: Sequence[int], kind: str, view: str, bootstrap: BlockBootstrap
    ) -> Float64:
        of_classes = []
        for name in self.classes:
            ranked = ranked_matches([rows[each]["views"][view][name] for each in frames], kind)
            draws = bootstrap.samples(lambda times: ranked.average_precisions(times, bootstrap.block))  # noqa: B023
            of_classes.append(np.concatenate([[ranked.average_precision()], draws]))
        return mean_average_precision(of_classes)

    def found(self, label: str, kind: str, frames: Sequence[int]) -> int:
        """How many objects are found with a score of at least `FOUND_SCORE`."""
        return sum(
            sign == "1" and score >= 1e5 * FOUND_SCORE
            for each in frames
            for coded in self.of(label)[each]["views"][UNDEFENDED].values()
            for score, sign in zip(coded[1], coded[2 + KINDS.index(kind)], strict=True)
        )


def ranked_matches(coded: Sequence[Any], kind: str) -> RankedMatches:
    """The matches of one class in frames, from what `attack_study_frame.matched` wrote."""
    signs = "".join(each[2 + KINDS.index(kind)] for each in coded)
    scores = np.array([score for each in coded for score in each[1]], np.float64) / 1e5
    frame = np.repeat(np.arange(len(coded)), [len(each[1]) for each in coded])
    kept = np.array([i for i, sign in enumerate(signs) if sign != "-"], np.int64)
    order = kept[np.argsort(-scores[kept], kind="stable")]
    hit = np.array([sign == "1" for sign in signs], bool)
    return RankedMatches(scores[order], hit[order], frame[order], np.array([each[0] for each in coded]))


def with_interval(values: Float64, sign: str = "", blocks: int = LEAST_BLOCKS) -> str:
    """The first value, and the 95 % interval of the others."""
    interval = percentile_interval(values[1:]) if blocks >= LEAST_BLOCKS else None
    text = f"{values[0]:{sign}.1f}"
    return text if interval is None else f"{text} ({interval[0]:{sign}.1f}…{interval[1]:{sign}.1f})"


def report(head: Mapping[str, Any], rows: Sequence[Row]) -> Iterator[str]:
    """All tables, in Markdown."""
    study = Study(rows, head["stamps_ns"])
    frames, detector = len(head["stamps_ns"]), head["detector_sha256"][:12]
    yield f"{head['machine']}; {head['drive']}, {frames} frames, detector {detector}"
    if not study.of(CLEAN):
        yield "no clean clouds yet"
        return
    yield f"mAP over {', '.join(study.classes)}; found: with a score of at least {FOUND_SCORE}"
    at_once = head["processes"] * head["batch"]
    for lines in (*(list(table(study)) for table in TABLES), list(_cost(study, at_once))):
        if len(lines) > 4:
            yield from ("", *lines)


def _blocks(study: Study, frames: Sequence[int]) -> int:
    stamps = [study.stamps_ns[each] for each in frames]
    return BlockBootstrap.of(stamps, 1, np.random.default_rng(0)).n_blocks


def _ratios(study: Study) -> Iterator[str]:
    yield "### What is left, in percent of the clean mAP"
    yield ""
    yield (
        "| condition | frames | strict | Δ to random-best | loose | Δ to random-best | found strictly, "
        "loosely | CD, m² | RMS, m | off ray, % | at a face, % | objective |"
    )
    yield "|---" * 12 + "|"
    for label in study.labels:
        frames = study.common((label, 0))
        if not frames:
            continue
        blocks, cells = _blocks(study, frames), [label, str(len(frames))]
        random = f"{label.partition('/')[0]}/{RANDOM_BEST}"
        both = study.common((label, 0), (random, 0)) if label not in (random, CLEAN) else []
        for kind in KINDS:
            cells.append(with_interval(study.ratio(label, kind, frames=frames), blocks=blocks))
            cells.append(_difference(study, label, random, kind, both))
        cells.append(", ".join(str(study.found(label, kind, frames)) for kind in KINDS))
        of_frames = [study.of(label)[each] for each in frames]
        cells += _changes(of_frames)
        cells.append(f"{np.mean([row['objective'] for row in of_frames]):+.3f}")
        yield f"| {' | '.join(cells)} |"


def _changes(rows: Sequence[Row]) -> list[str]:
    if "chamfer_m2" not in rows[0]:
        return [""] * 4
    moved = np.array([row["moved"] for row in rows])
    square = np.array([row["rms_m"] ** 2 for row in rows])
    rms = f"{np.sqrt((moved * square).sum() / moved.sum()):.4f}" if moved.sum() else ""
    off, grid = sum(row["off_ray"] for row in rows), sum(row["in_grid"] for row in rows)
    return [
        f"{np.mean([row['chamfer_m2'] for row in rows]):.2g}",
        rms,
        f"{100 * off / moved.sum():.0f}" if moved.sum() else "",
        f"{100 * sum(row['at_face'] for row in rows) / grid:.0f}" if grid else "",
    ]


def _difference(
    study: Study,
    label: str,
    other: str,
    kind: str,
    frames: Sequence[int],
    view: str = UNDEFENDED,
    seed: int = 0,
) -> str:
    """Of the ratios of two conditions on the same frames, in percentage points."""
    if not frames:
        return ""
    mine, theirs = (study.ratio(each, kind, view, seed, frames) for each in (label, other))
    return with_interval(mine - theirs, "+", _blocks(study, frames))


def _decided(study: Study) -> Iterator[str]:
    yield "### Differences that decide, in points of the mAP ratio"
    yield ""
    yield "| question | budget | frames | strict | loose |"
    yield "|---" * 5 + "|"
    budgets = dict.fromkeys(label.partition("/")[0] for label in study.labels if label != CLEAN)
    for question, recipe, other in DECIDED:
        for budget in budgets:
            pair = f"{budget}/{recipe}", f"{budget}/{other}"
            frames = study.common(*((each, 0) for each in pair))
            if frames:
                cells = [_difference(study, *pair, kind, frames) for kind in KINDS]
                yield f"| {question}: {recipe} − {other} | {budget} | {len(frames)} | {' | '.join(cells)} |"


def _defences(study: Study) -> Iterator[str]:
    yield "### Under defences: what is left strictly, and the difference to random-best in points"
    yield ""
    views = list(next(iter(study.of(CLEAN).values()))["views"])
    yield f"| condition | frames | {' | '.join(views)} |"
    yield "|---" * (len(views) + 2) + "|"
    for label in study.labels:
        frames = study.common((label, 0), view=views[-1])
        if not frames:
            continue
        random, cells = f"{label.partition('/')[0]}/{RANDOM_BEST}", []
        for view in views:
            text = f"{study.ratio(label, 'strict', view, frames=frames)[0]:.1f}"
            both = study.common((label, 0), (random, 0), view=view)
            if label not in (random, CLEAN) and both:
                text += f" [{_difference(study, label, random, 'strict', both, view)}]"
            cells.append(text)
        yield f"| {label} | {len(frames)} | {' | '.join(cells)} |"


def _detection(study: Study) -> Iterator[str]:
    yield "### Attack detection: clouds detected and false alarms, in percent, and AUC"
    yield ""
    clean = _checked(study, CLEAN)
    names = list(next(iter(clean.values()))) if clean else []
    yield f"| condition | frames | {' | '.join(names)} |"
    yield "|---" * (len(names) + 2) + "|"
    for label in study.labels:
        judged = _checked(study, label)
        cells = []
        for name in names:
            frames = [each for each in sorted(clean.keys() & judged.keys()) if name in judged[each]]
            frames = [each for each in frames if np.isfinite(clean[each][name] + judged[each][name])]
            quiet, loud = (np.array([of[each][name] for each in frames]) for of in (clean, judged))
            limits, _ = cross_thresholds(quiet)
            text = f"{100 * (loud > limits).mean():.0f}" if frames else ""
            cells.append(text if label == CLEAN or not text else f"{text}, {area_under_roc(quiet, loud):.2f}")
        if judged:
            yield f"| {label} | {len(judged)} | {' | '.join(cells)} |"


def _checked(study: Study, label: str) -> dict[int, dict[str, float]]:
    """The scores of the checks by frame, the temporal one among them where the frames are consecutive."""
    rows = {number: row for number, row in sorted(study.of(label).items()) if "checks" in row}
    scores = {number: dict(row["checks"]) for number, row in rows.items()}
    temporal = temporal_scores(
        [study.stamps_ns[number] for number in rows],
        [_detections(row["found"]) for row in rows.values()],
        FOUND_SCORE,
    )
    if np.isfinite(temporal).any():
        for of_frame, score in zip(scores.values(), temporal.tolist(), strict=True):
            of_frame["temporal"] = score
    return scores


def _detections(found: Sequence[Sequence[float]]) -> Detections:
    """The places, scores and labels that `attack_study_frame` wrote."""
    columns = np.array(found, np.float64).reshape(-1, 5)
    boxes = np.concatenate([columns[:, :3], np.zeros((len(columns), 4))], axis=1)
    return Detections(boxes, columns[:, 3], columns[:, 4].astype(np.int64))


def _seeds(study: Study) -> Iterator[str]:
    yield "### Spread over seeds"
    yield ""
    yield "| condition | frames | strict, by seed | loose, by seed |"
    yield "|---" * 4 + "|"
    for label in study.labels:
        seeds = study.seeds(label)
        frames = study.common(*((label, seed) for seed in seeds)) if len(seeds) > 1 else []
        if frames:
            cells = [
                ", ".join(f"{study.ratio(label, kind, seed=seed, frames=frames)[0]:.1f}" for seed in seeds)
                for kind in KINDS
            ]
            yield f"| {label} | {len(frames)} | {' | '.join(cells)} |"


TABLES = (_ratios, _decided, _defences, _detection, _seeds)


def _cost(study: Study, at_once: int) -> Iterator[str]:
    yield f"### Time: {at_once} frames at once"
    yield ""
    yield "| condition | frames | s of an attack, in its batch | attacks a second | CPU-s with all measures |"
    yield "|---" * 5 + "|"
    for key, rows in study.by_key.items():
        cpu_s, attack_s = (
            float(np.mean([row[name] for row in rows.values()])) for name in ("cpu_s", "attack_s")
        )
        if attack_s:
            yield f"| {key} | {len(rows)} | {attack_s:.1f} | {at_once / attack_s:.2f} | {cpu_s:.1f} |"
