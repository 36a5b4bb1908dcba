"""Imports a drive of another data set: its frames, checked one by one, become a clean bag."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass, fields
from itertools import islice
from pathlib import Path
from typing import Any

import yaml

from advpipe.pipeline.bag.provenance import imported_provenance
from advpipe.pipeline.bag.reader import BagReader
from advpipe.pipeline.bag.recorded_source import RecordedSource
from advpipe.pipeline.bag.summary import BagSummary
from advpipe.pipeline.bag.writer import BagWriter
from advpipe.pipeline.core.code import code_sha256
from advpipe.pipeline.core.errors import AdvpipeError, OutputExistsError, as_usage_error
from advpipe.pipeline.core.frame_slice import FrameSlice
from advpipe.pipeline.core.job_folder import job_folder
from advpipe.pipeline.core.licence import licence_line
from advpipe.pipeline.core.option_names import option_name
from advpipe.pipeline.core.partial import FolderKind, finish_moves, remove_output, staged_folder
from advpipe.pipeline.core.progress import plan_progress, track
from advpipe.pipeline.core.tabular import Rows
from advpipe.pipeline.core.text import counted, escape_unprintable
from advpipe.pipeline.dataset.layout import SOURCE_NAME
from advpipe.pipeline.mcap.channel import StampedCdr
from advpipe.pipeline.viewer_layouts.files import write_layouts
from advpipe.stages.import_.checks import DriveChecks
from advpipe.stages.import_.counts import FrameCounts, PartSummary, cloud_sizes, read_part_summary
from advpipe.stages.import_.drive import DriveFrame, DriveSource, FingerprintedSource, LicensedSource
from advpipe.stages.import_.form import DriveForm
from advpipe.stages.import_.options import ImportOptions, ImportRequest
from advpipe.stages.import_.own_export import exported_options, read_exported_source
from advpipe.stages.import_.record import frame_messages, static_messages
from advpipe.stages.import_.refusals import refuse_export_folder, refuse_unknown_classes
from advpipe.stages.import_.registry import find_form
from advpipe.stages.import_.sparse import CloudSize, sparse_clouds

IMPORTED = FolderKind("data set", (SOURCE_NAME, "clean"), (SOURCE_NAME, "clean/metadata.yaml"))

PART_FRAMES = 20
"""Frames that a killed import has to read again at most."""


@dataclass(frozen=True, repr=False)
class ImportSummary(BagSummary):
    """What was imported. licence: of the source, None if it was not stated. notes: sentences."""

    form: str
    frames: int
    counts: FrameCounts
    licence: str | None
    notes: tuple[str, ...] = ()

    def __str__(self) -> str:
        about = f"{self.bag}: {counted(self.frames, 'frame')}, {self.counts}"
        return "\n".join([about, licence_line(self.licence), *self.notes])

    def to_dicts(self) -> Rows:
        """One row: the bag and its counts."""
        about = {"bag": str(self.bag), "form": self.form, "frames": self.frames}
        return [{**about, **asdict(self.counts), "licence": self.licence}]


def import_drive(request: ImportRequest, out: Path, *, overwrite: bool = False) -> ImportSummary:
    """Import a drive as the data set folder `out`: source.yaml and clean/.

    Finished parts are kept in a hidden folder until the whole is done, so that a killed run resumes. Raises
    AdvpipeError, one line, for a source that is not of the form, is damaged, or holds what cannot be right.
    """
    finish_moves(out, out)
    if out.exists() and not overwrite:
        raise OutputExistsError(out)
    form = find_form(request.form)
    request.options.refuse_others(request.form, form.takes)
    refuse_export_folder(request.source)
    with as_usage_error():
        source = form.open(request.source, request.options)
        indices = FrameSlice.parse(request.options.frames).indices(source.frame_count)
        refuse_unknown_classes(form, source, request)
        exported = read_exported_source(request.source)
        if exported is not None:
            source = form.open(request.source, exported_options(form, source, request.options, exported))
    published = exported or (source if isinstance(source, LicensedSource) else form)
    description = _description(request, source, published)
    checks = DriveChecks(source.are_related)
    plan_progress({f"importing {source.name}": 9, "writing the bag": 3})
    with (
        job_folder(out, _signature(request, source), results="[0-9]*") as job,
        staged_folder(out, overwrite, IMPORTED) as folder,
    ):
        parts = list(_parts(source, indices, job, checks))
        summaries = [read_part_summary(part) for part in parts]
        counts = sum((each.counts for each in summaries), FrameCounts())
        description["labels"] = counts.labels
        text = yaml.safe_dump(description, sort_keys=False, allow_unicode=True)
        (folder / SOURCE_NAME).write_text(text, encoding="utf-8")
        provenance = imported_provenance(description["name"], text)
        with BagWriter(folder / "clean", provenance=provenance, finish=write_layouts) as writer:
            for message in _joined(parts, source):
                writer.write_cdr(*message)
    sparse = sparse_clouds(size for each in summaries for size in each.sizes)
    licence = form.licence if exported is None else None
    notes = (*_licence_note(request, licence), *source.notes, *checks.warnings, *sparse)
    return ImportSummary(out / "clean", request.form, len(indices), counts, description["licence"], notes)


def _parts(source: DriveSource, indices: range, job: Path, checks: DriveChecks) -> Iterator[Path]:
    """The chosen frames in bags of `PART_FRAMES`; those that an earlier run finished are not read again."""
    starts = range(0, len(indices), PART_FRAMES)
    folders = [job / f"{start:08d}-{min(start + PART_FRAMES, len(indices)):08d}" for start in starts]
    done = next((k for k, part in enumerate(folders) if not _is_whole(part)), len(folders))
    for part in folders[done:]:  # after one that a power failure damaged
        remove_output(part)
    yield from folders[:done]
    if done:
        checks.warnings.extend(read_part_summary(folders[done - 1]).warnings)
    if done == len(folders):
        return
    before = starts[done] - 1  # the last frame that is done tells the checks where the vehicle was
    frames = _chosen(source, indices[max(before, 0) :])
    for frame in islice(frames, 1 if before >= 0 else 0):
        checks.check(frame)
        last = read_part_summary(folders[done - 1])  # which has counted that frame
        checks.near_boxes, checks.hit_boxes = last.near_boxes, last.hit_boxes
    chosen = track(frames, f"importing {source.name}", len(indices) - starts[done])
    for start, part in zip(starts[done:], folders[done:], strict=True):
        expected = min(PART_FRAMES, len(indices) - start)
        with BagWriter(part, provenance={"kind": "part"}, compression="lz4") as writer:
            counts, read = FrameCounts(), 0
            sizes: list[CloudSize] = []
            for frame in islice(chosen, expected):
                checks.check(frame)
                read += 1
                counts += FrameCounts.of(frame)
                sizes += cloud_sizes(frame)
                for message in frame_messages(frame):
                    writer.write_cdr(*message)
            if read < expected:
                raise AdvpipeError(
                    f"{source.name} ends after {start + read} of {len(indices)} frames; it is truncated, or "
                    "changes while it is read"
                )
            if start + read == len(indices):
                checks.finish()
            PartSummary(
                counts=counts,
                sizes=tuple(sizes),
                warnings=tuple(checks.warnings),
                near_boxes=checks.near_boxes,
                hit_boxes=checks.hit_boxes,
            ).write(writer.folder)
        yield part


def _is_whole(part: Path) -> bool:
    """Whether a part is there and can be read."""
    try:
        return part.is_dir() and bool(read_part_summary(part)) and bool(BagReader(part).topics)
    except AdvpipeError:
        return False


def _signature(request: ImportRequest, source: DriveSource) -> str:
    """What decides the parts: the request, whether the source is the one that was read before, the code."""
    fingerprint = source.fingerprint if isinstance(source, FingerprintedSource) else ""
    return f"{request} {source.frame_count} {PART_FRAMES} {fingerprint} {code_sha256('stages/import_')}"


def _chosen(source: DriveSource, indices: range) -> Iterator[DriveFrame]:
    """The frames at these indices."""
    frames = source.frames(indices[0])
    for number, frame in enumerate(frames, indices[0]):
        if number in indices:
            yield frame
        if number >= indices[-1]:
            return


def _joined(parts: Sequence[Path], source: DriveSource) -> Iterator[StampedCdr]:
    """The messages of all parts in time order, after those that are recorded once."""
    is_first = True
    for part in track(parts, "writing the bag"):
        try:
            for raw in BagReader(part).raw_messages():
                if is_first:
                    yield from static_messages(raw.log_time_ns, source.static_transforms)
                    is_first = False
                yield raw.topic, raw.cdr, raw.log_time_ns
        except AdvpipeError as error:
            remove_output(part)  # or every further run would end here
            raise AdvpipeError(f"{error}; run the same import again, which reads these frames anew") from None


def _licence_note(request: ImportRequest, licence: str | None) -> Iterator[str]:
    """Where nobody stated a licence, whose it is: an export of another drive is not the form's own data."""
    if licence is not None and request.options.licence is None:
        yield (
            f"The licence is that of the data published as {request.form}; for other data in this form give "
            f"{option_name('licence')}."
        )


def _description(
    request: ImportRequest, source: DriveSource, published: LicensedSource | RecordedSource | DriveForm
) -> dict[str, Any]:
    """What source.yaml and the provenance say: the form, the source's name, its licence, and the options."""
    default, given = ImportOptions(), request.options
    changed = {
        each.name: value
        for each in fields(ImportOptions)
        if (value := getattr(given, each.name)) != getattr(default, each.name)
    }
    return {
        "form": request.form,
        "name": escape_unprintable(source.name),
        "source": escape_unprintable(request.source.resolve().name),
        "licence": given.licence or published.licence,
        "citation": published.citation,
        "notes": list(source.notes),
        "options": {name: value for name, value in changed.items() if name != "licence"},
    }
