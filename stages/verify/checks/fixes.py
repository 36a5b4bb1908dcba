"""Whether labels of GNSS fixes state the true and the spoofed position exactly."""

from __future__ import annotations

import math
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np

from advpipe.pipeline.bag.reader import BagReader
from advpipe.pipeline.core.bounded_parquet import rows
from advpipe.pipeline.geometry.transforms import Float64
from advpipe.pipeline.labels.fix_quantities import FIX_QUANTITIES, FixChange
from advpipe.pipeline.labels.fixes import FILE, GEOGRAPHIC, OFFSETS
from advpipe.pipeline.labels.quantity import Range, beyond_all
from advpipe.pipeline.localisation.geodesy import Geodesy
from advpipe.pipeline.localisation.gnss import squared_sigmas
from advpipe.pipeline.messages import build
from advpipe.pipeline.messages.topics import VehicleTopics
from advpipe.pipeline.messages.types import serialise
from advpipe.pipeline.replay.recorded_filter import read_filter
from advpipe.pipeline.scenario.acting import Acting, acting_on_fixes
from advpipe.pipeline.v2x.facilities.effect import fix_has_effect
from advpipe.stages.verify.attackers import MessageAttack, victims
from advpipe.stages.verify.checks.attacked import AttackedBag
from advpipe.stages.verify.checks.base import BagCheck
from advpipe.stages.verify.declared_bounds import measurable, unmeasurable
from advpipe.stages.verify.message_store import Row
from advpipe.stages.verify.result import NOT_DECLARED, Fault, Result, Unchecked

ROUNDING = 1e-6
"""Tolerance in metres, and relative to an offset, since degrees are rounded."""


class Fixes(BagCheck):
    """Compares each fix in both bags. Fixes after a vehicle's last estimate have no label and must be
    unchanged.

    All columns are compared: with the bags, with the schedules of the declared attacks (`attack`), and with
    the rules that define them (`squared_sigmas`, `mattered`). The victim's filter is not run again, so its
    odometry and /tf are not checked.
    """

    def check(self) -> Iterator[Result]:
        if not self.bag.is_attack or self.bag.parent is None:
            return
        attacked = AttackedBag(self.bag, self.bag.parent)
        path = attacked.table(FILE)
        if not path.is_file():
            return
        where = self.bag.subject.place(path)
        yield Unchecked(self.bag.place, "odometry and /tf of vehicles with attacked GPS are not recomputed")
        geodesy, gnss_attacks = (
            read_filter(attacked.clean).geodesy,
            victims(attacked.clean, attacked.on_messages),
        )
        found: dict[str, _Receiver] = {}
        for row in rows(path):
            vehicle = row["vehicle"]
            if vehicle not in gnss_attacks:
                yield Fault(where, f"labels fix {row['fix']} of {vehicle}, whose GPS no attack targets")
                return
            if vehicle not in found:
                attacks = [
                    _FixAttack(
                        attack.spec.type,
                        acting_on_fixes(attack.spec, vehicle, attacked.start_ns, attacked.seed),
                        measurable(attack.declared.bounds, FIX_QUANTITIES) if attack.declared else {},
                    )
                    for attack in gnss_attacks[vehicle]
                ]
                readers = attacked.clean, attacked.adversarial
                found[vehicle] = _Receiver(vehicle, geodesy, attacks, _pairs(readers, vehicle))
            what = next(found[vehicle].faults(row), None)
            if what is not None:
                yield Fault(where, f"fix {row['fix']} of {vehicle} {what}")
        yield from self._unmeasured(gnss_attacks, found.keys())
        for vehicle, receiver in found.items():
            if any(_position(clean) != _position(false) for _, clean, false in receiver.pairs):
                yield Fault(where, f"fixes of {vehicle} were changed but have no labels")

    def _unmeasured(
        self, gnss_attacks: Mapping[str, Sequence[MessageAttack]], with_fixes: Collection[str]
    ) -> Iterator[Unchecked]:
        """Bounds that cannot be checked."""
        for vehicle, attacks in gnss_attacks.items():
            for spec, _, declared in attacks:
                if declared is None:
                    yield Unchecked(self.bag.place, f"bounds of {spec.type} {NOT_DECLARED}")
                    continue
                yield from unmeasurable(self.bag.place, spec.type, declared.bounds, FIX_QUANTITIES)
                if declared.bounds and vehicle not in with_fixes:
                    yield Unchecked(
                        self.bag.place, f"bounds of {spec.type} not checked: no fixes of {vehicle}"
                    )


class _FixAttack(NamedTuple):
    """An attack on a victim's fixes, and its declared bounds."""

    attack: str
    acts: Acting
    bounds: Mapping[str, Range]


@dataclass
class _Receiver:
    """A victim's fixes in both bags, each with its log time, and the attacks on them."""

    vehicle: str
    geodesy: Geodesy
    attacks: Sequence[_FixAttack]
    pairs: Iterator[tuple[int, Any, Any]]
    count: int = 0

    def faults(self, row: Row) -> Iterator[str]:
        """The faults of the next fix's label."""
        time_ns, clean, false = next(self.pairs, (0, None, None))
        if clean is None or false is None:
            yield "is labelled, but the bags do not hold it"
            return
        genuine, spoofed = _position(clean), _position(false)
        # Each attack draws a random number for each fix, even while it is not active.
        active = [attack for attack in self.attacks if genuine is not None and attack.acts(time_ns)]
        self.count += 1
        if row["fix"] != self.count - 1:
            yield f"should be labelled as fix {self.count - 1}"
        if {build.stamp_ns(clean), build.stamp_ns(false)} != {row["stamp_ns"]}:
            yield "has a time stamp that differs from its label's"
        for state, place in (("true", genuine), ("false", spoofed)):
            if [row[f"{state}_{name}"] for name in GEOGRAPHIC] != (
                place if place is not None else [None, None, None]
            ):
                yield f"has a position that differs from its label's {state}_... columns"
        attack = active[-1].attack if active else None
        if row["attack"] != attack:
            yield f"is attacked by {attack or 'nothing'}, but its label says {row['attack'] or 'nothing'}"
        if not active and genuine != spoofed:
            yield "was changed while no attack was active"
        if spoofed is not None and genuine is not None and not _is_else_same(clean, false):
            yield "was changed in more than its position"
        yield from self._offset(row, genuine, spoofed, clean)
        if spoofed is not None and genuine is not None:
            change = FixChange(self.geodesy.to_map(spoofed) - self.geodesy.to_map(genuine))
            if what := beyond_all(change, [each.bounds for each in active], FIX_QUANTITIES):
                yield f"exceeds the bounds of {attack}: {what}"

    def _offset(
        self, row: Row, genuine: list[float] | None, spoofed: list[float] | None, clean: Any
    ) -> Iterator[str]:
        """The columns that follow from the genuine and the spoofed position."""
        offsets = [row[name] for name in OFFSETS]
        if spoofed is None or genuine is None:
            if any(value is not None for value in (*offsets, row["squared_sigmas"])):
                yield "has no offset, but its label states one"
            if row["mattered"] is not (genuine is not None):
                yield (
                    f"is labelled mattered={row['mattered']}, but by the rule it should be "
                    f"{not row['mattered']}"
                )
            return
        offset_m: Float64 = np.array([math.nan if value is None else value for value in offsets])
        real_m = self.geodesy.to_map(spoofed) - self.geodesy.to_map(genuine)
        if not np.allclose(offset_m, real_m, rtol=ROUNDING, atol=ROUNDING):
            yield f"is offset by {real_m.round(6).tolist()} m, but its label says {offsets}"
            return
        squared = squared_sigmas(offset_m, np.array(clean.position_covariance, np.float64).reshape(3, 3))
        if not math.isclose(squared, row["squared_sigmas"] or 0.0, rel_tol=ROUNDING):
            yield f"is offset by {squared:g} squared sigmas, but its label says {row['squared_sigmas']}"
        if row["mattered"] is not fix_has_effect(*offset_m.tolist()):
            yield (
                f"is labelled mattered={row['mattered']}, but by the rule it should be {not row['mattered']}"
            )


def _pairs(readers: tuple[BagReader, BagReader], vehicle: str) -> Iterator[tuple[int, Any, Any]]:
    """Log time in the clean bag, and the fix in either bag."""
    topic = VehicleTopics(vehicle).gnss_fix.name
    clean, false = (reader.messages(topic) if topic in reader.topics else iter(()) for reader in readers)
    return ((time_ns, was, now) for (time_ns, was), (_, now) in zip(clean, false, strict=False))


def _position(fix: Any) -> list[float] | None:
    """Latitude, longitude and altitude; None if there is no fix."""
    values = [fix.latitude, fix.longitude, fix.altitude]
    if fix.status.status < 0 or not all(map(math.isfinite, values)):
        return None
    return values


def _is_else_same(clean: Any, false: Any) -> bool:
    fix_type = VehicleTopics().gnss_fix.type
    back = replace(false, latitude=clean.latitude, longitude=clean.longitude, altitude=clean.altitude)
    return serialise(back, fix_type) == serialise(clean, fix_type)
