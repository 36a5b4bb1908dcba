"""Exports a data set's clean bag and its adversarial versions, or one bag."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

from advpipe.pipeline.bag.locate import CLEAN_NAME, adversarial_bags, resolve_bag
from advpipe.pipeline.bag.reader import BagReader
from advpipe.pipeline.core.errors import UsageError, as_usage_error
from advpipe.pipeline.core.nearest import known_names
from advpipe.pipeline.core.partial import FolderKind, staged_folder
from advpipe.pipeline.dataset.layout import EXPORT_MARK, SOURCE_NAME, is_dataset
from advpipe.stages.export.form import ExportOptions, ExportSummary
from advpipe.stages.export.registry import EXPORT_FORMS

_SOURCE_NOTE = f"The drive was imported: {SOURCE_NAME} says from where, and under which licence."


def bags_to_export(path: Path) -> Mapping[str, Path]:
    """A data set's clean bag and its adversarial ones by name; another path's bag alone."""
    with as_usage_error():
        bag = resolve_bag(path)
    if not is_dataset(path):
        return {bag.stem if bag.is_file() else bag.name: bag}
    return {CLEAN_NAME: bag, **{each.name: each for each in adversarial_bags(path)}}


def export_bags(
    path: Path, form: str, out: Path, options: ExportOptions | None = None, *, overwrite: bool = False
) -> ExportSummary:
    """Write a data set or a bag in a form as the folder `out`. Raises UsageError for an unknown form."""
    if form not in EXPORT_FORMS:
        raise UsageError(f"unknown format {form!r}; {known_names(form, EXPORT_FORMS)}")
    bags = bags_to_export(path)
    with staged_folder(out, overwrite, FolderKind("export", (EXPORT_MARK,), (EXPORT_MARK,))) as folder:
        summary = EXPORT_FORMS[form].write(bags, folder, options or ExportOptions())
        (folder / EXPORT_MARK).write_text(f'{{"form": "{form}"}}\n', encoding="utf-8")
        if source := BagReader(bags[next(iter(bags))]).provenance.fields.source:
            (folder / SOURCE_NAME).write_text(source, encoding="utf-8")
            summary = replace(summary, notes=(*summary.notes, _SOURCE_NOTE))
    return replace(summary, folder=out)
