"""Verify everything that a data set or a bag claims."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from advpipe.pipeline.bag.locate import bag_named
from advpipe.pipeline.core.errors import AdvpipeError, os_error_line
from advpipe.pipeline.core.progress import plan_progress, track
from advpipe.pipeline.core.remote_path import located
from advpipe.pipeline.core.scratch import scratch_folder
from advpipe.pipeline.dataset import archive
from advpipe.pipeline.dataset.download import local_copy
from advpipe.pipeline.dataset.parts import existing_parts, whole_name
from advpipe.pipeline.mcap.reader import DAMAGE
from advpipe.stages.verify.checks.base import BagCheck, FolderCheck, MessageCheck, MessageView
from advpipe.stages.verify.mcap_scanner import McapScanner
from advpipe.stages.verify.registry import CHECKS, QUICK, QUICK_ALONE
from advpipe.stages.verify.result import Fault, Result, Unchecked, Verification
from advpipe.stages.verify.subject import BagUnderTest, Subject, find_subject

__all__ = ["verify"]

MALFORMED = (*DAMAGE, TypeError, AttributeError, ArithmeticError)
"""The exceptions that malformed records, messages, tables or values raise."""


def verify(path: Path, *, quick: bool = False, key: Path | None = None) -> Verification:
    """Verify a data set, a bag, an .mcap file or an archive, in bounded memory.

    quick: only checksums, signature and the checksums in the bags. key: the signer's public key (PEM). An
    archive is unpacked to the folder for temporary files, and what lies in an object store is copied there.
    Raises AdvpipeError for any other path, and for an
    invalid key.
    """
    if key is not None:
        from advpipe.pipeline.dataset.signature import load_public_key

        load_public_key(key)
    path = located(bag_named(Path(path)))
    result = Verification(str(path), QUICK if quick else tuple(CHECKS))
    with local_copy(path) as copy, _opened(copy, result) as subject:
        if subject is not None:
            subject.key = key
            if quick and not subject.has_sums:
                result.checks = QUICK_ALONE
            _run(subject, quick, result)
    result.close()
    return result


@contextmanager
def _opened(path: Path, result: Verification) -> Iterator[Subject | None]:
    """The subject that a path names, or the contents of an archive; None, with a finding, if it is
    unreadable."""
    whole = whole_name(path)
    if not (path.is_file() or existing_parts(whole)) or whole.suffix != ".tar":
        try:
            subject = find_subject(path)
        except OSError as error:  # an unreadable folder in it
            result.add("container", [Fault(path.name, os_error_line(error))])
            subject = None
        yield subject
        return
    with scratch_folder() as scratch:
        try:
            folder = archive.unpack_archive(path, scratch / whole.stem)
        except archive.NoRoomError:
            raise
        except AdvpipeError as error:
            result.add("archive", [Fault(path.name, str(error))])
            yield None
            return
        result.scratch = f"{folder}/"
        yield find_subject(folder)


def _run(subject: Subject, quick: bool, result: Verification) -> None:
    if subject.layout is not None:
        for leftover in subject.layout.leftovers:
            what = "a run is still writing it" if leftover.is_running else "was left by a killed run"
            result.add(
                "container", [Unchecked(subject.place(leftover.path), f"{what}; not part of the data set")]
            )
    messages = {} if quick else {f"checking {bag.place}": 10.0 for bag in subject.bags}
    plan_progress({"hashing": 2, "checksums": 1, **messages})
    for name in result.checks:
        check_class = CHECKS[name]
        if issubclass(check_class, FolderCheck):
            result.add(name, _safely(check_class(subject).check(), subject.root.name))
    if quick:
        return
    if not subject.bags:
        result.add(
            "container", [Unchecked(subject.root.name, "the clean bag cannot be read, so no more is checked")]
        )
    for bag in subject.bags:
        _check_bag(bag, result)


def _check_bag(bag: BagUnderTest, result: Verification) -> None:
    """One pass over all messages, and then the checks of the whole bag."""
    faults = list(_safely(_opening(bag), bag.place))
    result.add("container", faults)
    if faults:
        return
    files, count = bag.files, sum(info.count for info in bag.reader.topics.values())
    classes = {name: CHECKS[name] for name in result.checks}
    checks = {
        name: check_class(bag) for name, check_class in classes.items() if issubclass(check_class, BagCheck)
    }
    message_checks = [(name, check) for name, check in checks.items() if isinstance(check, MessageCheck)]
    bag.scanners = [McapScanner(file) for file in files]
    messages = (raw for scanner in bag.scanners for raw in scanner.messages())
    for raw in track(messages, f"checking {bag.place}", count):
        view = MessageView(bag, raw)
        for name, message_check in message_checks:
            result.add(name, _safely(message_check.see(view), view.where))
    for name, check in checks.items():
        result.add(name, _safely(check.check(), bag.place))


def _opening(bag: BagUnderTest) -> Iterator[Result]:
    """Yield nothing; raise the error of a bag whose provenance or topics are unreadable."""
    _ = bag.files, bag.provenance, bag.reader.topics
    yield from ()


def _safely(results: Iterator[Result], where: str) -> Iterator[Result]:
    """The same results; an error while reading the bag becomes a fault."""
    try:
        yield from results
    except AdvpipeError as error:
        yield Fault(where, str(error))
    except OSError as error:
        yield Fault(where, os_error_line(error))
    except MALFORMED as error:
        reason = str(error).splitlines()[0] if str(error) else type(error).__name__
        yield Fault(where, f"its records or messages are malformed: {reason}")
