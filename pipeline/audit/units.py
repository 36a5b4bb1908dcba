"""The units of one bag: what each probe says of them, and which of them an attack touched."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from advpipe.pipeline.audit.probe import Float64, Probe, Unit

Int64 = npt.NDArray[np.int64]
Bool = npt.NDArray[np.bool_]


@dataclass(frozen=True)
class Units:
    """N units of one kind. cluster: (N,) units of one number are not independent: those of one second of a
    drive, messages of one station. values: by probe, (N,)."""

    unit: Unit
    cluster: Int64
    is_attacked: Bool
    values: Mapping[str, Float64]

    def __len__(self) -> int:
        return len(self.cluster)

    def __getitem__(self, chosen: Bool) -> Units:
        values = {name: column[chosen] for name, column in self.values.items()}
        return Units(self.unit, self.cluster[chosen], self.is_attacked[chosen], values)


def measured(
    unit: Unit, probes: Sequence[Probe[Any]], view: object, cluster: Int64, is_attacked: Bool
) -> Units:
    """The units of a view with what the probes of that unit say of them."""
    with np.errstate(all="ignore"):
        values = {
            probe.name: np.asarray(probe.measure(view), np.float64) for probe in probes if probe.unit == unit
        }
    return Units(unit, cluster, is_attacked, values)


def joined_units(parts: Sequence[Units]) -> Units:
    """All units of parts of one kind, in order; there is one part at least."""
    values = {name: np.concatenate([part.values[name] for part in parts]) for name in parts[0].values}
    return Units(
        parts[0].unit,
        np.concatenate([part.cluster for part in parts]),
        np.concatenate([part.is_attacked for part in parts]),
        values,
    )
