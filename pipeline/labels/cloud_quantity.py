"""A quantity of a changed cloud as data: an attack declares it, the bag carries it, `verify` measures it."""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np

from advpipe.pipeline.core.document import Document, ShortText
from advpipe.pipeline.labels.cloud_change import CloudChange, Float64
from advpipe.pipeline.labels.points import ADDED, MOVED, REMOVED
from advpipe.pipeline.labels.quantity import Quantity

COLUMNS: Mapping[str, Callable[[CloudChange], Float64]] = {
    "displacement_m": lambda change: change.displacement_m,
    "x_displacement_m": lambda change: np.abs(change.offset_m[:, 0]),
    "y_displacement_m": lambda change: np.abs(change.offset_m[:, 1]),
    "z_displacement_m": lambda change: np.abs(change.offset_m[:, 2]),
    "xy_displacement_m": lambda change: np.hypot(change.offset_m[:, 0], change.offset_m[:, 1]),
    "off_ray_urad": lambda change: change.off_ray_urad,
    "intensity_change": lambda change: change.intensity_change,
    "added_distance_m": lambda change: change.added_distance_m,
    "moved": lambda change: np.ones(change.count(MOVED)),
    "added": lambda change: np.ones(change.count(ADDED)),
    "removed": lambda change: np.ones(change.count(REMOVED)),
    "touched": lambda change: np.ones(change.count(MOVED) + change.count(REMOVED)),
}
"""What can be measured, one number a point. Of each moved point, without its sign: displacements (in space,
along an axis of the cloud's frame, in its x-y plane), `off_ray_urad` (the angle at the sensor, in
microradians, between where it was and where it is) and `intensity_change`. Of each added point:
`added_distance_m`, to the nearest point of the clean cloud. A 1 for each point: `moved`, `added`, `removed`,
`touched` (moved or removed)."""

AGGREGATES: Mapping[str, Callable[[Float64, int], float]] = {
    "max": lambda values, points: float(values.max(initial=0.0)),
    "mean": lambda values, points: float(values.mean()) if len(values) else 0.0,
    "mean_square": lambda values, points: float(np.square(values).mean()) if len(values) else 0.0,
    "sum": lambda values, points: float(values.sum()),
    "share": lambda values, points: float(values.sum()) / max(points, 1),
}
"""What becomes of the numbers (K,), 0 of none; share: their sum over the number of finite points of the clean
cloud."""


class CloudQuantity(Document):
    """A number that can be measured of a changed cloud: the aggregate of a column.

    name: in `bounds`. unit: "1" for counts and shares. meaning: a noun phrase for messages. column: one of
    `COLUMNS`. aggregate: one of `AGGREGATES`.
    """

    name: ShortText
    unit: ShortText = "1"
    meaning: ShortText
    column: ShortText
    aggregate: ShortText

    @property
    def is_measurable(self) -> bool:
        """Whether this version knows the column and the aggregate: a bag may be of a newer one."""
        return self.column in COLUMNS and self.aggregate in AGGREGATES

    def measured(self, change: CloudChange) -> float:
        """Of a change; raises KeyError where it is not measurable."""
        return AGGREGATES[self.aggregate](COLUMNS[self.column](change), change.finite)

    @property
    def quantity(self) -> Quantity[CloudChange]:
        """The quantity as `verify` and the attack job measure it."""
        return Quantity(self.name, self.unit, self.meaning, self.measured)
