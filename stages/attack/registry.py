"""The attacks by the word that names them on the command line."""

from __future__ import annotations

from collections.abc import Callable

from advpipe.pipeline.errors import AdvpipeError
from advpipe.stages.attack.lidar.base import LidarAttack
from advpipe.stages.attack.lidar.detach import Detach

ATTACKS: dict[str, Callable[..., LidarAttack]] = {
    "detach": Detach,
}


def find_attack(word: str) -> Callable[..., LidarAttack]:
    """The attack class of a word; raises `AdvpipeError` with the known words for any other."""
    try:
        return ATTACKS[word]
    except KeyError:
        raise AdvpipeError(f"unknown attack {word!r}; known: {', '.join(ATTACKS)}") from None
