"""Parts of a relay with a recorder that writes to a folder of the test."""

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from advpipe.pipeline.bag.writer import BagWriter
from advpipe.pipeline.campaigns.relay.outgoing import OutgoingMessage
from advpipe.pipeline.campaigns.relay.recorder import Recorder
from advpipe.pipeline.campaigns.relay.settings import RelaySettings


def settings_of(*attacks: dict[str, Any], **others: Any) -> RelaySettings:
    return RelaySettings.model_validate({"attacks": list(attacks), **others})


@contextmanager
def recording(path: Path, *, has_clouds: bool = False) -> Iterator[Recorder]:
    with (
        BagWriter(path, provenance={"kind": "attack", "debug": "true"}) as bag,
        Recorder(bag, debug=True, has_clouds=has_clouds) as recorder,
    ):
        yield recorder


def on(name: str, sent: Sequence[OutgoingMessage]) -> list[OutgoingMessage]:
    """The messages of one topic."""
    return [one for one in sent if one.topic.name == name]
