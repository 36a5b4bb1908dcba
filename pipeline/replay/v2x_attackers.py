"""Selects the attackers: vehicles by name, a share of all stations, or an added roadside unit."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from advpipe.pipeline.core.errors import UsageError
from advpipe.pipeline.core.nearest import suggestion
from advpipe.pipeline.core.seeding import named_generator
from advpipe.pipeline.messages.v2x import RadioPlace
from advpipe.pipeline.replay.v2x_drive import V2xDrive
from advpipe.pipeline.scenario.attacks import Attackers, AttackSpec, RoadsideUnit

DEFAULT = Attackers(share=0.2)
"""The default share of attackers, as in VeReMi NextGen."""
_NAMED = 8


@dataclass
class AttackerSelection:
    """The stations of a drive, and the roadside units that attacks add to them.

    path: of the bag, for messages. names: of all radios, by station id. units: radios of the roadside units,
    which do not move.
    """

    drive: V2xDrive
    path: str
    seed: int
    names: dict[int, str] = field(init=False)
    units: list[RadioPlace] = field(default_factory=list)
    _unit_ids: dict[RoadsideUnit, int] = field(default_factory=dict)

    def __post_init__(self) -> None:
        self.names = dict(self.drive.stations)

    def attackers(self, spec: AttackSpec) -> tuple[int, ...]:
        """The attackers' station ids, ascending. Raises UsageError for a vehicle without a radio in this bag.

        A share is a share of all stations, at least one station. The attackers are drawn from the stations
        that are not instrumented, and are the same for all attacks with the same seed and `seed_name`.
        """
        who = spec.attackers or DEFAULT
        if who.roadside_unit is not None:
            return (self._unit(who.roadside_unit),)
        if who.share is None:
            return tuple(sorted(self._id_of(name, f"{spec.type}: attacker") for name in who.vehicles))
        by_name = sorted((name, number) for number, name in self.drive.stations.items())
        others = [number for name, number in by_name if number not in self.drive.listeners]
        if not others:
            raise UsageError(f"{spec.type}: all stations of {self.path} are instrumented; name an attacker")
        size = min(max(round(who.share * len(by_name)), 1), len(others))
        rng = named_generator(self.seed, "attack", "share of attackers", spec.seed_name)
        return tuple(sorted(rng.permutation(others)[:size].tolist()))

    def victim(self, spec: AttackSpec) -> int | None:
        """The victim's station id, or None. Raises UsageError for one without instruments in this bag."""
        if spec.victim is None:
            return None
        number = self._id_of(spec.victim, f"{spec.type}: victim")
        if number not in self.drive.listeners:
            known = sorted(self.drive.listeners.values())
            hint = suggestion(spec.victim, known)
            raise UsageError(
                f"{spec.type}: victim {spec.victim!r} is not instrumented in {self.path}; {hint}"
                f"{' ' if hint else ''}choose from {', '.join(known)}"
            )
        return number

    def _id_of(self, name: str, role: str) -> int:
        for number, vehicle in self.drive.stations.items():
            if vehicle == name:
                return number
        known = sorted(self.drive.stations.values())
        more = f" and {len(known) - _NAMED} more" if len(known) > _NAMED else ""
        hint = suggestion(name, known)
        raise UsageError(
            f"{role} {name!r} has no radio in {self.path}; {hint}{' ' if hint else ''}"
            f"stations are {', '.join(known[:_NAMED])}{more}"
        )

    def _unit(self, unit: RoadsideUnit) -> int:
        if unit not in self._unit_ids:
            name = f"roadside_unit_{len(self.units) + 1}"
            rng = named_generator(self.seed, "attack", "station id", name)
            while (number := int(rng.integers(1, 2**31))) in self.names:
                pass
            map_SE3_base = np.eye(4)
            map_SE3_base[:3, 3] = unit.x_m, unit.y_m, unit.z_m - self.drive.v2x.radio.antenna_height_m
            self.units.append(RadioPlace(number, name, map_SE3_base, (0.0, 0.0, 0.0), np.zeros(3)))
            self._unit_ids[unit] = number
            self.names[number] = name
        return self._unit_ids[unit]
