"""The attacks by the word that names them on the command line and in scenario files."""

from __future__ import annotations

import hashlib
import importlib
import inspect
import os
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

from advpipe.pipeline.core.errors import UsageError

_HERE = "advpipe.stages.attack"

ATTACKS: dict[str, str] = {
    "attach": "lidar.attach:Attach",
    "detach": "lidar.detach:Detach",
    "perturb": "lidar.perturb:Perturb",
    "gnss-bias": "gnss.bias:Bias",
    "gnss-relocate": "gnss.relocate:Relocate",
    "gnss-drift": "gnss.drift:Drift",
    "gnss-drift-aware": "gnss.drift_aware:DriftAware",
    "gnss-jump": "gnss.jump:Jump",
    "gnss-walk": "gnss.walk:Walk",
    "gnss-replay": "gnss.replay:Replay",
    "gnss-freeze": "gnss.freeze:Freeze",
    "gnss-jam": "gnss.jam:Jam",
    "cam-position-constant": "v2x.position:PositionConstant",
    "cam-position-offset": "v2x.position:PositionOffset",
    "cam-position-random": "v2x.position:PositionRandom",
    "cam-position-random-offset": "v2x.position:PositionRandomOffset",
    "cam-position-mirrored": "v2x.position:PositionMirrored",
    "cam-speed-constant": "v2x.speed:SpeedConstant",
    "cam-speed-offset": "v2x.speed:SpeedOffset",
    "cam-speed-random": "v2x.speed:SpeedRandom",
    "cam-speed-random-offset": "v2x.speed:SpeedRandomOffset",
    "cam-speed-frozen": "v2x.speed:SpeedFrozen",
    "cam-heading-reversed": "v2x.heading:HeadingReversed",
    "cam-heading-rotating": "v2x.heading:HeadingRotating",
    "cam-acceleration": "v2x.acceleration:Acceleration",
    "cam-feigned-braking": "v2x.acceleration:FeignedBraking",
    "cam-dimensions": "v2x.dimensions:Dimensions",
    "cam-out-of-range": "v2x.out_of_range:OutOfRange",
    "cam-eventual-stop": "v2x.stop:EventualStop",
    "cam-sudden-stop": "v2x.stop:SuddenStop",
    "cam-mix": "v2x.mix:Mix",
    "cam-replay": "v2x.replay:Replay",
    "cam-disruptive-replay": "v2x.replay:DisruptiveReplay",
    "cam-stale": "v2x.delay:Stale",
    "cam-delay": "v2x.delay:Delay",
    "cam-drop": "v2x.drop:Drop",
    "cam-masquerade": "v2x.masquerade:Masquerade",
    "cam-dos": "v2x.flood:Dos",
    "cam-dos-random": "v2x.flood:DosRandom",
    "cam-dos-disruptive": "v2x.flood:DosDisruptive",
    "cam-dos-random-sybil": "v2x.flood:DosRandomSybil",
    "cam-dos-disruptive-sybil": "v2x.flood:DosDisruptiveSybil",
    "cam-sybil-grid": "v2x.sybil:SybilGrid",
    "cam-sybil-replay": "v2x.sybil:SybilReplay",
    "cam-sybil-congestion": "v2x.sybil:SybilCongestion",
    "cam-ghost-stop": "v2x.ghosts:GhostStop",
    "cam-ghost-brake": "v2x.ghosts:GhostBrake",
}
"""Word to module and class; a user's own LiDAR attack is named by `module:Class` itself."""


def find_attack(word: str) -> Callable[..., Any]:
    """The class of a word, or of `module:Class`; raises `AdvpipeError` with the known words for any other."""
    if word in ATTACKS:
        module, _, name = ATTACKS[word].partition(":")
        found: Callable[..., Any] = getattr(importlib.import_module(f"{_HERE}.{module}"), name)
        return found
    module, colon, name = word.partition(":")
    if colon:
        return _users_class(module, name)
    raise UsageError(f"unknown attack {word!r}; known: {', '.join(ATTACKS)}, or module:Class of your own")


def source_sha256(word: str) -> str:
    """SHA-256 of the file that a user's own attack lies in; "" for ours, which their version tells apart."""
    if word in ATTACKS:
        return ""
    try:
        source = inspect.getsourcefile(find_attack(word))
    except TypeError:  # made by a program or in another language
        return ""
    return hashlib.sha256(Path(source).read_bytes()).hexdigest() if source else ""


def _users_class(module: str, name: str) -> Callable[..., Any]:
    # A program that was installed does not look into the working directory, where the user's file lies.
    if os.getcwd() not in sys.path:
        sys.path.insert(0, os.getcwd())
    try:
        found = getattr(importlib.import_module(module), name)
    except (Exception, SystemExit) as error:  # a user's module may do anything
        kind = "" if isinstance(error, ImportError | AttributeError) else f"{type(error).__name__}: "
        raise UsageError(f"cannot load attack {module}:{name}: {kind}{error}") from None
    if not callable(found):
        raise UsageError(f"{module}:{name} is no class; an attack is a class whose instances are called")
    made: Callable[..., Any] = found
    return made
