"""Several attacks at once, each by some of the attackers: NextGen's mix modes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

from advpipe.pipeline.bag.v2x_drive import V2xStep
from advpipe.pipeline.errors import AdvpipeError
from advpipe.pipeline.v2x.air import Sent
from advpipe.stages.attack.registry import ATTACKS, find_attack
from advpipe.stages.attack.v2x.editor import AttackContext, V2xAttack

WORD = "cam-mix"
THREE = ("cam-position-offset", "cam-speed-random-offset", "cam-sudden-stop")
NEXTGEN = (
    *("cam-position-offset", "cam-position-random-offset", "cam-position-mirrored", "cam-speed-offset"),
    *("cam-speed-random-offset", "cam-speed-constant", "cam-speed-frozen", "cam-heading-reversed"),
    *("cam-feigned-braking", "cam-acceleration", "cam-delay", "cam-dos", "cam-sybil-congestion"),
    *("cam-sudden-stop", "cam-replay"),
)
F2MD = (
    *("cam-position-constant", "cam-position-offset", "cam-position-random", "cam-position-random-offset"),
    *("cam-speed-constant", "cam-speed-offset", "cam-speed-random", "cam-speed-random-offset"),
    *("cam-eventual-stop", "cam-disruptive-replay", "cam-replay", "cam-stale", "cam-dos", "cam-dos-random"),
    *("cam-dos-disruptive", "cam-sybil-grid", "cam-sybil-replay", "cam-dos-random-sybil"),
    "cam-dos-disruptive-sybil",
)
MIXES: dict[str, tuple[str, ...]] = {
    "three": THREE,
    "nextgen": NEXTGEN,
    "f2md": F2MD,
    "all": tuple(dict.fromkeys((*F2MD, *NEXTGEN))),
}
"""NextGen's mixThree, its mixAll, the same of the 19 of F2MD, and of both catalogues together."""
SETTINGS: dict[str, dict[str, dict[str, Any]]] = {"nextgen": {"cam-speed-constant": {"speed_mps": 0.0}}}
"""By mix and word, what is not the default: NextGen's constant speed is its zero speed report."""


class Mix(V2xAttack):
    """Each attacker draws one of these attacks, which it carries out with the defaults (but see `SETTINGS`).

    attacks: three, nextgen, f2md or all (see `MIXES`), a word, or several of both with commas between them.
    Labels name the one that was drawn as the `part`.
    """

    def __init__(self, context: AttackContext, *, attacks: str = "three") -> None:
        super().__init__(context)
        named = [name.strip() for name in attacks.split(",")]
        words = [word for name in named for word in MIXES.get(name, (name,))]
        settings = {word: given for name in named for word, given in SETTINGS.get(name, {}).items()}
        for word in words:
            if word not in ATTACKS or not word.startswith("cam-") or word == WORD:
                known = ", ".join(one for one in ATTACKS if one.startswith("cam-") and one != WORD)
                raise AdvpipeError(
                    f"{context.name}: {word!r} is no attack to mix; known: {', '.join(MIXES)}, {known}"
                )
        drawn: dict[str, list[int]] = {word: [] for word in words}
        for one in context.attackers:
            drawn[words[int(context.rng("mix", one).integers(len(words)))]].append(one)
        own = replace(context, seed_name=f"{WORD} {context.seed_name}")
        self._attacks: list[V2xAttack] = [
            find_attack(word)(replace(own, name=word, attackers=tuple(attackers)), **settings.get(word, {}))
            for word, attackers in drawn.items()
            if attackers
        ]
        self._parts = {one: attack for attack in self._attacks for one in attack.context.attackers}

    def part(self, attacker: int) -> V2xAttack:
        return self._parts[attacker]

    def edit(self, step: V2xStep, sent: Sequence[Sent]) -> Sequence[Sent]:
        for attack in self._attacks:
            sent = attack.edit(step, sorted(sent, key=lambda one: (one.request_ns, one.number)))
        return sent
