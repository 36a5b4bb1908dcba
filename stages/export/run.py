"""Exports a data set's clean bag and its adversarial versions, or one bag."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import replace
from pathlib import Path

from advpipe.pipeline.bag.carried import lidar_topics
from advpipe.pipeline.bag.locate import CLEAN_NAME, adversarial_bags, resolve_bag
from advpipe.pipeline.bag.reader import BagReader
from advpipe.pipeline.core.errors import UsageError, as_usage_error
from advpipe.pipeline.core.nearest import known_names
from advpipe.pipeline.core.option_names import option_name
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
    bags, options = bags_to_export(path), options or ExportOptions()
    first = bags[next(iter(bags))]
    with staged_folder(out, overwrite, FolderKind("export", (EXPORT_MARK,), (EXPORT_MARK,))) as folder:
        summary = EXPORT_FORMS[form].write(bags, folder, options)
        summary = replace(summary, notes=(*summary.notes, *_left_out(first, form, options)))
        (folder / EXPORT_MARK).write_text(f'{{"form": "{form}"}}\n', encoding="utf-8")
        if source := BagReader(first).provenance.fields.source:
            (folder / SOURCE_NAME).write_text(source, encoding="utf-8")
            summary = replace(summary, notes=(*summary.notes, _SOURCE_NOTE))
    return replace(summary, folder=out)


def _left_out(bag: Path, form: str, options: ExportOptions) -> Iterator[str]:
    """The clouds that are not written, where the user did not choose."""
    taken = EXPORT_FORMS[form].taken_topics(bag, options)
    others = [topic for topic in lidar_topics(BagReader(bag)) if topic not in taken]
    if others and options.lidar_topic is None:
        option = option_name("lidar", others[0])
        yield f"clouds of {', '.join(others)} are left out; choose another LiDAR by {option}"
