"""The attacks on CAMs of a relay: attackers are found while their messages pass."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from advpipe.pipeline.core.errors import UsageError
from advpipe.pipeline.core.seeding import named_generator
from advpipe.pipeline.labels.declaration import Declaration
from advpipe.pipeline.localisation.geodesy import Geodesy
from advpipe.pipeline.messages.v2x import RadioPlace
from advpipe.pipeline.replay.v2x_attackers import DEFAULT
from advpipe.pipeline.scenario.acting import acting_on_messages
from advpipe.pipeline.scenario.attacks import AttackSpec
from advpipe.pipeline.v2x.message_type import CAM
from advpipe.pipeline.v2x.section import V2x
from advpipe.stages.attack.v2x.base import AllocatedIds, AttackContext, V2xAttack
from advpipe.stages.attack.v2x.build import build_attack
from advpipe.stages.attack.v2x.cams import CamEditor
from advpipe.stages.attack.v2x.declared import declaration_of_messages
from advpipe.stages.attack.v2x.registry import V2X_ATTACKS

_ANY_ID = 1


class CamAttacks:
    """One instance of an attack for each attacker, since nobody knows beforehand which stations will come.

    built: the instances, whose order is that of `Labels`. declared: what each declares, by that order.
    names: of stations, by station id. units: the radios of the attackers' roadside units.
    """

    def __init__(self, specs: Sequence[AttackSpec], seed: int, cams: CamEditor, geodesy: Geodesy) -> None:
        self.built: list[V2xAttack] = []
        self.declared: dict[int, Declaration] = {}
        self.names: dict[int, str] = {}
        self.units: list[RadioPlace] = []
        self._specs, self._seed, self._cams, self._geodesy = specs, seed, cams, geodesy
        self._numbers = AllocatedIds(1, set())
        self._start_ns = 0
        self._v2x = V2x()
        self._known: set[int] = set()
        for spec in specs:  # a bad parameter is refused at once
            self._build(spec, _ANY_ID)

    def begin(self, start_ns: int) -> None:
        """Schedules count from here; roadside units are there from now on."""
        self._start_ns = start_ns
        for spec in self._specs:
            if spec.attackers is not None and (unit := spec.attackers.roadside_unit) is not None:
                station_id = self._new_id(len(self.units))
                map_SE3_base = np.eye(4)
                map_SE3_base[:3, 3] = unit.x_m, unit.y_m, unit.z_m - self._v2x.radio.antenna_height_m
                name = f"roadside_unit_{len(self.units) + 1}"
                self.names[station_id] = name
                self.units.append(RadioPlace(station_id, name, map_SE3_base, (0.0, 0.0, 0.0), np.zeros(3)))
                self._add(spec, station_id)

    def next_number(self) -> int:
        """The number of a message that came; attacks number those that they add in between."""
        self._numbers.next_message += 1
        return self._numbers.next_message - 1

    def meet(self, station_id: int) -> None:
        """A station is heard, perhaps for the first time: an attacker, or not, for all the time."""
        if station_id in self._known:
            return
        self._known.add(station_id)
        self._numbers.station_ids.add(station_id)
        self.names[station_id] = str(station_id)
        for spec in self._specs:
            if self._is_attacker(spec, station_id):
                self._add(spec, station_id)

    def _is_attacker(self, spec: AttackSpec, station_id: int) -> bool:
        who = spec.attackers or DEFAULT
        if who.share is None:
            return str(station_id) in who.vehicles
        rng = named_generator(self._seed, "attack", "share of attackers", spec.seed_name, station_id)
        return bool(rng.random() < who.share) and str(station_id) != spec.victim

    def _add(self, spec: AttackSpec, attacker: int) -> None:
        self.declared[len(self.built)] = declaration_of_messages(spec, V2X_ATTACKS.find(spec.type))
        self.built.append(self._build(spec, attacker))

    def _build(self, spec: AttackSpec, attacker: int) -> V2xAttack:
        attack_class = V2X_ATTACKS.find(spec.type)
        context = AttackContext(
            name=spec.type,
            seed=self._seed,
            seed_name=f"{spec.seed_name}{attacker}",
            attackers=(attacker,),
            victim=_victim(spec),
            active=acting_on_messages(spec, self._start_ns, self._seed),
            start_ns=self._start_ns,
            v2x=self._v2x,
            geodesy=self._geodesy,
            cams=self._cams,
            numbers=self._numbers,
        )
        attack = build_attack(spec, attack_class, context)
        if CAM.name not in attack.traits.message_types:
            raise UsageError(f"{spec.type} attacks no CAMs, all that a relay changes of V2X; leave it out")
        is_unit = spec.attackers is not None and spec.attackers.roadside_unit is not None
        if attack.traits.needs_traffic and is_unit:
            raise UsageError(
                f"{spec.type} changes the CAMs that a vehicle sends, but a roadside unit sends none; name "
                "vehicles as attackers"
            )
        return attack

    def _new_id(self, number: int) -> int:
        rng = named_generator(self._seed, "attack", "station id", f"roadside_unit_{number + 1}")
        self._numbers.station_ids.add(found := int(rng.integers(1, 2**31)))
        return found


def _victim(spec: AttackSpec) -> int | None:
    if spec.victim is None:
        return None
    if not spec.victim.isdecimal():
        raise UsageError(
            f"{spec.type}: victim {spec.victim!r} is no station id; a relay knows stations by it"
        )
    return int(spec.victim)
