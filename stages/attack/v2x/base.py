"""What changes messages before they reach the radio: the protocol of editors, and how attacks are built.

An attack on messages is a `V2xAttack`: a class whose constructor takes its context first and its
parameters keyword-only, with defaults and units in their names. It declares its `traits`. `edit` is called
once a step, in time order, with all messages of all stations in that step, as the editors before it left
them (of its `V2xTraits.message_types`, CAMs by default); it returns all that are to be sent instead:

>>> class Zero(V2xAttack):
...     traits = V2xTraits(untrue=("speed",))
...
...     def edit(self, step, sent):
...         return [self._zero(one) if self.context.acts(one) else one for one in sent]

- *Change* a message: `replace(one, payload=...)`; open CAMs with `context.cams.open(payload)` (None: corrupt,
  hand it on as it is), falsify them with `with_fields(tree, speed_mps=0.0)` of `cams.py`, and
  close them with `context.cams.close(tree)`. Trees are shared: never change one in place.
- *Drop* one: leave it out. *Delay* one: leave it out, and return it in a later step under its own number with
  `replace(one, request_ns=...)`.
- *Add* one: `context.message(sender, request_ns, payload)`. Ghost vehicles get their station ids from
  `context.pseudonym(...)`.
- `request_ns` lies in `step.begin_ns <= request_ns < step.end_ns`, and the sender's radio (`Sent.station_id`,
  whatever the payload claims) has to be on the road, that is in `step.radios`. The order does not matter.
- The truth about every station with a radio is in `step.radios`: see `context.radio(step, station_id)`.
- Random draws come from `context.rng("use", station_id, ...)` only.

An attack does not write labels: the engine compares its input with its output, by message number. A message
with another payload is "changed", a missing one "dropped" (or "delayed", if it comes later), a new one
"added"; the attacker is the station whose radio sends it. True values are those of the recorded message;
whether false ones have an effect follows from both (`pipeline/v2x/facilities/effect.py`), unless all of the
attack's messages do (`V2xTraits.every_message_matters`).
"""

from __future__ import annotations

import zlib
from abc import abstractmethod
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from itertools import count
from typing import Any, Protocol

import numpy as np

from advpipe.pipeline.core.errors import UsageError
from advpipe.pipeline.core.seeding import named_generator
from advpipe.pipeline.core.short_repr import short_repr
from advpipe.pipeline.labels.claims import KNOWN_CLAIMS, Claim
from advpipe.pipeline.labels.declaration import DeclaredPart, Published
from advpipe.pipeline.labels.message_quantities import MESSAGE_QUANTITIES
from advpipe.pipeline.localisation.geodesy import Geodesy
from advpipe.pipeline.messages.v2x import RadioPlace
from advpipe.pipeline.misbehaviour.roads import RoadMap
from advpipe.pipeline.replay.v2x_drive import V2xStep
from advpipe.pipeline.v2x.channel import Sent
from advpipe.pipeline.v2x.message_type import CAM
from advpipe.pipeline.v2x.radio.draws import message_keys
from advpipe.pipeline.v2x.section import V2x
from advpipe.stages.attack.base import Attack, PublishedPreset, Traits
from advpipe.stages.attack.v2x.cams import CamEditor
from advpipe.stages.attack.v2x.identities import StationIdentities


class MessageEditor(Protocol):
    """Changes the messages that are sent. name: its name in the labels, such as `gnss-bias`."""

    @property
    def name(self) -> str: ...

    def edit(self, step: V2xStep, sent: Sequence[Sent]) -> Sequence[Sent]:
        """The messages of this step that are to be sent instead of `sent`."""
        ...


@dataclass
class AllocatedIds:
    """The numbers of new messages and the station ids in use, shared by all attacks on one drive."""

    next_message: int
    station_ids: set[int]


@dataclass(frozen=True, kw_only=True)
class AttackContext:
    """What an attack knows about the drive.

    name: the attack's name in labels and random generators; seed_name distinguishes several attacks of one
    name. attackers: station ids of the attackers' radios, ascending. victim: a station id; None without a
    target. active: whether the schedule includes a time in nanoseconds. start_ns: when the bag begins. roads:
    reads them, None for a bag without. identities: what stations call themselves now, by their radios.
    """

    name: str
    seed: int
    seed_name: str = ""
    attackers: tuple[int, ...]
    victim: int | None
    active: Callable[[int], bool]
    start_ns: int
    v2x: V2x
    geodesy: Geodesy
    cams: CamEditor
    numbers: AllocatedIds
    roads: Callable[[], RoadMap | None] = lambda: None
    identities: StationIdentities = field(default_factory=StationIdentities)
    _copies: count[int] = field(default_factory=lambda: count(1))

    @cached_property
    def attacking(self) -> frozenset[int]:
        """The attackers as a set."""
        return frozenset(self.attackers)

    def acts(self, sent: Sent) -> bool:
        """Whether an attacker's radio sends this message while the attack is active."""
        return sent.station_id in self.attacking and self.active(sent.request_ns)

    def rng(self, *names: str | int) -> np.random.Generator:
        """A separate random generator for each use, under the attack's name."""
        return named_generator(self.seed, "attack", self.name, self.seed_name, *names)

    def radio(self, step: V2xStep, station_id: int) -> RadioPlace | None:
        """Where a station truly is in this step; None for one that is not on the road."""
        return next((radio for radio in step.radios if radio.station_id == station_id), None)

    def message(self, sender: int, request_ns: int, payload: bytes, power_dbm: float | None = None) -> Sent:
        """A new message of an attacker's radio, with random draws of its own.

        power_dbm: that of the scenario's radios if left out.
        """
        number = self.numbers.next_message
        self.numbers.next_message += 1
        copy = (zlib.crc32(f"{self.name} {self.seed_name}".encode()) << 24) + next(self._copies)
        key = int(message_keys(sender, request_ns, copy))
        power = self.v2x.radio.transmit_power_dbm if power_dbm is None else power_dbm
        return Sent(number, key, sender, request_ns, payload, power)

    def pseudonym(self, *names: str | int) -> int:
        """A new station id, which no station has; 31 bits, as stations choose theirs."""
        rng = self.rng("pseudonym", *names)
        while (station_id := int(rng.integers(1, 2**31))) in self.numbers.station_ids:
            pass
        self.numbers.station_ids.add(station_id)
        return station_id


@dataclass(frozen=True, kw_only=True)
class V2xTraits(Traits):
    """Properties of an attack on messages that do not depend on its parameters.

    untrue: the claims that it may falsify in its attackers' messages (see `V2xAttack.untrue`); two attacks
    that share one cannot act on the same messages at the same time, and `verify` reports a message that was
    changed in any other claim. An attack that only adds, delays or drops messages falsifies none.
    every_message_matters: all messages that attackers send by it are false whatever they claim: the station
    does not exist, or is another, or the message is redundant; otherwise each is judged by its claims
    (`pipeline/v2x/facilities/effect.py`). needs_traffic: it changes messages that its attackers send anyway,
    so that a roadside unit, which sends none, cannot be an attacker. needs_ticket: where messages are signed,
    it has an effect from an insider alone, who has a ticket; an outsider can still load the channel or drop
    messages. begins_true: the first messages of its attackers stay true, as they have no older ones to
    repeat. message_types: names of the `MESSAGE_TYPES` that it sees and sends. published: see
    `Published`; its F1 is that of an attack with the parameters `published_of`, or of its preset.
    """

    untrue: tuple[Claim, ...] = ()
    every_message_matters: bool = False
    needs_traffic: bool = True
    needs_ticket: bool = True
    begins_true: bool = False
    message_types: tuple[str, ...] = (CAM.name,)
    published: Published = field(default_factory=Published)
    published_of: Mapping[str, Any] = field(default_factory=dict)

    def __post_init__(self) -> None:
        if strange := [claim for claim in self.untrue if claim not in KNOWN_CLAIMS]:
            known = ", ".join(KNOWN_CLAIMS)
            raise UsageError(f"no message has a claim {short_repr(strange[0])}; known: {known}")

    def published_with(self, parameters: Mapping[str, Any]) -> Published:
        """The published figures of the attack with these parameters."""
        if all(parameters.get(name) == value for name, value in self.published_of.items()):
            return self.published
        return self.published.model_copy(update={"catch_f1": None})


class V2xAttack(Attack):
    """An attack on messages; the module's docstring has the rules."""

    family = "v2x"
    family_title = "V2X: change, delay, drop or add messages (CAMs and DENMs)"
    usual_options = "--attacker 20%"
    own_keys = ("attackers", "dcc_reacts", "credentials", "network")
    traits_type = V2xTraits
    quantities = MESSAGE_QUANTITIES

    preset: PublishedPreset | None = None
    """What the attack is to do exactly, and by which labels; see `build.py`."""

    def __init__(self, context: AttackContext) -> None:
        self.context = context

    @property
    @abstractmethod
    def traits(self) -> V2xTraits: ...

    @property
    def name(self) -> str:
        """The attack's name in the request."""
        return self.context.name

    @classmethod
    def parts(cls, name: str, parameters: Mapping[str, Any]) -> tuple[DeclaredPart, ...]:
        """The attacks that the attackers of a mix draw from, by `acting.drawn_parts`; empty for any other
        attack. Raises AdvpipeError for one that cannot be mixed."""
        return ()

    @classmethod
    def bounds(cls, parameters: Mapping[str, Any]) -> Mapping[str, tuple[float, float]]:
        """Minimum and maximum of each quantity that the attack bounds, with all its parameters, in every
        message that it changes, delays or adds; by names of `advpipe.pipeline.labels.message_quantities`. A
        message beyond them is refused, and `verify` measures them again. Empty if it bounds none."""
        return {}

    @classmethod
    def untrue(cls, parameters: Mapping[str, Any]) -> tuple[Claim, ...]:
        """The claims that it falsifies with all its parameters; by default all of its traits' `untrue`."""
        return v2x_traits(cls).untrue

    def part(self, attacker: int) -> V2xAttack:
        """The attack that this attacker carries out: this one, except in a mix of attacks."""
        return self

    @abstractmethod
    def edit(self, step: V2xStep, sent: Sequence[Sent]) -> Sequence[Sent]:
        """The messages of this step that are to be sent instead of `sent`."""


def v2x_traits(attack_class: type[V2xAttack]) -> V2xTraits:
    """The traits of a class."""
    found: V2xTraits = vars(attack_class)["traits"]
    return found
