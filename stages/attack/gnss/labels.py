"""What was done to which fix, as Parquet beside the bag."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np

from advpipe.pipeline.geometry.transforms import Float64
from advpipe.pipeline.labels.columns import arrow_schema
from advpipe.pipeline.labels.fixes import FIX_COLUMNS, GEOGRAPHIC, OFFSETS
from advpipe.pipeline.localisation.gnss import squared_sigmas
from advpipe.pipeline.v2x.facilities.effect import fix_has_effect
from advpipe.stages.attack.gnss.victim import FixRecord, SpoofedVehicle

Row = dict[str, object]


def write_labels(vehicles: Sequence[SpoofedVehicle], path: Path) -> None:
    """One row for each fix of each victim; see `labels.fixes.FIX_COLUMNS`."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    pq.write_table(pa.Table.from_pylist(list(_rows(vehicles)), arrow_schema(FIX_COLUMNS)), str(path))


def _rows(vehicles: Sequence[SpoofedVehicle]) -> Iterator[Row]:
    for vehicle in vehicles:
        for number, record in enumerate(vehicle.records):
            yield {"vehicle": vehicle.vehicle, "fix": number, **label(record)}


def label(record: FixRecord) -> Row:
    """One row, without vehicle and number."""
    offset_m = _offset_m(record)
    is_lost = record.true_geographic is not None and record.reported is None
    row: Row = {
        "stamp_ns": record.stamp_ns,
        "attack": None if record.false_fix is None else record.false_fix.attack,
        "squared_sigmas": None if offset_m is None else squared_sigmas(offset_m, record.covariance_m2),
        "mattered": is_lost or (offset_m is not None and fix_has_effect(*offset_m.tolist())),
    }
    for kind, place in (("true", record.true_geographic), ("false", record.reported)):
        values = [None] * 3 if place is None else place.tolist()
        row |= {f"{kind}_{name}": value for name, value in zip(GEOGRAPHIC, values, strict=True)}
    parts = [None] * 3 if offset_m is None else offset_m.tolist()
    return row | dict(zip(OFFSETS, parts, strict=True))


def _offset_m(record: FixRecord) -> Float64 | None:
    """False minus true, along the map's axes, which are east, north and up."""
    if record.false_fix is None or record.reported is None:
        return None if record.reported is None else np.zeros(3)
    assert record.false_fix.position_m is not None
    assert record.true_m is not None
    return record.false_fix.position_m - record.true_m
