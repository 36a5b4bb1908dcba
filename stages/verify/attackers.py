"""The attackers that may have changed each message, from the attacks that a bag declares."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple

from advpipe.pipeline.bag.pseudonyms import radios_by_pseudonym
from advpipe.pipeline.bag.reader import BagReader
from advpipe.pipeline.labels.declaration import Declaration, Family, Terms
from advpipe.pipeline.localisation.geodesy import Geodesy
from advpipe.pipeline.replay.recorded_filter import default_victim, vehicles_with_filter
from advpipe.pipeline.replay.v2x_attackers import AttackerSelection
from advpipe.pipeline.replay.v2x_drive import V2xDrive
from advpipe.pipeline.scenario.acting import Acting, acting_on_messages, drawn_parts
from advpipe.pipeline.scenario.attacks import NS_PER_S, AttackSpec


class MessageAttack(NamedTuple):
    """An attack on messages or fixes in a bag's provenance; declared: None in a bag of an older version."""

    spec: AttackSpec
    family: Family
    declared: Declaration | None


class DeclaredAttacker(NamedTuple):
    """An attack that touches messages, by its name in labels.

    senders: station ids of the radios whose messages it touches. is_sender: whether the sender itself
    attacks. parts: of a mix, the attack that each sender carries out. acts: whether it may touch a message at
    a time in nanoseconds. declared: None in a bag of an older version.
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
    """The attackers of a bag in the order in which they touch messages: GPS first, then V2X as configured.

    names: of all radios by station id. attackers: station ids of all attacking senders. undeclared: attacks
    for which the bag declares neither whether every message has an effect nor the parts of a mix.
    """

    def __init__(self, clean: BagReader, attacks: Sequence[MessageAttack], start_ns: int, seed: int) -> None:
        drive = V2xDrive(clean)
        selection = AttackerSelection(drive, str(clean.path), seed)
        origin = drive.origin
        self.geodesy = Geodesy(origin.latitude_deg, origin.longitude_deg, origin.altitude_m)
        self.expiry_s = drive.v2x.ldm.expiry_s
        self._all = [
            *_spoofed(clean, attacks, drive, start_ns),
            *(_attacker(attack, selection, start_ns, seed) for attack in attacks if attack.family == "v2x"),
        ]
        self.undeclared = tuple(
            dict.fromkeys(attacker.name for attacker in self._all if attacker.is_undeclared)
        )
        self.names = selection.names
        self.radios = radios_by_pseudonym(clean)
        self.attackers = frozenset(
            number for attacker in self._all if attacker.is_sender for number in attacker.senders
        )

    def named(self, name: str) -> list[DeclaredAttacker]:
        """The attackers with this attack name."""
        return [attacker for attacker in self._all if attacker.name == name]

    def declared(self, name: str, sender: int, part: str) -> list[Terms] | None:
        """The declarations of the attacks of this name, or this part of a mix, on a sender's messages; each
        of them may have touched a message. Empty for a spoofed receiver; None if the bag does not record
        them."""
        attackers = [attacker for attacker in self.named(name) if sender in attacker.senders]
        if any(attacker.is_undeclared for attacker in attackers):
            return None
        declared = [attacker.declared for attacker in attackers if attacker.declared is not None]
        return [
            terms
            for declaration in declared
            if (terms := declaration.part(part) if part else declaration) is not None
        ]

    def attacker_at(self, index: int, sender: int) -> DeclaredAttacker | None:
        """The attacker that touches a sender's messages at this index; None if there is none, or if several
        of that name do, so that the attacker is ambiguous."""
        name = self._all[index].name if index < len(self._all) else ""
        found = [attacker for attacker in self.named(name) if sender in attacker.senders]
        return found[0] if len(found) == 1 else None

    def index(self, name: str, sender: int) -> int:
        """Index of the attacker that touches a sender's messages under this name; the count of all if none
        does."""
        found = (
            index
            for index, attacker in enumerate(self._all)
            if attacker.name == name and sender in attacker.senders
        )
        return next(found, len(self._all))


def victims(clean: BagReader, attacks: Sequence[MessageAttack]) -> dict[str, list[MessageAttack]]:
    """The GPS attacks by victim vehicle, victims in the order of their first attack."""
    default, found = default_victim(vehicles_with_filter(clean)), dict[str, list[MessageAttack]]()
    for attack in attacks:
        if attack.family == "gnss":
            found.setdefault(attack.spec.victim or default or "", []).append(attack)
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
    """Victims with a filter first, whose errors persist; other stations have only their CAMs recorded."""
    with_filter = vehicles_with_filter(clean)
    by_victim = sorted(victims(clean, attacks).items(), key=lambda item: item[0] not in with_filter)
    attackers = []
    for victim, its_attacks in by_victim:
        specs = [attack.spec for attack in its_attacks]
        name = "+".join(dict.fromkeys(spec.type for spec in specs))
        senders = frozenset(number for number, vehicle in drive.stations.items() if vehicle == victim)
        attackers.append(
            DeclaredAttacker(name, senders, False, {}, _spans(specs, start_ns, victim in with_filter))
        )
    return attackers


def _spans(specs: Sequence[AttackSpec], start_ns: int, is_permanent: bool) -> Acting:
    """Whether one of these attacks acts: from its begin to its end, or for ever."""
    spans = [(spec.schedule.from_s, None if is_permanent else spec.schedule.to_s) for spec in specs]

    def acts(time_ns: int) -> bool:
        t_s = (time_ns - start_ns) / NS_PER_S
        return any(t_s >= from_s and (to_s is None or t_s < to_s) for from_s, to_s in spans)

    return acts
