"""The command that writes bags in the forms of other data sets."""

from __future__ import annotations

import shlex
from pathlib import Path
from typing import Annotated

import typer

from advpipe.pipeline.cli.completion import words_of
from advpipe.pipeline.cli.shared import Answer, LidarTopic, Overwrite, print_line, typed
from advpipe.pipeline.core.nearest import known_names
from advpipe.pipeline.core.progress import with_progress
from advpipe.pipeline.core.text import counted

V2X_FORMATS = {"veremi": "extension", "veremi-2018": "2018"}
"""The forms of VeReMi by their names on the command line."""

LOG = "log"
"""The log of beacons that a drive was imported from."""

FORMATS = ("kitti", "openpcdet", "nuscenes", "opv2v", "pcd", LOG, *V2X_FORMATS)
"""All forms; the first ones are the keys of `stages.export.registry`."""


@with_progress("exporting {bag} as {format}")
def export(
    bag: Annotated[Path, typer.Argument(help="Data set folder, bag directory or .mcap file.")],
    format: Annotated[
        str, typer.Option("--format", help=f"{', '.join(FORMATS)}.", autocompletion=words_of(FORMATS))
    ] = "veremi",
    out: Annotated[
        Path | None, typer.Option("--out", "-o", help="Folder to write.", show_default="<bag>-<format>")
    ] = None,
    lidar: LidarTopic = None,
    frames: Annotated[str, typer.Option(help="Frames of the clean bag, start:stop:step.")] = "::",
    overwrite: Overwrite = False,
) -> Answer:
    """Write bags as others read them: clouds, boxes, calibration and splits, or V2X messages.

    A data set's clean bag and its attacks come under the same names of frames. veremi: V2X messages as JSON
    of the VeReMi Extension, a file a receiver and one of ground truth; veremi-2018: of VeReMi. log: the log
    of V2X messages that the drive was imported from, as it was.
    """
    from advpipe.commands.paths import output_beside
    from advpipe.pipeline.bag.locate import bag_named
    from advpipe.pipeline.core.errors import UsageError

    if format not in FORMATS:
        raise UsageError(f"unknown format {format!r}; {known_names(format, FORMATS)}")
    if format in V2X_FORMATS:
        return _veremi(bag, format, out, overwrite)
    if format == LOG:
        return _log(bag, out, overwrite)
    from advpipe.pipeline.core.frame_slice import FrameSlice
    from advpipe.stages.export.form import ExportOptions
    from advpipe.stages.export.run import export_bags

    named = bag_named(bag)
    target = output_beside(named, f"{named.stem if named.is_file() else named.name}-{format}", out)
    options = ExportOptions(lidar, FrameSlice.parse(frames))
    summary = export_bags(bag, format, target, options, overwrite=overwrite)
    shown = str(summary).removeprefix(f"{summary.folder}: ")
    return Answer(
        summary.to_dicts()[0],
        print_line(shown),
        made={"folder": target},
        next_commands=[_what_next(target, format)],
    )


def _what_next(folder: Path, form: str) -> str:
    """A look at how others read the folder; where it does not say so, the command that reads it back."""
    from advpipe.pipeline.bag.locate import CLEAN_NAME

    readme, clean = folder / "README.md", folder / CLEAN_NAME
    if readme.is_file():
        return f"less {shlex.quote(str(readme))}"
    drive = clean if clean.is_dir() else next(path for path in sorted(folder.iterdir()) if path.is_dir())
    return typed("import", "files" if form == "pcd" else form, drive, "--out", f"{folder}-imported")


def _veremi(bag: Path, format: str, out: Path | None, overwrite: bool) -> Answer:
    from advpipe.commands.paths import output_beside
    from advpipe.pipeline.bag.locate import resolve_bag
    from advpipe.pipeline.bag.reader import BagReader
    from advpipe.pipeline.core.errors import UsageError, as_usage_error
    from advpipe.pipeline.messages.topics import SCENARIO_INFO, V2X_SENT
    from advpipe.stages.evaluate.v2x.veremi import export_veremi
    from advpipe.stages.export.log import holds_log

    with as_usage_error():
        source = resolve_bag(bag)
        if not {SCENARIO_INFO.name, V2X_SENT.name} & BagReader(source).topics.keys():
            if holds_log(source):
                raise UsageError(f"{source} was imported from a log; give --format log")
            clouds = ", ".join(FORMATS[: FORMATS.index(LOG)])
            raise UsageError(f"{source} holds no V2X messages to write as {format}; give --format: {clouds}")
    target = output_beside(source, f"{source.name if source.is_dir() else source.stem}-{format}", out)
    written = export_veremi(source, target, form=V2X_FORMATS[format], overwrite=overwrite)

    def show() -> None:
        receptions = f"{counted(written.received, 'reception')} of {counted(written.receivers, 'vehicle')}"
        print(f"{counted(written.sent, 'message')}, {receptions}")
        for attack, number in written.attacks.items():
            print(f"  attackerType {number}: {attack}")

    return Answer(
        {"folder": target, **written._asdict()},
        show,
        made={"folder": target},
        next_commands=[typed("evaluate", bag)],
    )


def _log(bag: Path, out: Path | None, overwrite: bool) -> Answer:
    from advpipe.commands.paths import output_beside
    from advpipe.pipeline.bag.locate import adversarial_bags, bag_named, resolve_bag
    from advpipe.pipeline.core.errors import as_usage_error
    from advpipe.pipeline.dataset.layout import is_dataset
    from advpipe.stages.export.log import export_log

    with as_usage_error():
        source = resolve_bag(bag)
        if is_dataset(bag) and (attacked := adversarial_bags(bag)):
            source = attacked[0]  # the clean bag lacks the false beacons
    target = output_beside(bag_named(bag), f"{bag_named(bag).name}-log", out)
    written = export_log(source, target, overwrite=overwrite)

    def show() -> None:
        print(f"{counted(written.files, 'file')}, {counted(written.records, 'record')}")

    return Answer(
        written._asdict(),
        show,
        made={"folder": written.folder},
        next_commands=[typed("evaluate", bag)],
    )
