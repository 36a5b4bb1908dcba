"""Which attack each attacker of a `cam-mix` carries out."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from advpipe.pipeline.core.seeding import named_generator

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


def words_of(attacks: str) -> list[str]:
    """The words that a mix draws from: `attacks` names mixes and words, with commas between them."""
    return [word for name in _names(attacks) for word in MIXES.get(name, (name,))]


def settings_of(attacks: str) -> dict[str, dict[str, Any]]:
    """By word, what is not the default."""
    return {word: given for name in _names(attacks) for word, given in SETTINGS.get(name, {}).items()}


def drawn(attacks: str, attackers: Sequence[int], seed: int, seed_name: str) -> dict[int, str]:
    """By attacker, a station id, the word that it draws."""
    words = words_of(attacks)
    rngs = {one: named_generator(seed, "attack", WORD, seed_name, "mix", one) for one in attackers}
    return {one: words[int(rng.integers(len(words)))] for one, rng in rngs.items()}


def _names(attacks: str) -> list[str]:
    return [name.strip() for name in attacks.split(",")]
