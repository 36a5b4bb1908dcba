"""When an attack acts, by its schedule, and which part of a mix each attacker carries out.

Chance comes from the seed, so that it can be asked again.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from advpipe.pipeline.core.seeding import named_generator
from advpipe.pipeline.scenario.attacks import NS_PER_S, AttackSpec

Acting = Callable[[int], bool]
"""Whether an attack acts at a time in nanoseconds."""


def acting_on_messages(spec: AttackSpec, start_ns: int, seed: int) -> Acting:
    """Of an attack on messages: asked again, the answer is the same. start_ns: when the bag begins."""
    no_chance = np.random.default_rng(0)

    def acts(time_ns: int) -> bool:
        rng = no_chance
        if spec.schedule.kind == "random":
            rng = named_generator(seed, "attack", spec.type, spec.seed_name, "schedule", time_ns)
        return spec.schedule.active((time_ns - start_ns) / NS_PER_S, rng)

    return acts


def acting_on_fixes(spec: AttackSpec, victim: str, start_ns: int, seed: int) -> Acting:
    """Of an attack on a receiver: asked once for each genuine fix, in their order."""
    chance = named_generator(seed, "attack", spec.type, spec.seed_name, victim, "schedule")
    return lambda time_ns: spec.schedule.active((time_ns - start_ns) / NS_PER_S, chance)


def drawn_parts(
    parts: Sequence[str], attackers: Sequence[int], seed: int, attack: str, seed_name: str
) -> dict[int, str]:
    """Of a mix of attacks, the one of its parts that each attacker, a station id, carries out."""
    rngs = {one: named_generator(seed, "attack", attack, seed_name, "mix", one) for one in attackers}
    return {one: parts[int(rng.integers(len(parts)))] for one, rng in rngs.items()}
