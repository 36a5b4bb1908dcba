"""Mixes of several attacks, each carried out by some of the attackers: NextGen's mix modes."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from typing import Any, NamedTuple

from advpipe.pipeline.core.errors import UsageError
from advpipe.pipeline.core.nearest import known_names
from advpipe.pipeline.labels.claims import ALL_CLAIMS, Claim
from advpipe.pipeline.labels.declaration import DeclaredPart, Published
from advpipe.pipeline.replay.v2x_drive import V2xStep
from advpipe.pipeline.scenario.acting import drawn_parts
from advpipe.pipeline.scenario.attacks import AttackSpec
from advpipe.pipeline.v2x.channel import Sent
from advpipe.stages.attack.v2x.base import AttackContext, V2xAttack, V2xTraits, v2x_traits
from advpipe.stages.attack.v2x.build import build_attack
from advpipe.stages.attack.v2x.declared import declaration_of_messages
from advpipe.stages.attack.v2x.position import PositionOffset
from advpipe.stages.attack.v2x.registry import V2X_ATTACKS
from advpipe.stages.attack.v2x.speed import SpeedRandomOffset
from advpipe.stages.attack.v2x.stop import SuddenStop


class Mixed(NamedTuple):
    """One of the attacks to draw from, with its non-default parameters."""

    name: str
    parameters: Mapping[str, Any]

    @property
    def spec(self) -> AttackSpec:
        """The attack by itself."""
        return AttackSpec(type=self.name, parameters=dict(self.parameters))


class Mix(V2xAttack):
    """Each attacker draws one attack of the mix and carries it out.

    attacks: three, nextgen, f2md or all (see `MIXES`), an attack, or several of both, separated by commas.
    `three` and `nextgen` are attacks of NextGen as it publishes them, `f2md` those of F2MD; others have our
    default parameters. Labels name the drawn attack as the `part`.
    """

    traits = V2xTraits(untrue=ALL_CLAIMS)

    def __init__(self, context: AttackContext, *, attacks: str = "three") -> None:
        super().__init__(context)
        mixed = _mixed(context.name, attacks)
        specs = {one.name: one.spec for one in mixed}
        names = [one.name for one in mixed]
        drawn_by = drawn_parts(names, context.attackers, context.seed, context.name, context.seed_name)
        own = replace(context, seed_name=f"{context.name} {context.seed_name}")
        self._attacks: list[V2xAttack] = [
            build_attack(specs[name], V2X_ATTACKS[name], replace(own, name=name, attackers=attackers))
            for name in dict.fromkeys(names)
            if (attackers := tuple(one for one in context.attackers if drawn_by[one] == name))
        ]
        self._parts = {one: attack for attack in self._attacks for one in attack.context.attackers}

    @classmethod
    def parts(cls, name: str, parameters: Mapping[str, Any]) -> tuple[DeclaredPart, ...]:
        return tuple(_part(one) for one in _mixed(name, parameters["attacks"]))

    @classmethod
    def untrue(cls, parameters: Mapping[str, Any]) -> tuple[Claim, ...]:
        """The claims that any of its parts falsifies."""
        untrue = {claim for part in cls.parts("cam-mix", parameters) for claim in part.untrue}
        return tuple(claim for claim in ALL_CLAIMS if claim in untrue)

    def part(self, attacker: int) -> V2xAttack:
        return self._parts[attacker]

    def edit(self, step: V2xStep, sent: Sequence[Sent]) -> Sequence[Sent]:
        for attack in self._attacks:
            sent = attack.edit(step, sorted(sent, key=lambda one: (one.request_ns, one.number)))
        return sent


def _part(mixed: Mixed) -> DeclaredPart:
    """The declaration of an attack with its parameters."""
    declared = declaration_of_messages(mixed.spec, V2X_ATTACKS[mixed.name])
    shared = DeclaredPart.model_fields.keys() - {"name"}
    return DeclaredPart(name=mixed.name, **{key: getattr(declared, key) for key in shared})


def three_attacks() -> list[Mixed]:
    """NextGen's mixThree."""
    attack_classes = PositionOffset, SpeedRandomOffset, SuddenStop
    return [
        Mixed(name, {"preset": "nextgen"})
        for attack_class in attack_classes
        for name, candidate in V2X_ATTACKS.items()
        if candidate is attack_class
    ]


def nextgen_attacks() -> list[Mixed]:
    """NextGen's mixAll, of its presets: its constant speed is a zero speed report."""
    return [Mixed(name, {"preset": "nextgen"}) for name in _in_catalogue(lambda p: p.nextgen)]


def f2md_attacks() -> list[Mixed]:
    """The 19 attacks of F2MD by its presets, in the order of their numbers in VeReMi's extension."""
    names = _in_catalogue(lambda published: published.veremi_extension)
    return [Mixed(name, {"preset": "f2md"}) for name in names]


def all_attacks() -> list[Mixed]:
    """Both catalogues together, each attack with its defaults."""
    names = (one.name for one in (*f2md_attacks(), *nextgen_attacks()))
    return [Mixed(name, {}) for name in dict.fromkeys(names)]


MIXES: Mapping[str, Callable[[], list[Mixed]]] = {
    "three": three_attacks,
    "nextgen": nextgen_attacks,
    "f2md": f2md_attacks,
    "all": all_attacks,
}


def _in_catalogue(place: Callable[[Published], int | None]) -> list[str]:
    """The attacks of a catalogue, in its order."""
    places = {name: place(v2x_traits(attack_class).published) for name, attack_class in V2X_ATTACKS.items()}
    return sorted((name for name in places if places[name] is not None), key=lambda name: places[name] or 0)


def _mixed(mix: str, attacks: str) -> list[Mixed]:
    """The attacks that `attacks` names. Raises AdvpipeError for a name of neither a mix nor an attack."""
    return [one for name in attacks.split(",") for one in _named(mix, name.strip())]


def _named(mix: str, name: str) -> Iterator[Mixed]:
    if name in MIXES:
        yield from MIXES[name]()
    elif name in V2X_ATTACKS and not issubclass(V2X_ATTACKS[name], Mix):
        yield Mixed(name, {})
    else:
        attacks = (one for one, attack_class in V2X_ATTACKS.items() if not issubclass(attack_class, Mix))
        raise UsageError(f"{mix}: {name!r} cannot be mixed; {known_names(name, (*MIXES, *attacks))}")
