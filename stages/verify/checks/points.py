"""Whether labels of points tell exactly what an attack did to each cloud, within its stated budget."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from advpipe.pipeline.bag.provenance_record import AttackRecord
from advpipe.pipeline.core.bounded_parquet import batches, rows
from advpipe.pipeline.core.errors import AdvpipeError
from advpipe.pipeline.messages.cloud import Cloud, xyz, xyzi
from advpipe.stages.verify.checks.attacked import FRAMES, POINT_LABELS, Attacked
from advpipe.stages.verify.checks.base import BagCheck
from advpipe.stages.verify.result import Fault, Gap, Result

ROUNDING_M = 1e-6
"""Labels are in single precision; budgets hold to the last bit of the cloud's own."""


MOST_LABELS = 1 << 22
"""Of one frame: twice the rays of the largest LiDAR that is simulated; real ones have a tenth."""


COLUMNS = ("topic", "frame", "point", "action", "displacement_m")


class Labels(NamedTuple):
    """Labels (K,) of one frame: see `stages/attack/lidar/base.py`."""

    topic: str
    frame: int
    point: npt.NDArray[np.int64]
    action: npt.NDArray[np.str_]
    displacement_m: npt.NDArray[np.float64]


class Points(BagCheck):
    """Clean and adversarial clouds side by side, with the rows of frames.parquet and labels.parquet."""

    def check(self) -> Iterator[Result]:
        if not self.bag.is_attack or self.bag.parent is None:
            return
        attacked = Attacked(self.bag, self.bag.parent)
        if not attacked.has_clouds:
            return
        topics, path = attacked.cloud_topics, attacked.table(POINT_LABELS)
        present = [name for name in topics if name in attacked.adversarial.topics]
        clean = attacked.kept(attacked.clean.raw_messages(topics))
        adversarial = attacked.adversarial.raw_messages(present)
        labels = frame_labels(batches(path, COLUMNS))
        row_of = rows(attacked.table(FRAMES))
        following = next(labels, None)
        place = self.bag.subject.place(path)
        frames = iter(attacked.frames[0] if attacked.frames is not None else range(0))
        for before in clean:
            row, after = next(row_of, None), next(adversarial, None)
            where = f"{self.bag.place} {before.topic.name}"
            if row is None or after is None:
                yield Fault(where, f"clouds or rows of {FRAMES} are missing from {before.log_time_ns} ns on")
                return
            if (after.topic.name, after.log_time_ns) != (before.topic.name, before.log_time_ns):
                yield Fault(where, f"the cloud at {before.log_time_ns} ns is missing")
                return
            if before.topic.name == topics[0] and row["frame"] != next(frames, None):
                yield Fault(where, f"{FRAMES} counts the cloud at {before.log_time_ns} ns as {row['frame']}")
            own = None
            if following is not None and (following.topic, following.frame) == (row["topic"], row["frame"]):
                own, following = following, next(labels, None)
            old, new = attacked.clean.cloud(before), attacked.adversarial.cloud(after)
            told = row["topic"], row["stamp_ns"], row["points_clean"], row["points_adversarial"]
            if told != (before.topic.name, old.stamp_ns, len(old.cloud), len(new.cloud)):
                yield Fault(where, f"frame {row['frame']}: {FRAMES} tells another cloud than there is")
            if own is None and before.cdr != after.cdr:
                yield Fault(where, f"frame {row['frame']} differs from the clean one and has no labels")
            elif own is not None and (old.stamp_ns, old.frame_id) != (new.stamp_ns, new.frame_id):
                yield Fault(where, f"frame {row['frame']} has another header than the clean one")
            elif own is not None:
                if ":" in row["attack"] and not _is_in_order(own, old.cloud, new.cloud):
                    yield Gap(where, f"{row['attack']} keeps no order of points: labels are only counted")
                    continue
                faults = [*differences(old.cloud, new.cloud, own)]
                faults += excesses(old.cloud, own, _budgets(attacked.attacks, row["attack"]))
                yield from (Fault(where, f"frame {row['frame']}: {fault}") for fault in faults)
        if following is not None or next(row_of, None) is not None:
            yield Fault(place, "tells of frames that the bag does not hold")
        if next(adversarial, None) is not None:
            yield Fault(self.bag.place, "holds clouds that the clean bag does not")


def frame_labels(tables: Iterator[Any]) -> Iterator[Labels]:
    """The labels of one frame after the other, put together where a batch ends within it."""
    held: list[Labels] = []
    count = 0
    for batch in tables:
        columns = [batch.column(name).to_numpy(zero_copy_only=False) for name in COLUMNS]
        topics, frames = columns[0], columns[1]
        ends = np.flatnonzero((topics[1:] != topics[:-1]) | (frames[1:] != frames[:-1])) + 1
        for start, end in zip([0, *ends.tolist()], [*ends.tolist(), len(frames)], strict=True):
            if start == end:
                continue
            part = Labels(str(topics[start]), int(frames[start]), *(one[start:end] for one in columns[2:]))
            if held and held[0][:2] != part[:2]:
                yield _joined(held)
                held, count = [], 0
            held.append(part)
            count += len(part.point)
            if count > MOST_LABELS:
                raise AdvpipeError(
                    f"{POINT_LABELS}: frame {part.frame} has more labels than any cloud points"
                )
    if held:
        yield _joined(held)


def _joined(parts: list[Labels]) -> Labels:
    point, action, displacement_m = (
        np.concatenate([getattr(part, name) for part in parts])
        for name in ("point", "action", "displacement_m")
    )
    with np.errstate(invalid="ignore"):  # a point without a number becomes one that no cloud has
        return Labels(*parts[0][:2], point.astype(np.int64), action, displacement_m.astype(np.float64))


def differences(clean: Cloud, adversarial: Cloud, labels: Labels) -> Iterator[str]:
    """Where labels and the real difference between two clouds are not the same.

    Points that were not removed keep their order; added ones come behind them.
    """
    removed, moved, added = (labels.action == word for word in ("removed", "moved", "added"))
    if not (removed | moved | added).all():
        yield "labels hold an action that is none"
        return
    touched = labels.point[removed | moved]
    if len(np.unique(touched)) != len(touched) or ((touched < 0) | (touched >= len(clean))).any():
        yield "labels name a point twice, or one that the clean cloud does not have"
        return
    kept = np.ones(len(clean), dtype=bool)
    kept[labels.point[removed]] = False
    survivors = clean[kept]
    if len(adversarial) != len(survivors) + int(added.sum()):
        yield "labels add and remove other numbers of points than the cloud shows"
        return
    old, new = survivors, adversarial[: len(survivors)]
    is_other = _bytes(old) != _bytes(new)
    told = np.zeros(len(clean), dtype=bool)
    told[labels.point[moved]] = True
    if (is_other.any(axis=1) != told[kept]).any():
        count = int((is_other.any(axis=1) != told[kept]).sum())
        yield f"{count} points are labelled as moved and were not, or were and are not labelled"
        return
    if (old["ring"] != new["ring"]).any() or (_bytes(old, "time") != _bytes(new, "time")).any():
        yield "points have another ring or time than in the clean cloud"
    real_m = np.full(len(clean), np.nan)
    real_m[kept] = np.linalg.norm(xyz(new).astype(np.float64) - xyz(old).astype(np.float64), axis=1)
    yield from _distances(real_m[labels.point[moved]], labels.displacement_m[moved], "moved")
    if added.any():
        real_m = _to_nearest(clean, adversarial[len(survivors) :])
        yield from _distances(real_m, labels.displacement_m[added], "added")
    if np.isfinite(labels.displacement_m[removed]).any():
        yield "labels give a removed point a displacement"


def _distances(real_m: npt.NDArray[np.float64], told_m: npt.NDArray[np.float64], word: str) -> Iterator[str]:
    is_off = ~(np.abs(real_m - told_m) <= ROUNDING_M + 1e-6 * np.abs(real_m))
    if is_off.any():
        first = int(np.flatnonzero(is_off)[0])
        yield f"{int(is_off.sum())} {word} points, by {real_m[first]:.6f} m where {told_m[first]:.6f} is told"


def _to_nearest(clean: Cloud, added: Cloud) -> npt.NDArray[np.float64]:
    from scipy.spatial import cKDTree

    scene = xyz(clean[np.isfinite(xyzi(clean)).all(axis=1)]).astype(np.float64)
    distance_m: npt.NDArray[np.float64] = cKDTree(scene).query(xyz(added).astype(np.float64))[0]
    return distance_m


def excesses(clean: Cloud, labels: Labels, budgets: list[dict[str, Any]]) -> list[str]:
    """What goes beyond the budget of every attack that could have made it; none where one suffices."""
    found = [_excess(clean, labels, budget) for budget in budgets]
    return [] if not found or "" in found else found[:1]


def _excess(clean: Cloud, labels: Labels, budget: dict[str, Any]) -> str:
    moved_m = labels.displacement_m[labels.action == "moved"]
    added_m = labels.displacement_m[labels.action == "added"]
    removed = int((labels.action == "removed").sum())
    if "eps_cm" in budget and len(moved_m) and moved_m.max() > budget["eps_cm"] / 100 + ROUNDING_M:
        return f"a point moved {moved_m.max():.6f} m, beyond eps_cm {budget['eps_cm']:g}"
    if "eps_m" in budget and len(added_m) and added_m.max() > budget["eps_m"] + ROUNDING_M:
        return f"a point was added {added_m.max():.6f} m away, beyond eps_m {budget['eps_m']:g}"
    if "points" in budget and len(added_m) not in (0, budget["points"]):
        return f"{len(added_m)} points were added, not {budget['points']}"
    if "ratio" in budget:
        finite = int(np.isfinite(xyzi(clean)).all(axis=1).sum())
        most = max(1, math.floor(budget["ratio"] * finite + 0.5))
        if removed > most:
            return f"{removed} points were removed, more than {most}, the ratio {budget['ratio']:g}"
    most = budget.get("max_points")
    if most and removed + len(moved_m) > most:
        return f"{removed + len(moved_m)} points were touched, more than max_points {most}"
    return ""


def _budgets(attacks: Sequence[AttackRecord], word: str) -> list[dict[str, Any]]:
    """The parameters of the attacks of this word; none for a user's own, whose names mean what they like."""
    return [one.parameters for one in attacks if one.type == word and ":" not in word]


def _is_in_order(labels: Labels, clean: Cloud, adversarial: Cloud) -> bool:
    return not any(True for _ in differences(clean, adversarial, labels))


def _bytes(cloud: Cloud, name: str | None = None) -> npt.NDArray[np.uint8]:
    """The points' bytes (N, 22), or those of one field: what is no number equals itself, too."""
    column = np.ascontiguousarray(cloud if name is None else cloud[name])
    return column.view(np.uint8).reshape(len(column), -1)
