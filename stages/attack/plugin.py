"""A user's attacks, named `module:Class`."""

from __future__ import annotations

import hashlib
import inspect
from pathlib import Path

from advpipe.pipeline.core.errors import UsageError
from advpipe.pipeline.core.implementation import import_object
from advpipe.stages.attack.base import Attack, refuse_undeclared

BASES = (
    "LidarAttack, V2xAttack, GnssAttack, RadarAttack or CameraAttack "
    "(stages/attack/lidar, v2x, gnss, radar, camera: base.py)"
)


def plugin_attack(name: str) -> type[Attack]:
    """The class. Raises AdvpipeError, one line, for a module that cannot be loaded, and for a class that is
    not an attack or does not declare what its base requires."""
    found: type[Attack] = import_object(name, f"cannot load attack {name}")
    if not inspect.isclass(found):
        raise UsageError(f"{name} is not a class; an attack is a class that inherits from {BASES}")
    if not issubclass(found, Attack) or not hasattr(found, "family"):
        raise UsageError(f"{name} is not an attack; let it inherit from {BASES}")
    refuse_undeclared(found)
    return found


def source_sha256(attack_class: type[Attack]) -> str:
    """SHA-256 of the source file of a user's attack; "" for ours, which the version identifies."""
    if attack_class.__module__.startswith("advpipe."):
        return ""
    try:
        source = inspect.getsourcefile(attack_class)
    except TypeError:  # made by a program or in another language
        return ""
    return hashlib.sha256(Path(source).read_bytes()).hexdigest() if source else ""
