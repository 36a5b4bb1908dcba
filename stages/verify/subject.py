"""The subject of verification: a data set, a single bag, or the contents of an archive."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any

from advpipe.pipeline.bag.files import METADATA_NAME, mcap_files
from advpipe.pipeline.bag.foreign import refuse_foreign
from advpipe.pipeline.bag.locate import CLEAN_NAME
from advpipe.pipeline.bag.provenance import parent_sha256
from advpipe.pipeline.bag.provenance_record import Provenance
from advpipe.pipeline.bag.reader import BagReader
from advpipe.pipeline.core.document import read_yaml
from advpipe.pipeline.core.errors import AdvpipeError, UsageError
from advpipe.pipeline.core.leftover_names import is_leftover_name
from advpipe.pipeline.dataset import checksums
from advpipe.pipeline.dataset.layout import Layout, read_layout
from advpipe.stages.verify.mcap_scanner import McapScanner
from advpipe.stages.verify.scan import FileScan, scan


@dataclass
class BagUnderTest:
    """A bag under test: its folder or .mcap file, and its name in findings.

    scanners: of its files, filled while the messages are read. candidates: bags that may be its parent.
    """

    path: Path
    place: str
    subject: Subject
    scanners: list[McapScanner] = field(default_factory=list)

    @cached_property
    def reader(self) -> BagReader:
        """A reader of the bag."""
        return BagReader(self.path)

    @cached_property
    def files(self) -> list[Path]:
        """Its .mcap files, in order."""
        return mcap_files(self.path)

    @cached_property
    def provenance(self) -> Provenance:
        """Its provenance record."""
        return self.reader.provenance

    @property
    def is_own(self) -> bool:
        """Whether advpipe recorded the drive; other tools' bags, and attacks on them, make fewer claims."""
        return "scenario" in self.provenance

    @property
    def is_attack(self) -> bool:
        """Whether it is an adversarial bag."""
        return self.provenance.is_attack

    @cached_property
    def scenario(self) -> dict[str, Any] | None:
        """The resolved scenario as plain values; None for another tool's bag, or if it is unreadable."""
        try:
            found: dict[str, Any] = read_yaml(self.provenance.fields.scenario, dict[str, Any], self.place, "")
        except AdvpipeError:
            return None
        return found

    @cached_property
    def sha256(self) -> str | None:
        """The checksum of its .mcap files, as in `parent_sha256` of an attack on it; None if one is
        unreadable."""
        try:
            if len(self.files) == 1:
                return self.subject.scan(self.files[0]).sha256
            return parent_sha256(self.path)
        except (AdvpipeError, OSError):
            return None

    @cached_property
    def parent(self) -> BagUnderTest | None:
        """The bag from which an attack was made, found by its checksum; None if it is not here."""
        wanted = self.provenance.fields.parent_sha256
        for bag in self.subject.candidates:
            if bag.path != self.path and bag.sha256 is not None and bag.sha256 == wanted:
                return bag
        return None


@dataclass
class Subject:
    """The bags to verify.

    candidates: bags that may be parents; for a single attack, the clean bag beside it. root: findings name
    paths relative to it. key: the signer's public key from the user.
    """

    root: Path
    layout: Layout | None
    bags: list[BagUnderTest] = field(default_factory=list)
    candidates: list[BagUnderTest] = field(default_factory=list)
    key: Path | None = None
    _scans: dict[Path, FileScan | AdvpipeError] = field(default_factory=dict)

    def scan(self, path: Path) -> FileScan:
        """The scan of a file, cached. Raises AdvpipeError for an unreadable file."""
        if path not in self._scans:
            try:
                self._scans[path] = scan(path)
            except OSError as error:
                self._scans[path] = AdvpipeError(f"cannot be read: {error.strerror or error}")
        found = self._scans[path]
        if isinstance(found, AdvpipeError):
            raise found
        return found

    def place(self, path: Path) -> str:
        """The name of a path in findings."""
        if path == self.root:
            return path.name
        return path.relative_to(self.root).as_posix() if path.is_relative_to(self.root) else str(path)

    @property
    def has_sums(self) -> bool:
        """Whether there is a SHA256SUMS."""
        return (self.root / checksums.FILE).is_file()


def find_subject(path: Path) -> Subject:
    """The subject that a path names. Raises AdvpipeError for a path that is neither a data set nor a bag."""
    path = Path(path)
    if not path.exists():
        raise UsageError(f"{path} does not exist; give a data set, a bag, an .mcap file or an archive")
    if is_leftover_name(path.resolve().name):
        raise UsageError(
            f"{path} was left by an unfinished run; finish that run, or see `advpipe clean {path}`"
        )
    has_clean, has_sums = (path / CLEAN_NAME).is_dir(), (path / checksums.FILE).is_file()
    if has_clean or (has_sums and not (path / METADATA_NAME).is_file()):
        return _dataset(path)
    if path.is_dir():
        return _lone(path)
    if path.suffix == ".mcap":
        return _lone(path)
    refuse_foreign(path)
    raise UsageError(f"{path} is not a data set, a bag, an .mcap file or an archive")


def _lone(path: Path) -> Subject:
    if path.is_dir() and not (path / METADATA_NAME).is_file():
        raise UsageError(
            f"{path} is neither a data set (no {CLEAN_NAME}/) nor a bag (no {METADATA_NAME}); give "
            "one of them"
        )
    root = path if path.is_dir() else path.parent
    subject = Subject(root, None)
    subject.bags = [BagUnderTest(path, path.name, subject)]
    beside = path.parent / CLEAN_NAME
    if path.is_dir() and path != beside and (beside / METADATA_NAME).is_file():
        subject.candidates = [BagUnderTest(beside, CLEAN_NAME, subject)]
    return subject


def _dataset(path: Path) -> Subject:
    if (path / CLEAN_NAME / METADATA_NAME).is_file():
        layout: Layout | None = read_layout(path)
    elif (path / checksums.FILE).is_file():
        layout = None  # the checksum list shows what is missing
    else:
        raise UsageError(f"{path} is not a data set: {CLEAN_NAME}/{METADATA_NAME} is missing")
    subject = Subject(path, layout)
    if layout is not None:
        subject.bags = [BagUnderTest(bag, subject.place(bag), subject) for bag in layout.bags]
        subject.candidates = subject.bags
    return subject
