"""Make a data set ready to publish: everything that others need to use and to verify it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from advpipe.pipeline.bag.files import mcap_files
from advpipe.pipeline.bag.provenance import parent_sha256
from advpipe.pipeline.bag.recorded_source import read_source
from advpipe.pipeline.core.errors import UsageError
from advpipe.pipeline.core.hashing import sha256_of
from advpipe.pipeline.core.progress import plan_progress, track, working_on
from advpipe.pipeline.core.remote_path import RemotePath, located, refuse_remote
from advpipe.pipeline.core.scratch import scratch_folder
from advpipe.pipeline.dataset import checksums, layout, signature
from advpipe.pipeline.dataset.archive import pack, refuse_existing_archive
from advpipe.pipeline.dataset.download import local_copy
from advpipe.pipeline.dataset.lay_out import refuse_folder, write_folder
from advpipe.pipeline.dataset.layout import Layout, read_layout
from advpipe.pipeline.dataset.upload import upload
from advpipe.stages.share import names
from advpipe.stages.share.additions import write_additions
from advpipe.stages.share.chain import check_chain
from advpipe.stages.share.facts import read_facts
from advpipe.stages.share.options import DEFAULT_OPTIONS, ShareOptions
from advpipe.stages.share.source import source_warnings, with_source
from advpipe.stages.share.warnings import sharing_warnings

__all__ = ["ShareOptions", "ShareSummary", "share"]

DESCRIBING, DRAWING = "describing the bags", "card and pictures"

_OTHER_ARCHIVES = (".gz", ".tgz", ".zip", ".xz", ".bz2", ".zst", ".7z")


@dataclass(frozen=True)
class ShareSummary:
    """made: the folder, or the archive's files. warnings: for the data set's users, or for its author to
    fix."""

    made: tuple[Path, ...]
    files: int
    bytes: int
    warnings: tuple[str, ...]


def share(dataset: Path, out: Path, options: ShareOptions = DEFAULT_OPTIONS) -> ShareSummary:
    """Make a folder, here or in an object store, or for a name in .tar an archive, with a data set and its
    documentation.

    To the unchanged bags, reports and scenario, it adds a card (README.md), pictures, layouts for Foxglove
    and RViz, specifications for bag checkers, and SHA256SUMS, signed if `options.sign` names a key. The data
    set itself is not changed. Hidden files, such as those of killed runs, are not copied.

    Raises AdvpipeError for an invalid data set, one that a run is writing to, an adversarial bag with another
    parent, a damaged bag, an unusable key, and an existing output. A data set in an object store is copied to
    the folder for temporary files, since every byte of it is read several times.
    """
    _refuse_within(located(dataset), located(out))
    with local_copy(dataset) as copy:
        return _share(copy, located(out), options)


def _share(dataset: Path, out: Path, options: ShareOptions) -> ShareSummary:
    found = read_layout(dataset)
    found.refuse_running()
    _refuse_outputs(found, out, options)
    if options.sign is not None:
        signature.load_private_key(options.sign)
    plan_progress({f"reading {dataset}": 2, DESCRIBING: 10, DRAWING: 4, "writing": 4})
    files = _own_files(found)
    source = read_source(found.clean)
    source_notes = tuple(source_warnings(source))
    options = with_source(options, source)
    sums = {name: sha256_of(path) for name, path in track(files.items(), f"reading {dataset}", len(files))}
    sha256_of_bags = {bag.name: _sha256(bag, found, sums) for bag in found.bags}
    unchecked = check_chain(found, sha256_of_bags)
    bags = [read_facts(bag) for bag in track(found.bags, DESCRIBING)]
    if not bags[0].topics:
        raise UsageError(f"{found.clean} holds no messages")
    warnings = (*unchecked, *source_notes, *sharing_warnings(found, bags, options))
    name = out.stem if _is_archive(out) else out.resolve().name
    with scratch_folder() as made:
        with working_on(DRAWING):
            write_additions(made, name, found, bags, sums, sha256_of_bags, options, warnings)
        sums |= {added: sha256_of(made / added) for added in layout.files(made)}
        _write_sums(made, sums, options)
        files |= {added: made / added for added in layout.files(made)}
        size_bytes = sum(path.stat().st_size for path in files.values())
        with working_on("writing"):
            if _is_archive(out):
                outputs = tuple(pack(files, out, options.split_size_bytes, overwrite=options.overwrite))
            elif isinstance(out, RemotePath):
                upload(files, out, overwrite=options.overwrite)
                outputs = (out,)
            else:
                write_folder(files, out, overwrite=options.overwrite)
                outputs = (out,)
    left = [
        f"{leftover.path.relative_to(dataset)} was left by a killed run and is not shared; "
        "`advpipe clean` shows whether it is still needed"
        for leftover in found.leftovers
    ]
    return ShareSummary(outputs, len(files), size_bytes, (*warnings, *left))


def _is_archive(out: Path) -> bool:
    return out.suffix == ".tar"


def _refuse_within(dataset: Path, out: Path) -> None:
    source, target = dataset.resolve(), out.resolve()
    if target == source or target in source.parents or source in target.parents:
        raise UsageError(f"{out} is, contains or is inside the data set {dataset}; choose another output")


def _refuse_outputs(found: Layout, out: Path, options: ShareOptions) -> None:
    target = out.resolve()
    if out.suffix in _OTHER_ARCHIVES:
        raise UsageError(
            f"{out}: an archive is a plain .tar, as bags are already compressed; end the output's "
            "name in .tar"
        )
    if options.split_size_bytes is not None and not _is_archive(out):
        raise UsageError(f"only an archive can be split: end the output's name in .tar, as in {out.name}.tar")
    if not layout.is_portable(target.name):
        raise UsageError(
            f"{str(out)!r}: a name with characters that not every system supports; choose another"
        )
    if _is_archive(out):
        refuse_remote(out, "leave out .tar to upload a folder")
        refuse_existing_archive(out, options.overwrite)
    elif isinstance(out, RemotePath):
        pass  # `upload` refuses one that is whole
    elif out.exists():
        refuse_folder(out, overwrite=options.overwrite)
    for name in names.FOLDERS:
        if (found.folder / name).exists() and not _was_shared(found):
            raise UsageError(f"{found.folder / name} has a name that shared data sets reserve; rename it")


def _was_shared(found: Layout) -> bool:
    """Whether sharing made this data set; it can then be shared again."""
    return found.card is not None and names.CARD_MARK in found.card.read_text("utf-8", "replace")


def _own_files(found: Layout) -> dict[str, Path]:
    """All files except hidden ones and those that an earlier sharing added."""
    return {
        name: found.folder / name
        for name in layout.files(found.folder)
        if not names.is_made(name) and not layout.is_hidden(name)
    }


def _sha256(bag: Path, found: Layout, sums: Mapping[str, str]) -> str:
    """A bag's `parent_sha256`; for a bag of one file, it is among the checksums."""
    of_bag: Sequence[Path] = mcap_files(bag)
    if len(of_bag) == 1:
        return sums[of_bag[0].relative_to(found.folder).as_posix()]
    return parent_sha256(bag)


def _write_sums(made: Path, sums: dict[str, str], options: ShareOptions) -> None:
    if options.sign is not None:
        key = signature.load_private_key(options.sign)
        (made / signature.KEY_FILE).write_bytes(signature.public_pem(key))
        sums[signature.KEY_FILE] = sha256_of(made / signature.KEY_FILE)
    (made / checksums.FILE).write_bytes(checksums.to_text(sums).encode())
    if options.sign is not None:
        signature.sign_folder(made, options.sign)
