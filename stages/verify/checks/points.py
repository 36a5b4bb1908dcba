"""Whether point labels state exactly how an attack changed each cloud, within its declared bounds."""

from __future__ import annotations

from collections.abc import Generator, Iterator
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from advpipe.pipeline.core.bounded_parquet import rows
from advpipe.pipeline.labels.cloud_change import CloudChange
from advpipe.pipeline.labels.clouds import FRAMES, POINTS, read_point_labels
from advpipe.pipeline.labels.points import ACTIONS, ADDED, MOVED, REMOVED
from advpipe.pipeline.labels.quantities import cloud_quantities
from advpipe.pipeline.labels.quantity import Quantity, Range, beyond_all
from advpipe.pipeline.messages.cloud import Cloud
from advpipe.stages.verify.checks.attacked import AttackedBag
from advpipe.stages.verify.checks.base import BagCheck
from advpipe.stages.verify.declared_bounds import measurable, unmeasurable
from advpipe.stages.verify.result import NOT_DECLARED, Fault, Result, Unchecked

ROUNDING_M = 1e-6
"""Tolerance of labels, which have single precision; budgets are checked on the clouds themselves."""


class _DeclaredBounds(NamedTuple):
    """The bounds of each attack of one name, and the quantities that they bound."""

    bounds: list[dict[str, Range]]
    quantities: dict[str, Quantity[CloudChange]]


class Points(BagCheck):
    """Compares clean and adversarial clouds with the rows of frames.parquet and labels.parquet."""

    def check(self) -> Iterator[Result]:
        if not self.bag.is_attack or self.bag.parent is None:
            return
        attacked = AttackedBag(self.bag, self.bag.parent)
        if not attacked.has_clouds:
            return
        topics, path = attacked.cloud_topics, attacked.table(POINTS)
        present = [name for name in topics if name in attacked.adversarial.topics]
        clean = attacked.kept(attacked.clean.raw_messages(topics))
        adversarial = attacked.adversarial.raw_messages(present)
        labels = read_point_labels(path)
        row_of = rows(attacked.table(FRAMES))
        following = next(labels, None)
        place = self.bag.subject.place(path)
        declared = yield from self._declared(attacked)
        frames = iter(attacked.frames[0] if attacked.frames is not None else range(0))
        for before in clean:
            row, after = next(row_of, None), next(adversarial, None)
            where = f"{self.bag.place} {before.topic.name}"
            if row is None or after is None:
                yield Fault(
                    where, f"clouds, or rows of {FRAMES}, are missing from {before.log_time_ns} ns on"
                )
                return
            if (after.topic.name, after.log_time_ns) != (before.topic.name, before.log_time_ns):
                yield Fault(where, f"the cloud at {before.log_time_ns} ns is missing")
                return
            if before.topic.name == topics[0] and row["frame"] != next(frames, None):
                yield Fault(where, f"{FRAMES} counts the cloud at {before.log_time_ns} ns as {row['frame']}")
            label = None
            if following is not None and (following.topic, following.frame) == (row["topic"], row["frame"]):
                label, following = following, next(labels, None)
            old, new = attacked.clean.cloud(before), attacked.adversarial.cloud(after)
            stated = row["topic"], row["stamp_ns"], row["points_clean"], row["points_adversarial"]
            if stated != (before.topic.name, old.stamp_ns, len(old.cloud), len(new.cloud)):
                yield Fault(where, f"frame {row['frame']}: {FRAMES} does not describe the cloud in the bag")
            if label is None and before.cdr != after.cdr:
                yield Fault(where, f"frame {row['frame']} differs from the clean one but has no labels")
            elif label is not None and (old.stamp_ns, old.frame_id) != (new.stamp_ns, new.frame_id):
                yield Fault(where, f"frame {row['frame']} has a header that differs from the clean one's")
            elif label is not None:
                change = CloudChange(old.cloud, new.cloud, label.labels)
                faults = [*label_differences(change)]
                if not faults and (kept := declared.get(row["attack"])):
                    faults = [beyond_all(change, kept.bounds, kept.quantities)]
                yield from (Fault(where, f"frame {row['frame']}: {fault}") for fault in faults if fault)
        if following is not None or next(row_of, None) is not None:
            yield Fault(place, "labels frames that the bag does not hold")
        if next(adversarial, None) is not None:
            yield Fault(self.bag.place, "holds clouds that the clean bag does not")

    def _declared(self, attacked: AttackedBag) -> Generator[Result, None, dict[str, _DeclaredBounds]]:
        """Yield bounds that cannot be checked; return the others of the attacks on clouds, by attack."""
        found: dict[str, _DeclaredBounds] = {}
        for attack in attacked.attacks:
            if attack.family != "lidar":
                continue
            if attack.declared is None:
                yield Unchecked(self.bag.place, f"bounds of {attack.type} {NOT_DECLARED}")
                continue
            bounds, quantities = attack.declared.bounds, cloud_quantities(attack.declared.quantities)
            yield from unmeasurable(self.bag.place, attack.type, bounds, quantities)
            if not bounds:
                yield Unchecked(self.bag.place, f"{attack.type} declares no bounds")
            known = found.setdefault(attack.type, _DeclaredBounds([], {}))
            known.bounds.append(measurable(bounds, quantities))
            known.quantities.update(quantities)
        return found


def label_differences(change: CloudChange) -> Iterator[str]:
    """Differences between the labels and the actual change between two clouds.

    Points that were not removed keep their order.
    """
    clean, adversarial, labels = change.clean, change.adversarial, change.labels
    removed, moved, added = (labels.action == action for action in ACTIONS)
    if not (removed | moved | added).all():
        yield "labels hold an unknown action"
        return
    touched = labels.point[removed | moved]
    if len(np.unique(touched)) != len(touched) or ((touched < 0) | (touched >= len(clean))).any():
        yield "labels list a point twice, or one that the clean cloud does not have"
        return
    kept = np.ones(len(clean), dtype=bool)
    kept[labels.point[removed]] = False
    survivors = clean[kept]
    if len(adversarial) != len(survivors) + int(added.sum()):
        yield "labels add or remove a different number of points than the cloud shows"
        return
    places = labels.places(len(clean))[added]
    if len(np.unique(places)) != len(places) or ((places < 0) | (places >= len(adversarial))).any():
        yield "labels state an added point twice, or one that the adversarial cloud does not have"
        return
    old, new = change.survivors
    if (labels.places(len(clean))[moved] != _places_of_kept(change)[labels.point[moved]]).any():
        yield "labels state another place of a moved point than the cloud shows"
        return
    is_other = _bytes(old) != _bytes(new)
    is_labelled = np.zeros(len(clean), dtype=bool)
    is_labelled[labels.point[moved]] = True
    if (is_other.any(axis=1) != is_labelled[kept]).any():
        count = int((is_other.any(axis=1) != is_labelled[kept]).sum())
        yield f"{count} points are labelled moved but were not moved, or were moved without a label"
        return
    if (old["ring"] != new["ring"]).any() or (_bytes(old, "time") != _bytes(new, "time")).any():
        yield "points have a ring or time that differs from the clean cloud's"
    yield from _distances(change.displacement_m, labels.displacement_m[moved], MOVED)
    yield from _distances(change.added_distance_m, labels.displacement_m[added], ADDED)
    if np.isfinite(labels.displacement_m[removed]).any():
        yield "labels state a displacement for a removed point"


def _places_of_kept(change: CloudChange) -> npt.NDArray[np.int64]:
    """The index (N,) of each point of the clean cloud in the adversarial one, if it was not removed."""
    labels = change.labels
    kept, ours = np.ones(len(change.clean), bool), np.ones(len(change.adversarial), bool)
    kept[labels.point[labels.action == REMOVED]] = False
    ours[labels.places(len(change.clean))[labels.action == ADDED]] = False
    places = np.full(len(change.clean), -1, np.int64)
    places[kept] = np.flatnonzero(ours)
    return places


def _distances(
    real_m: npt.NDArray[np.float64], stated_m: npt.NDArray[np.float64], action: str
) -> Iterator[str]:
    is_wrong = ~(np.abs(real_m - stated_m) <= ROUNDING_M + 1e-6 * np.abs(real_m))
    if is_wrong.any():
        first = int(np.flatnonzero(is_wrong)[0])
        yield (
            f"{int(is_wrong.sum())} {action} points with a wrong displacement, such as "
            f"{stated_m[first]:.6f} m for {real_m[first]:.6f} m"
        )


def _bytes(cloud: Cloud, name: str | None = None) -> npt.NDArray[np.uint8]:
    """The points' bytes (N, 22), or those of one field, so that NaN equals itself."""
    column = np.ascontiguousarray(cloud if name is None else cloud[name])
    return column.view(np.uint8).reshape(len(column), -1)
