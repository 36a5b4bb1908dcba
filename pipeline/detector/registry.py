"""Detectors by name: the shipped one, a checkpoint of yours, or your own class."""

from __future__ import annotations

import importlib
from pathlib import Path

from advpipe.pipeline.detector.protocol import Detector
from advpipe.pipeline.errors import AdvpipeError


def load_detector(name_or_path: str) -> Detector:
    """The detector `small`, the one in `FILE.safetensors`, or an instance of `module:Class`.

    A class is called without arguments and has to implement `Detector`.
    """
    from advpipe.pipeline.detector.second.checkpoint import SHIPPED, load_checkpoint

    if name_or_path in SHIPPED:
        return load_checkpoint(SHIPPED[name_or_path])
    if name_or_path.endswith(".safetensors"):
        return load_checkpoint(Path(name_or_path))
    module, colon, attribute = name_or_path.partition(":")
    if colon:
        return _load_class(module, attribute)
    known = ", ".join(SHIPPED)
    raise AdvpipeError(
        f"unknown detector {name_or_path!r}; known: {known}, a path to FILE.safetensors, or module:Class"
    )


def _load_class(module: str, attribute: str) -> Detector:
    try:
        made = getattr(importlib.import_module(module), attribute)()
    except (ImportError, AttributeError, TypeError, ValueError) as error:
        raise AdvpipeError(f"cannot load detector {module}:{attribute}: {error}") from None
    if not isinstance(made, Detector):
        raise AdvpipeError(f"{module}:{attribute} is no detector: it needs classes, range_m, detect and loss")
    return made
