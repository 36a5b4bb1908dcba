"""What an import refuses before it reads a frame, whatever the form."""

from __future__ import annotations

from pathlib import Path

from advpipe.pipeline.core.errors import UsageError
from advpipe.pipeline.core.nearest import suggestion
from advpipe.pipeline.core.option_names import option_name
from advpipe.pipeline.core.text import escape_unprintable
from advpipe.pipeline.dataset.layout import EXPORT_MARK
from advpipe.stages.import_.drive import ClassifiedSource, DriveSource
from advpipe.stages.import_.form import DriveForm
from advpipe.stages.import_.options import ImportRequest

_CONFIGURATIONS = ("openpcdet", "mmdet3d")
"""Folders of an export that hold no data."""


def refuse_export_folder(source: Path) -> None:
    """Raises UsageError for the top folder of an export, which holds a folder a bag."""
    if not (source / EXPORT_MARK).is_file():
        return
    folders = sorted(each.name for each in source.iterdir() if each.is_dir())
    if bags := [name for name in folders if name not in _CONFIGURATIONS]:
        names = escape_unprintable(", ".join(bags))
        raise UsageError(f"{source} is an export of advpipe with a folder a bag; give one of them: {names}")


def refuse_unknown_classes(form: DriveForm, source: DriveSource, request: ImportRequest) -> None:
    """Raises UsageError for a class that is to be mapped and that neither the form nor the source has."""
    unknown = [name for name in request.options.classes if name not in form.classes]
    if not unknown or not isinstance(source, ClassifiedSource):
        return
    has = sorted(set(source.class_names()))
    for name in unknown:
        if name not in has:
            option = option_name("classes", f"{name}={request.options.classes[name]}")
            hint = suggestion(name, dict.fromkeys((*has, *form.classes)))
            known = escape_unprintable(f"{hint} it has {', '.join(has) or 'none'}".strip())
            raise UsageError(f"{option}: {request.source} has no class {name!r}; {known}")
