"""Detectors by name: a shipped one, a checkpoint file, or a user's class."""

from __future__ import annotations

import inspect
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

from advpipe.pipeline.core.errors import UsageError
from advpipe.pipeline.core.hashing import sha256_of
from advpipe.pipeline.core.implementation import import_object
from advpipe.pipeline.core.nearest import known_names
from advpipe.pipeline.core.short_repr import short_repr
from advpipe.pipeline.core.verbosity import detail
from advpipe.pipeline.detector.device import CPU, open_device
from advpipe.pipeline.detector.families import FAMILIES, shipped_checkpoints
from advpipe.pipeline.detector.protocol import ObjectDetector
from advpipe.pipeline.geometry.boxes import CLASSES

if TYPE_CHECKING:
    import torch


def load_detector(name_or_path: str, device: str = CPU) -> ObjectDetector:
    """The shipped detector of a name, the one in `FILE.safetensors`, or an instance of `module:Class`.

    device: where it computes, see `open_device`; clouds and tensors are passed to it on the CPU
    in any case. A class is called without arguments, or with `device` (a torch.device) if its constructor
    has that parameter; it has to implement `ObjectDetector`. Raises UsageError for an unknown name, a file
    that is not a checkpoint, a class that is not a detector, and an unknown device.
    """
    from advpipe.pipeline.detector.checkpoint import load_checkpoint
    from advpipe.pipeline.detector.common import sparse_compiled

    place = open_device(device)
    by = f"; sparse convolutions {sparse_compiled.origin()}" if place.type == CPU else ""
    detail(f"loading detector {name_or_path} on {device}{by}")
    shipped = shipped_checkpoints()
    if name_or_path in shipped:
        return load_checkpoint(shipped[name_or_path], place).detector()
    if len(members := member_names(name_or_path)) > 1:
        raise UsageError(
            f"{short_repr(name_or_path)} is an ensemble, which attacks alone take; give one detector here, "
            f"such as {short_repr(members[0])}"
        )
    if name_or_path.endswith(".safetensors"):
        return load_checkpoint(Path(name_or_path), place).detector()
    if ":" in name_or_path:
        return _load_class(name_or_path, place)
    if name_or_path in FAMILIES:
        raise UsageError(_about_family(name_or_path))
    raise UsageError(
        f"unknown detector {short_repr(name_or_path)}; {known_names(name_or_path, shipped)} "
        "(or a path to FILE.safetensors, or module:Class)"
    )


def member_names(name: str) -> list[str]:
    """The detectors of an ensemble, which commas join; a single name or an existing file as it is.

    Raises UsageError for a member that is named twice.
    """
    is_one = "," not in name or Path(name).is_file()
    members = [name] if is_one else [each.strip() for each in name.split(",")]
    if twice := [each for each in members if members.count(each) > 1]:
        raise UsageError(f"the ensemble {short_repr(name)} names {short_repr(twice[0])} twice")
    return members


def _about_family(name: str) -> str:
    """What to give instead of a family's name."""
    known = [*FAMILIES[name].shipped, f"FILE.safetensors of `advpipe train --family {name}`"]
    return f"{name} is a family of detectors; give one of its checkpoints: {', '.join(known)}"


def detector_sha256(name_or_path: str) -> str:
    """The identity of a detector: SHA-256 of its checkpoint, or of the source file of its class.

    "" for a class without a source file. Raises UsageError for a class that cannot be imported.
    """
    file: Path | None = shipped_checkpoints().get(name_or_path, Path(name_or_path))
    if file is not None and not file.is_file():
        file = _source_file(name_or_path)
    return sha256_of(file) if file else ""


def detector_slug(name_or_path: str) -> str:
    """A detector's name as a folder name: `small`, `my-model`, `package.module-Class`."""
    if name_or_path.endswith(".safetensors"):
        return Path(name_or_path).stem
    return name_or_path.replace(":", "-")


def _source_file(name: str) -> Path | None:
    try:
        source = inspect.getsourcefile(_find_class(name))
    except (TypeError, OSError):  # generated at run time, or written in another language
        return None
    return Path(source) if source else None


def _find_class(name: str) -> Callable[..., object]:
    found: Callable[..., object] = import_object(name, f"cannot load detector {name}")
    return found


def _load_class(name: str, device: torch.device) -> ObjectDetector:
    found = _find_class(name)
    try:
        made = found(device=device) if _takes_device(found) else found()
    except (Exception, SystemExit) as error:  # a user's class may raise anything
        raise UsageError(f"cannot load detector {name}: {type(error).__name__}: {error}") from None
    if not isinstance(made, ObjectDetector):
        raise UsageError(f"{name} is not a detector: it needs classes, range_m, detect and loss")
    if not made.classes or not set(made.classes) <= set(CLASSES):
        raise UsageError(
            f"{name} has the classes {tuple(made.classes)}; each must be one of {', '.join(CLASSES)}"
        )
    return made


def _takes_device(found: Callable[..., object]) -> bool:
    try:
        return "device" in inspect.signature(found).parameters
    except (TypeError, ValueError):  # written in another language, without a signature
        return False
