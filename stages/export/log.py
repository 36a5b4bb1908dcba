"""A log of beacons as it was before it was imported: every file, record by record."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path, PurePosixPath
from typing import Any, NamedTuple

from advpipe.pipeline.bag.reader import BagReader
from advpipe.pipeline.bag.recorded_source import read_source
from advpipe.pipeline.core.errors import AdvpipeError, UsageError
from advpipe.pipeline.core.partial import FolderKind, staged_folder
from advpipe.pipeline.core.plain_json import load_json
from advpipe.pipeline.dataset.layout import EXPORT_MARK
from advpipe.pipeline.messages.topics import BEACONS

_KIND = FolderKind("log export", (EXPORT_MARK,), (EXPORT_MARK,))


class ExportedLog(NamedTuple):
    """The folder, and how many files and records it has."""

    folder: Path
    files: int
    records: int


def holds_log(bag: Path) -> bool:
    """Whether a bag was imported from a log of beacons."""
    return BEACONS.name in BagReader(bag).topics


def export_log(bag: Path, out: Path, *, overwrite: bool = False) -> ExportedLog:
    """Write the log that a bag was imported from as the folder `out`.

    VeReMi's lines have their bytes; NextGen's records their keys and values, in lists of JSON. Attackers
    whose own records were not imported have an empty file, whose name says what they do. Raises UsageError
    for a bag without a log, AdvpipeError for one that lacks records.
    """
    if not holds_log(bag):
        raise UsageError(f"{bag} was not imported from a log of beacons: it has no {BEACONS.name}")
    records = sorted(_records(bag))
    source = read_source(bag)
    attackers = () if source is None else source.attacker_files
    files: dict[str, list[str]] = {_checked_name(bag, name): [] for name in attackers}
    for name, place, text in records:
        lines = files.setdefault(name, [])
        if place != len(lines):
            raise AdvpipeError(f"{bag} lacks record {len(lines) + 1} of {name}; export the attacked bag")
        lines.append(text)
    with staged_folder(out, overwrite, _KIND) as folder:
        for name, lines in files.items():
            (folder / name).write_text(_content(name, lines), encoding="utf-8")
        (folder / EXPORT_MARK).write_text('{"form": "log"}\n', encoding="utf-8")
    return ExportedLog(out, len(files), len(records))


def _records(bag: Path) -> Iterator[tuple[str, int, str]]:
    for _, message in BagReader(bag).messages(BEACONS.name):
        yield _checked_name(bag, message.file), int(message.place), message.text


def _checked_name(bag: Path, name: str) -> str:
    """The name of a file in the export's folder. Raises AdvpipeError for one that leads elsewhere."""
    if PurePosixPath(name).name != name or name in ("", ".", "..", EXPORT_MARK):
        raise AdvpipeError(f"{bag}: {BEACONS.name} names the file {name[:40]!r}; import it again")
    return name


def _content(name: str, lines: list[str]) -> str:
    """Lines of VeReMi; NextGen's files hold one list."""
    if name.startswith(("JSONlog-", "GroundTruthJSONlog", "traceJSON-", "traceGroundTruthJSON")):
        return "".join(f"{line}\n" for line in lines)
    values: list[Any] = [load_json(line) for line in lines]
    return json.dumps(values, indent=4, ensure_ascii=False)
