"""Several attacks at once, each by some of the attackers: NextGen's mix modes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from advpipe.pipeline.bag.v2x_drive import V2xStep
from advpipe.pipeline.errors import AdvpipeError
from advpipe.pipeline.v2x.air import Sent
from advpipe.stages.attack.registry import ATTACKS, find_attack
from advpipe.stages.attack.v2x.editor import AttackContext, V2xAttack

WORD = "cam-mix"
THREE = "cam-position-offset,cam-speed-random-offset,cam-sudden-stop"
"""NextGen's mixThree."""


class Mix(V2xAttack):
    """Each attacker draws one of these attacks, which it carries out with the defaults.

    attacks: words with commas between them. NextGen's mixAll is the list of all of its attacks. Labels and
    draws have the name of the mix.
    """

    def __init__(self, context: AttackContext, *, attacks: str = THREE) -> None:
        super().__init__(context)
        words = [word.strip() for word in attacks.split(",")]
        for word in words:
            if word not in ATTACKS or not word.startswith("cam-") or word == WORD:
                known = ", ".join(one for one in ATTACKS if one.startswith("cam-") and one != WORD)
                raise AdvpipeError(f"{context.name}: {word!r} is no attack to mix; known: {known}")
        drawn = {one: words[int(context.rng("mix", one).integers(len(words)))] for one in context.attackers}
        self._attacks: list[V2xAttack] = []
        for word in dict.fromkeys(words):
            attackers = tuple(one for one in context.attackers if drawn[one] == word)
            if attackers:
                self._attacks.append(find_attack(word)(replace(context, attackers=attackers)))

    def edit(self, step: V2xStep, sent: Sequence[Sent]) -> Sequence[Sent]:
        for attack in self._attacks:
            sent = attack.edit(step, sorted(sent, key=lambda one: (one.request_ns, one.number)))
        return sent
