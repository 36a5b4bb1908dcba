"""What an export of advpipe says of itself when it is imported: the licence of its drive, and its classes."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

from advpipe.pipeline.bag.recorded_source import RecordedSource
from advpipe.pipeline.core.document import Document, read_text, read_yaml
from advpipe.pipeline.dataset.layout import EXPORT_MARK, SOURCE_NAME
from advpipe.stages.import_.drive import ClassifiedSource, DriveSource
from advpipe.stages.import_.form import DriveForm
from advpipe.stages.import_.options import IGNORED, ImportOptions


class ExportedOptions(Document):
    """The options of the import whose drive was exported."""

    classes: Mapping[str, str] = {}


class ExportedSource(RecordedSource):
    """The source of an exported drive; without values for one that was simulated."""

    options: ExportedOptions = ExportedOptions()


def read_exported_source(source: Path) -> ExportedSource | None:
    """What stands beside a folder of an export, `OUT/clean` or `OUT/clean/training`; None for other folders.

    Raises AdvpipeError for a damaged record.
    """
    for folder in source.resolve().parents[:2]:
        if (folder / EXPORT_MARK).is_file():
            file = folder / SOURCE_NAME
            if not file.is_file():
                return ExportedSource()
            found: ExportedSource = read_yaml(read_text(file), ExportedSource, str(file), "export again")
            return found
    return None


def exported_options(
    form: DriveForm, source: DriveSource, options: ImportOptions, exported: ExportedSource
) -> ImportOptions:
    """The options with the classes of the first import, and `IGNORED` for others that the form lacks: an
    export writes what counts neither way under the name that its source had."""
    if not isinstance(source, ClassifiedSource) or "classes" not in form.takes:
        return options
    names = set(source.class_names())
    before = {name: ours for name, ours in exported.options.classes.items() if name in names}
    # nuScenes has names such as "class/state".
    lacking = {name for name in names if not {name, name.partition("/")[0]} & set(form.classes)}
    unknown = dict.fromkeys(sorted(lacking), IGNORED)
    return replace(options, classes={**unknown, **before, **options.classes})
