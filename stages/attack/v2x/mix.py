"""Several attacks at once, each by some of the attackers: NextGen's mix modes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from advpipe.pipeline.core.errors import UsageError
from advpipe.pipeline.replay.v2x_drive import V2xStep
from advpipe.pipeline.scenario.mixes import MIXES, WORD, drawn, settings_of, words_of
from advpipe.pipeline.v2x.air import Sent
from advpipe.stages.attack.registry import ATTACKS, find_attack
from advpipe.stages.attack.v2x.editor import AttackContext, V2xAttack


class Mix(V2xAttack):
    """Each attacker draws one of these attacks, which it carries out with the defaults (but see `SETTINGS`).

    attacks: three, nextgen, f2md or all (see `MIXES`), a word, or several of both with commas between them.
    Labels name the one that was drawn as the `part`.
    """

    def __init__(self, context: AttackContext, *, attacks: str = "three") -> None:
        super().__init__(context)
        words, settings = words_of(attacks), settings_of(attacks)
        for word in words:
            if word not in ATTACKS or not word.startswith("cam-") or word == WORD:
                known = ", ".join(one for one in ATTACKS if one.startswith("cam-") and one != WORD)
                raise UsageError(
                    f"{context.name}: {word!r} is no attack to mix; known: {', '.join(MIXES)}, {known}"
                )
        drawn_by = drawn(attacks, context.attackers, context.seed, context.seed_name)
        by_word = {word: [one for one in context.attackers if drawn_by[one] == word] for word in words}
        own = replace(context, seed_name=f"{WORD} {context.seed_name}")
        self._attacks: list[V2xAttack] = [
            find_attack(word)(replace(own, name=word, attackers=tuple(attackers)), **settings.get(word, {}))
            for word, attackers in by_word.items()
            if attackers
        ]
        self._parts = {one: attack for attack in self._attacks for one in attack.context.attackers}

    def part(self, attacker: int) -> V2xAttack:
        return self._parts[attacker]

    def edit(self, step: V2xStep, sent: Sequence[Sent]) -> Sequence[Sent]:
        for attack in self._attacks:
            sent = attack.edit(step, sorted(sent, key=lambda one: (one.request_ns, one.number)))
        return sent
