"""The quantities of changed clouds that attacks share."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

from advpipe.pipeline.labels.cloud_change import CloudChange
from advpipe.pipeline.labels.cloud_quantity import CloudQuantity
from advpipe.pipeline.labels.points import REMOVED
from advpipe.pipeline.labels.quantity import Quantity


def _share_removed(change: CloudChange) -> float:
    """Of a share and N points, the nearest whole number is removed, halves up, and one at least."""
    removed = change.count(REMOVED)
    return 0.0 if removed <= 1 else (removed - 0.5) / max(change.finite, 1)


MAX_DISPLACEMENT = CloudQuantity(
    name="max_displacement_m",
    unit="m",
    meaning="largest displacement of a point",
    column="displacement_m",
    aggregate="max",
)
MEAN_SQUARE_DISPLACEMENT = CloudQuantity(
    name="mean_square_displacement_m2",
    unit="m²",
    meaning="mean squared displacement of the moved points",
    column="displacement_m",
    aggregate="mean_square",
)
ADDED_DISTANCE = CloudQuantity(
    name="max_added_distance_m",
    unit="m",
    meaning="largest distance of an added point from the clean cloud",
    column="added_distance_m",
    aggregate="max",
)
MAX_INTENSITY_CHANGE = CloudQuantity(
    name="max_intensity_change",
    meaning="largest change of an intensity",
    column="intensity_change",
    aggregate="max",
)
MAX_OFF_RAY = CloudQuantity(
    name="max_off_ray_urad",
    unit="µrad",
    meaning="largest angle between the rays of a point before and after",
    column="off_ray_urad",
    aggregate="max",
)
POINTS_MOVED = CloudQuantity(name="points_moved", meaning="points moved", column="moved", aggregate="sum")
POINTS_ADDED = CloudQuantity(name="points_added", meaning="points added", column="added", aggregate="sum")
POINTS_REMOVED = CloudQuantity(
    name="points_removed", meaning="points removed", column="removed", aggregate="sum"
)
POINTS_TOUCHED = CloudQuantity(
    name="points_touched", meaning="points moved or removed", column="touched", aggregate="sum"
)
SHARE_REMOVED = Quantity[CloudChange](
    "share_removed", "1", "smallest share of the points that rounds to the number removed", _share_removed
)

CLOUD_QUANTITIES: Mapping[str, Quantity[CloudChange]] = {
    **{
        each.name: each.quantity
        for each in (
            *(MAX_DISPLACEMENT, MEAN_SQUARE_DISPLACEMENT, ADDED_DISTANCE, MAX_INTENSITY_CHANGE, MAX_OFF_RAY),
            *(POINTS_MOVED, POINTS_ADDED, POINTS_REMOVED, POINTS_TOUCHED),
        )
    },
    SHARE_REMOVED.name: SHARE_REMOVED,
}


def cloud_quantities(declared: Iterable[CloudQuantity]) -> dict[str, Quantity[CloudChange]]:
    """By name: the shared quantities, and the declared ones that this version can measure.

    A name of a shared quantity means that one, whatever is declared.
    """
    own = {each.name: each.quantity for each in declared if each.is_measurable}
    return {**own, **CLOUD_QUANTITIES}
