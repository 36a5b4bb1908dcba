"""Who may have touched which messages, by the attacks that a bag names."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple

from advpipe.pipeline.bag.reader import BagReader
from advpipe.pipeline.labels.declaration import Declaration, Family, Terms
from advpipe.pipeline.localisation.geodesy import Geodesy
from advpipe.pipeline.replay.recorded_filter import default_victim, vehicles_with_filter
from advpipe.pipeline.replay.v2x_attackers import AttackerSelection
from advpipe.pipeline.replay.v2x_drive import V2xDrive
from advpipe.pipeline.scenario.acting import Acting, acting_on_messages, drawn_parts
from advpipe.pipeline.scenario.attacks import NS_PER_S, AttackSpec


class MessageAttack(NamedTuple):
    """An attack on messages or fixes that a bag names; declared: None in one of an older version."""

    spec: AttackSpec
    family: Family
    declared: Declaration | None


class DeclaredAttacker(NamedTuple):
    """An attack that touches messages, as labels name it.

    senders: station ids of the radios whose messages it touches. is_sender: whether it is the sender who
    lies. parts: of a mix, the attack that each sender carries out. acts: whether it may touch a message of
    that time. declared: None in a bag of an older version.
    """

    name: str
    senders: frozenset[int]
    is_sender: bool
    parts: Mapping[int, str]
    acts: Acting
    declared: Declaration | None = None

    @property
    def is_undeclared(self) -> bool:
        """Whether the bag comes from a version that did not record attack declarations."""
        return self.is_sender and self.declared is None


class DeclaredAttackers:
    """In the order in which they touch messages: GPS first, then V2X as configured.

    names: of all radios by station id. attackers: station ids of all senders who lie. undeclared: attacks of
    which the bag does not tell whether all that they send matters, nor what a mix is made of.
    """

    def __init__(self, clean: BagReader, attacks: Sequence[MessageAttack], start_ns: int, seed: int) -> None:
        drive = V2xDrive(clean)
        selection = AttackerSelection(drive, str(clean.path), seed)
        origin = drive.origin
        self.geodesy = Geodesy(origin.latitude_deg, origin.longitude_deg, origin.altitude_m)
        self.expiry_s = drive.v2x.ldm.expiry_s
        self._all = [
            *_spoofed(clean, attacks, drive, start_ns),
            *(_attacker(one, selection, start_ns, seed) for one in attacks if one.family == "v2x"),
        ]
        self.undeclared = tuple(dict.fromkeys(one.name for one in self._all if one.is_undeclared))
        self.names = selection.names
        self.attackers = frozenset(number for one in self._all if one.is_sender for number in one.senders)

    def named(self, name: str) -> list[DeclaredAttacker]:
        return [one for one in self._all if one.name == name]

    def declared(self, name: str, sender: int, part: str) -> list[Terms] | None:
        """What the attacks of a name on a sender's messages declare, of a mix this part of it: any may have
        touched a message. Nothing for a spoofed receiver; None where the bag does not tell."""
        attackers = [one for one in self.named(name) if sender in one.senders]
        if any(one.is_undeclared for one in attackers):
            return None
        declared = [one.declared for one in attackers if one.declared is not None]
        return [terms for one in declared if (terms := one.part(part) if part else one) is not None]

    def only_at(self, place: int, sender: int) -> DeclaredAttacker | None:
        """The one who touches a sender's messages at a `place`; None for nobody, and where several do under
        one name, so that nobody can tell whose is what."""
        name = self._all[place].name if place < len(self._all) else ""
        found = [one for one in self.named(name) if sender in one.senders]
        return found[0] if len(found) == 1 else None

    def place(self, name: str, sender: int) -> int:
        """Of the one who touches a sender's messages under this name; after all others if there is none."""
        found = (at for at, one in enumerate(self._all) if one.name == name and sender in one.senders)
        return next(found, len(self._all))


def victims(clean: BagReader, attacks: Sequence[MessageAttack]) -> dict[str, list[MessageAttack]]:
    """The attacks on GPS by the vehicle that they strike, in the order in which it was named first."""
    usual, found = default_victim(vehicles_with_filter(clean)), dict[str, list[MessageAttack]]()
    for one in attacks:
        if one.family == "gnss":
            found.setdefault(one.spec.victim or usual or "", []).append(one)
    return found


def _attacker(
    attack: MessageAttack, selection: AttackerSelection, start_ns: int, seed: int
) -> DeclaredAttacker:
    spec, declared = attack.spec, attack.declared
    senders = selection.attackers(spec)
    parts: Mapping[int, str] = {}
    if declared is not None and declared.parts:
        names = [part.name for part in declared.parts]
        parts = drawn_parts(names, senders, seed, spec.type, spec.seed_name)
    acts = acting_on_messages(spec, start_ns, seed)
    return DeclaredAttacker(spec.type, frozenset(senders), True, parts, acts, declared)


def _spoofed(
    clean: BagReader, attacks: Sequence[MessageAttack], drive: V2xDrive, start_ns: int
) -> list[DeclaredAttacker]:
    """Victims with a filter first, which believe the lie for good; of other stations, only CAMs are known."""
    with_filter = vehicles_with_filter(clean)
    by_victim = sorted(victims(clean, attacks).items(), key=lambda item: item[0] not in with_filter)
    attackers = []
    for victim, on_it in by_victim:
        struck = [one.spec for one in on_it]
        name = "+".join(dict.fromkeys(spec.type for spec in struck))
        senders = frozenset(number for number, vehicle in drive.stations.items() if vehicle == victim)
        attackers.append(
            DeclaredAttacker(name, senders, False, {}, _spans(struck, start_ns, victim in with_filter))
        )
    return attackers


def _spans(specs: Sequence[AttackSpec], start_ns: int, for_good: bool) -> Acting:
    """From the begin of one of these attacks to its end, or for good."""
    spans = [(one.schedule.from_s, None if for_good else one.schedule.to_s) for one in specs]

    def acts(time_ns: int) -> bool:
        t_s = (time_ns - start_ns) / NS_PER_S
        return any(t_s >= from_s and (to_s is None or t_s < to_s) for from_s, to_s in spans)

    return acts
