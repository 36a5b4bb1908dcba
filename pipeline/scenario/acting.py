"""Decides when an attack acts, by its schedule, and which part of a mix each attacker carries out.

Random draws derive from the seed, so that `advpipe verify` can repeat them.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from advpipe.pipeline.core.seeding import named_generator
from advpipe.pipeline.scenario.attacks import NS_PER_S, AttackSpec

Acting = Callable[[int], bool]
"""Maps a time in nanoseconds to whether an attack acts."""


def acting_on_messages(spec: AttackSpec, start_ns: int, seed: int) -> Acting:
    """The times at which an attack on messages acts; repeated calls for the same time give the same answer.

    start_ns: the time of the bag's first message; seed: of the attack.
    """
    unused_rng = np.random.default_rng(0)

    def acts(time_ns: int) -> bool:
        rng = unused_rng
        if spec.schedule.kind == "random":
            rng = named_generator(seed, "attack", spec.type, spec.seed_name, "schedule", time_ns)
        return spec.schedule.active((time_ns - start_ns) / NS_PER_S, rng)

    return acts


def acting_on_fixes(spec: AttackSpec, victim: str, start_ns: int, seed: int) -> Acting:
    """The times at which an attack on a GNSS receiver acts; to be called once for each genuine fix, in order.

    victim: the name of the receiver's vehicle; start_ns: the time of the bag's first message; seed: of the
    attack.
    """
    rng = named_generator(seed, "attack", spec.type, spec.seed_name, victim, "schedule")
    return lambda time_ns: spec.schedule.active((time_ns - start_ns) / NS_PER_S, rng)


def drawn_parts(
    parts: Sequence[str], attackers: Sequence[int], seed: int, attack: str, seed_name: str
) -> dict[int, str]:
    """Draw which part of a mix of attacks each attacker carries out.

    parts: names of attacks. attackers: station ids. Returns the part of each attacker.
    """
    rngs = {one: named_generator(seed, "attack", attack, seed_name, "mix", one) for one in attackers}
    return {one: parts[int(rng.integers(len(parts)))] for one, rng in rngs.items()}
