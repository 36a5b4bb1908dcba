"""Who may have touched which messages, by the attacks that a bag names."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple

from advpipe.pipeline.bag.reader import BagReader
from advpipe.pipeline.localisation.geodesy import Geodesy
from advpipe.pipeline.replay.recorded_filter import usual_victim, vehicles_with_filter
from advpipe.pipeline.replay.v2x_attackers import Cast
from advpipe.pipeline.replay.v2x_drive import V2xDrive
from advpipe.pipeline.scenario import mixes
from advpipe.pipeline.scenario.acting import Acting, acting_on_messages
from advpipe.pipeline.scenario.attacks import NS_PER_S, AttackSpec


class Liar(NamedTuple):
    """An attack that touches messages, as labels name it.

    senders: station ids of the radios whose messages it touches. is_sender: whether it is the sender who
    lies. parts: of a mix, the word that each sender carries out. acts: whether it may touch a message of that
    time.
    """

    name: str
    senders: frozenset[int]
    is_sender: bool
    parts: Mapping[int, str]
    acts: Acting


class Liars:
    """In the order in which they touch messages: GPS first, then V2X as configured.

    names: of all radios by station id. attackers: station ids of all senders who lie.
    """

    def __init__(self, clean: BagReader, specs: Sequence[AttackSpec], start_ns: int, seed: int) -> None:
        drive = V2xDrive(clean)
        cast = Cast(drive, str(clean.path), seed)
        origin = drive.origin
        self.geodesy = Geodesy(origin.latitude_deg, origin.longitude_deg, origin.altitude_m)
        self.expiry_s = drive.v2x.ldm.expiry_s
        cam = [spec for spec in specs if spec.family == "cam"]
        self._all = [
            *_spoofed(clean, specs, drive, start_ns),
            *(_liar(one, cast, start_ns, seed) for one in cam),
        ]
        self.names = cast.names
        self.attackers = frozenset(number for one in self._all if one.is_sender for number in one.senders)

    def named(self, name: str) -> list[Liar]:
        return [one for one in self._all if one.name == name]

    def place(self, name: str, sender: int) -> int:
        """Of the one who touches a sender's messages under this name; after all others if there is none."""
        found = (at for at, one in enumerate(self._all) if one.name == name and sender in one.senders)
        return next(found, len(self._all))


def victims(clean: BagReader, specs: Sequence[AttackSpec]) -> dict[str, list[AttackSpec]]:
    """The attacks on GPS by the vehicle that they strike, in the order in which it was named first."""
    usual, found = usual_victim(vehicles_with_filter(clean)), dict[str, list[AttackSpec]]()
    for spec in specs:
        if spec.family == "gnss":
            found.setdefault(spec.victim or usual or "", []).append(spec)
    return found


def _liar(spec: AttackSpec, cast: Cast, start_ns: int, seed: int) -> Liar:
    senders = cast.attackers(spec)
    parts: Mapping[int, str] = {}
    if spec.type == mixes.WORD:
        parts = mixes.drawn(spec.parameters["attacks"], senders, seed, spec.seed_name)
    return Liar(spec.type, frozenset(senders), True, parts, acting_on_messages(spec, start_ns, seed))


def _spoofed(clean: BagReader, specs: Sequence[AttackSpec], drive: V2xDrive, start_ns: int) -> list[Liar]:
    """Victims with a filter first, which believe the lie for good; of other stations, only CAMs are known."""
    with_filter = vehicles_with_filter(clean)
    by_victim = sorted(victims(clean, specs).items(), key=lambda item: item[0] not in with_filter)
    liars = []
    for victim, struck in by_victim:
        name = "+".join(dict.fromkeys(spec.type for spec in struck))
        senders = frozenset(number for number, vehicle in drive.stations.items() if vehicle == victim)
        liars.append(Liar(name, senders, False, {}, _spans(struck, start_ns, victim in with_filter)))
    return liars


def _spans(specs: Sequence[AttackSpec], start_ns: int, for_good: bool) -> Acting:
    """From the begin of one of these attacks to its end, or for good."""
    spans = [(one.schedule.from_s, None if for_good else one.schedule.to_s) for one in specs]

    def acts(time_ns: int) -> bool:
        t_s = (time_ns - start_ns) / NS_PER_S
        return any(t_s >= from_s and (to_s is None or t_s < to_s) for from_s, to_s in spans)

    return acts
