"""The three kinds of checks: of the folder as a whole, of a bag, and of every message of a bag."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterator
from functools import cached_property
from typing import Any

from advpipe.pipeline.core.errors import AdvpipeError
from advpipe.pipeline.mcap.channel import RawMessage
from advpipe.pipeline.messages.message_bounds import implausibility
from advpipe.stages.verify.result import Result
from advpipe.stages.verify.subject import Bag, Subject


class FolderCheck(ABC):
    """Looks at all that is verified."""

    def __init__(self, subject: Subject) -> None:
        self.subject = subject

    @abstractmethod
    def check(self) -> Iterator[Result]: ...


class BagCheck(ABC):
    """Looks at a bag all of whose messages were read: `scanners` are full."""

    def __init__(self, bag: Bag) -> None:
        self.bag = bag

    @abstractmethod
    def check(self) -> Iterator[Result]: ...


class MessageView:
    """A message on its way past the checks, decoded once for all of them."""

    def __init__(self, bag: Bag, raw: RawMessage) -> None:
        self.bag, self.raw = bag, raw
        self.error = ""

    @cached_property
    def message(self) -> Any:
        """The message; None for one that is damaged, or absurd in a bag of advpipe's; `error` says why."""
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
        return f"{self.bag.place} {self.raw.topic.name}"


class MessageCheck(BagCheck):
    """Also sees every message, in the order of the files; `check` comes last."""

    @abstractmethod
    def see(self, seen: MessageView) -> Iterator[Result]: ...
