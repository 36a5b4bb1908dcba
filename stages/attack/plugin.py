"""Attacks of a user's own, named `module:Class`."""

from __future__ import annotations

import hashlib
import inspect
from pathlib import Path

from advpipe.pipeline.core.errors import UsageError
from advpipe.pipeline.core.implementation import import_object
from advpipe.stages.attack.base import Attack, refuse_undeclared

BASES = "LidarAttack, V2xAttack or GnssAttack (stages/attack/lidar, v2x, gnss: base.py)"


def plugin_attack(word: str) -> type[Attack]:
    """The class; raises AdvpipeError, one line, for a module that cannot be loaded, and for what is no attack
    of any family or does not declare what its base asks for."""
    found: type[Attack] = import_object(word, f"cannot load attack {word}")
    if not inspect.isclass(found):
        raise UsageError(f"{word} is no class; an attack is a class that inherits from {BASES}")
    if not issubclass(found, Attack) or not hasattr(found, "family"):
        raise UsageError(f"{word} is no attack of any family; let it inherit from {BASES}")
    refuse_undeclared(found)
    return found


def source_sha256(kind: type[Attack]) -> str:
    """SHA-256 of the file that a user's own attack lies in; "" for ours, which their version tells apart."""
    if kind.__module__.startswith("advpipe."):
        return ""
    try:
        source = inspect.getsourcefile(kind)
    except TypeError:  # made by a program or in another language
        return ""
    return hashlib.sha256(Path(source).read_bytes()).hexdigest() if source else ""
