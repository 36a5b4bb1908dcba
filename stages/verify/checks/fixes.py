"""Whether labels of GNSS fixes tell exactly where the receiver was, and where it is made to believe it is."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any

from advpipe.pipeline.bag import messages
from advpipe.pipeline.bag.reader import BagReader
from advpipe.pipeline.bag.topics import VehicleTopics
from advpipe.stages.verify.checks.attacked import FIX_LABELS, Attacked
from advpipe.stages.verify.checks.base import BagCheck
from advpipe.stages.verify.result import Fault, Result
from advpipe.stages.verify.tables import rows

_PLACE = ("latitude_deg", "longitude_deg", "altitude_m")


class Fixes(BagCheck):
    """Fix by fix, in both bags. Those after a vehicle's last estimate have no label and must be as before."""

    def check(self) -> Iterator[Result]:
        if not self.bag.is_attack or self.bag.parent is None:
            return
        attacked = Attacked(self.bag, self.bag.parent)
        path = attacked.table(FIX_LABELS)
        if not path.is_file():
            return
        by_vehicle: dict[str, Iterator[tuple[Any, Any]]] = {}
        where = self.bag.subject.place(path)
        for row in rows(path):
            vehicle = row["vehicle"]
            if vehicle not in by_vehicle:
                topic = VehicleTopics(vehicle).gnss_fix.name
                pair = (_fixes(reader, topic) for reader in (attacked.clean, attacked.adversarial))
                by_vehicle[vehicle] = zip(*pair, strict=False)
            clean, false = next(by_vehicle[vehicle], (None, None))
            if clean is None or false is None:
                yield Fault(where, f"tells of a fix {row['fix']} of {vehicle} that the bags do not hold")
                return
            stamps = messages.stamp_ns(clean), messages.stamp_ns(false)
            if set(stamps) != {row["stamp_ns"]}:
                yield Fault(where, f"fix {row['fix']} of {vehicle} has another stamp than is told")
            for kind, fix in (("true", clean), ("false", false)):
                if [row[f"{kind}_{name}"] for name in _PLACE] != _place(fix):
                    yield Fault(where, f"fix {row['fix']} of {vehicle} is not where {kind}_... tells")
            if row["attack"] is None and _place(clean) != _place(false):
                yield Fault(where, f"fix {row['fix']} of {vehicle} was changed, and no attack is told")
        for vehicle, rest in by_vehicle.items():
            if any(_place(clean) != _place(false) for clean, false in rest):
                yield Fault(where, f"fixes of {vehicle} were changed and are not told")


def _fixes(reader: BagReader, topic: str) -> Iterator[Any]:
    return (message for _, message in reader.messages(topic)) if topic in reader.topics else iter(())


def _place(fix: Any) -> list[float | None]:
    """Latitude, longitude and altitude; None for each where there is no fix."""
    values = [fix.latitude, fix.longitude, fix.altitude]
    if fix.status.status < 0 or not all(map(math.isfinite, values)):
        return [None, None, None]
    return values
