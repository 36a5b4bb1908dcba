"""Several attacks at once, each by some of the attackers: NextGen's mix modes."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from typing import Any, NamedTuple

from advpipe.pipeline.core.errors import UsageError
from advpipe.pipeline.labels.claims import ALL_CLAIMS, Claim
from advpipe.pipeline.labels.declaration import DeclaredPart, Published
from advpipe.pipeline.replay.v2x_drive import V2xStep
from advpipe.pipeline.scenario.acting import drawn_parts
from advpipe.pipeline.v2x.channel import Sent
from advpipe.stages.attack.parameters import known_parameters
from advpipe.stages.attack.v2x.base import AttackContext, V2xAttack, V2xTraits, v2x_traits
from advpipe.stages.attack.v2x.position import PositionOffset
from advpipe.stages.attack.v2x.registry import V2X_ATTACKS
from advpipe.stages.attack.v2x.speed import SpeedRandomOffset
from advpipe.stages.attack.v2x.stop import SuddenStop


class Mixed(NamedTuple):
    """One of the attacks to draw from, and its parameters that are not the default."""

    name: str
    parameters: Mapping[str, Any]


class Mix(V2xAttack):
    """Each attacker draws one of these attacks, which it carries out with the defaults (but see `nextgen`).

    attacks: three, nextgen, f2md or all (see `MIXES`), an attack, or several of both with commas between
    them. Labels name the one that was drawn as the `part`.
    """

    traits = V2xTraits(untrue=ALL_CLAIMS)

    def __init__(self, context: AttackContext, *, attacks: str = "three") -> None:
        super().__init__(context)
        mixed = _mixed(context.name, attacks)
        parameters = {one.name: one.parameters for one in mixed if one.parameters}
        names = [one.name for one in mixed]
        drawn_by = drawn_parts(names, context.attackers, context.seed, context.name, context.seed_name)
        own = replace(context, seed_name=f"{context.name} {context.seed_name}")
        self._attacks: list[V2xAttack] = [
            V2X_ATTACKS[name](replace(own, name=name, attackers=attackers), **parameters.get(name, {}))
            for name in dict.fromkeys(names)
            if (attackers := tuple(one for one in context.attackers if drawn_by[one] == name))
        ]
        self._parts = {one: attack for attack in self._attacks for one in attack.context.attackers}

    @classmethod
    def parts(cls, name: str, parameters: Mapping[str, Any]) -> tuple[DeclaredPart, ...]:
        return tuple(_part(one) for one in _mixed(name, parameters["attacks"]))

    @classmethod
    def untrue(cls, parameters: Mapping[str, Any]) -> tuple[Claim, ...]:
        """What any of its parts makes untrue."""
        told = {claim for part in cls.parts("cam-mix", parameters) for claim in part.untrue}
        return tuple(claim for claim in ALL_CLAIMS if claim in told)

    def part(self, attacker: int) -> V2xAttack:
        return self._parts[attacker]

    def edit(self, step: V2xStep, sent: Sequence[Sent]) -> Sequence[Sent]:
        for attack in self._attacks:
            sent = attack.edit(step, sorted(sent, key=lambda one: (one.request_ns, one.number)))
        return sent


def _part(mixed: Mixed) -> DeclaredPart:
    """What it declares with its parameters."""
    kind = V2X_ATTACKS[mixed.name]
    traits, parameters = v2x_traits(kind), {**known_parameters(kind), **mixed.parameters}
    return DeclaredPart(
        name=mixed.name,
        every_message_matters=traits.every_message_matters,
        bounds=dict(kind.bounds(parameters)),
        untrue=kind.untrue(parameters),
        published=traits.published_with({}),
    )


def three() -> list[Mixed]:
    """NextGen's mixThree."""
    kinds = PositionOffset, SpeedRandomOffset, SuddenStop
    return [Mixed(name, {}) for kind in kinds for name, known in V2X_ATTACKS.items() if known is kind]


def nextgen() -> list[Mixed]:
    """NextGen's mixAll, each attack as that has it: its constant speed is a zero speed report."""
    return [Mixed(name, v2x_traits(V2X_ATTACKS[name]).published_of) for name in _by(lambda p: p.nextgen)]


def f2md() -> list[Mixed]:
    """The 19 of F2MD, in the order of their numbers in VeReMi's extension."""
    return [Mixed(name, {}) for name in _by(lambda published: published.veremi_extension)]


def both() -> list[Mixed]:
    """Both catalogues together, each attack with its defaults."""
    names = (one.name for one in (*f2md(), *nextgen()))
    return [Mixed(name, {}) for name in dict.fromkeys(names)]


MIXES: Mapping[str, Callable[[], list[Mixed]]] = {
    "three": three,
    "nextgen": nextgen,
    "f2md": f2md,
    "all": both,
}


def _by(place: Callable[[Published], int | None]) -> list[str]:
    """The attacks that have a place in a catalogue, in its order."""
    places = {name: place(v2x_traits(kind).published) for name, kind in V2X_ATTACKS.items()}
    return sorted((name for name in places if places[name] is not None), key=lambda name: places[name] or 0)


def _mixed(mix: str, attacks: str) -> list[Mixed]:
    """What `attacks` names. Raises AdvpipeError for what is neither a mix nor an attack to mix."""
    return [one for name in attacks.split(",") for one in _of(mix, name.strip())]


def _of(mix: str, name: str) -> Iterator[Mixed]:
    if name in MIXES:
        yield from MIXES[name]()
    elif name in V2X_ATTACKS and not issubclass(V2X_ATTACKS[name], Mix):
        yield Mixed(name, {})
    else:
        known = ", ".join(one for one, kind in V2X_ATTACKS.items() if not issubclass(kind, Mix))
        raise UsageError(f"{mix}: {name!r} is no attack to mix; known: {', '.join(MIXES)}, {known}")
