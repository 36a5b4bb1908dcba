"""Image detectors by name: the shipped one, a checkpoint file, or a user's class."""

from __future__ import annotations

import inspect
from pathlib import Path

from advpipe.pipeline.core.errors import UsageError
from advpipe.pipeline.core.hashing import sha256_of
from advpipe.pipeline.core.implementation import import_object
from advpipe.pipeline.core.nearest import known_names
from advpipe.pipeline.core.short_repr import short_repr
from advpipe.pipeline.core.verbosity import detail
from advpipe.pipeline.detector.device import CPU, open_device
from advpipe.pipeline.geometry.boxes import CLASSES
from advpipe.pipeline.image_detector.protocol import DifferentiableImageDetector, ImageDetector

SHIPPED = {"small": Path(__file__).parent / "checkpoints" / "small.safetensors"}


def image_detector_named(name_or_path: str, device: str = CPU) -> ImageDetector:
    """The image detector `small`, the one in `FILE.safetensors`, or an instance of `module:Class`.

    device: where ours computes, see `open_device`. A user's class is called without arguments; it has to
    implement `ImageDetector`. Raises UsageError for an unknown name, a file that is not a checkpoint, and a
    class that is not a detector.
    """
    place = open_device(device)
    detail(f"loading image detector {name_or_path} on {device}")
    if name_or_path in SHIPPED or name_or_path.endswith(".safetensors"):
        from advpipe.pipeline.image_detector.checkpoint import load_image_checkpoint

        return load_image_checkpoint(SHIPPED.get(name_or_path, Path(name_or_path)), place)
    if ":" in name_or_path:
        return _from_class(name_or_path)
    raise UsageError(
        f"unknown image detector {short_repr(name_or_path)}; {known_names(name_or_path, SHIPPED)} "
        "(or a path to FILE.safetensors, or module:Class)"
    )


def differentiable_image_detector(name_or_path: str, device: str = CPU) -> DifferentiableImageDetector:
    """The same, for attacks. Raises UsageError, too, for a detector without `objectness`."""
    made = image_detector_named(name_or_path, device)
    if not isinstance(made, DifferentiableImageDetector):
        raise UsageError(f"image detector {name_or_path} has no objectness, which attacks differentiate")
    return made


def image_detector_sha256(name_or_path: str) -> str:
    """The identity of an image detector: SHA-256 of its checkpoint, or of the source file of its class.

    "" for a class without a source file. Raises UsageError for a class that cannot be imported.
    """
    file: Path | None = SHIPPED.get(name_or_path, Path(name_or_path))
    if file is not None and not file.is_file():
        try:
            source = inspect.getsourcefile(_class_named(name_or_path))
        except (TypeError, OSError):  # generated at run time, or written in another language
            return ""
        file = Path(source) if source else None
    return sha256_of(file) if file else ""


def _class_named(name: str) -> type:
    found: type = import_object(name, f"cannot load image detector {name}")
    return found


def _from_class(name: str) -> ImageDetector:
    found = _class_named(name)
    try:
        made = found()
    except (Exception, SystemExit) as error:  # a user's class may raise anything
        raise UsageError(f"cannot load image detector {name}: {type(error).__name__}: {error}") from None
    if not isinstance(made, ImageDetector):
        raise UsageError(f"{name} is not an image detector: it needs classes and detect")
    if not made.classes or not set(made.classes) <= set(CLASSES):
        raise UsageError(
            f"{name} has the classes {tuple(made.classes)}; each must be one of {', '.join(CLASSES)}"
        )
    return made
