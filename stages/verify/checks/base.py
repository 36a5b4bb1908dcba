"""Base classes of the checks: of the whole folder, of a bag, and of every message of a bag."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterator
from functools import cached_property
from typing import Any

from advpipe.pipeline.core.errors import AdvpipeError
from advpipe.pipeline.mcap.channel import RawMessage
from advpipe.pipeline.messages.message_bounds import implausibility
from advpipe.stages.verify.result import Result
from advpipe.stages.verify.subject import BagUnderTest, Subject


class FolderCheck(ABC):
    """A check of everything that is verified."""

    def __init__(self, subject: Subject) -> None:
        self.subject = subject

    @abstractmethod
    def check(self) -> Iterator[Result]:
        """Yield everything that is wrong or cannot be checked."""


class BagCheck(ABC):
    """A check of a bag after all its messages were read, so that its `scanners` are filled."""

    def __init__(self, bag: BagUnderTest) -> None:
        self.bag = bag

    @abstractmethod
    def check(self) -> Iterator[Result]:
        """Yield everything that is wrong or cannot be checked."""


class MessageView:
    """A message, decoded once for all checks."""

    def __init__(self, bag: BagUnderTest, raw: RawMessage) -> None:
        self.bag, self.raw = bag, raw
        self.error = ""

    @cached_property
    def message(self) -> Any:
        """The message; None if it is damaged, or implausible in advpipe's bag; `error` is the reason."""
        raw, reader = self.raw, self.bag.reader
        try:
            message = reader.decode_as_it_is(raw)
        except AdvpipeError:
            self.error = f"the message at {raw.log_time_ns} ns is not a valid {raw.topic.type}"
            return None
        if self.bag.provenance and (problem := implausibility(raw.topic.name, raw.topic.type, message)):
            self.error = f"the message at {raw.log_time_ns} ns {problem}"
            return None
        return message

    @property
    def header(self) -> Any:
        """The message's std_msgs/Header; None for a type without one, and for a damaged message."""
        header = getattr(self.message, "header", None)
        return header if hasattr(header, "frame_id") else None

    @property
    def where(self) -> str:
        """The bag and topic, for findings."""
        return f"{self.bag.place} {self.raw.topic.name}"


class MessageCheck(BagCheck):
    """A check that also gets every message, in the order of the files; `check` comes last."""

    @abstractmethod
    def see(self, view: MessageView) -> Iterator[Result]:
        """Check one message."""
