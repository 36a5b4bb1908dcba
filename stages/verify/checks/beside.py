"""Whether the files next to a bag match the checksums in the bag."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from textwrap import indent

from advpipe.pipeline.bag.files import METADATA_NAME
from advpipe.pipeline.bag.writer import FILES_RECORD
from advpipe.pipeline.core.errors import AdvpipeError, os_error_line
from advpipe.pipeline.mcap.reader import McapFile
from advpipe.pipeline.viewer_layouts.files import NAMES, layout_texts
from advpipe.stages.verify.checks.base import FolderCheck
from advpipe.stages.verify.result import Fault, Result, Unchecked
from advpipe.stages.verify.subject import BagUnderTest


class FilesBeside(FolderCheck):
    """A bag contains the SHA-256 of its labels and of attack.yaml, and a copy of metadata.yaml, so that these
    files are protected without SHA256SUMS. The layouts of viewers follow from the bag."""

    def check(self) -> Iterator[Result]:
        for bag in self.subject.bags:
            try:
                yield from self._check_bag(bag)
            except AdvpipeError as error:
                yield Fault(bag.place, str(error))
            except OSError as error:
                yield Fault(bag.place, os_error_line(error))

    def _check_bag(self, bag: BagUnderTest) -> Iterator[Result]:
        if bag.path.is_file() or not bag.provenance:
            return
        records = [McapFile(file).metadata for file in bag.files]
        stated = {name: sha256 for each in records for name, sha256 in each.get(FILES_RECORD, {}).items()}
        metadata = records[-1].get("rosbag2", {}).get("serialized_metadata")
        present = {
            path.name: path
            for path in sorted(bag.path.iterdir())
            if path.is_file() and path.suffix != ".mcap" and path.name != METADATA_NAME
        }
        layouts = _own_layouts(bag) if present.keys() & set(NAMES) else {}
        for name in sorted(stated.keys() | present.keys()):
            where = f"{bag.place}/{name}"
            if name not in present:
                yield Fault(where, "is missing, though the bag lists its checksum")
            elif name in stated:
                yield from self._compare(present[name], stated[name])
            elif not self.subject.has_sums and present[name].read_bytes() != layouts.get(name):
                yield Unchecked(where, "no checksum protects it")
        expected = "" if metadata is None else f"rosbag2_bagfile_information:\n{indent(metadata, '  ')}"
        if metadata is not None and (bag.path / METADATA_NAME).read_bytes() != expected.encode():
            yield Fault(f"{bag.place}/{METADATA_NAME}", "differs from the copy in the bag")

    def _compare(self, path: Path, stated: str) -> Iterator[Result]:
        try:
            is_same = self.subject.scan(path).sha256 == stated
        except AdvpipeError as error:
            yield Fault(self.subject.place(path), str(error))
        else:
            if not is_same:
                yield Fault(self.subject.place(path), "does not match the SHA-256 in the bag")


def _own_layouts(bag: BagUnderTest) -> dict[str, bytes]:
    """The layouts that this release writes beside a bag; none for an unreadable bag."""
    try:
        return {name: text.encode() for name, text in layout_texts(bag.path).items()}
    except AdvpipeError:
        return {}
