"""The names that shells complete are those of the registry."""

from advpipe.pipeline.defences.names import defence_names
from advpipe.pipeline.defences.registry import DEFENCES


def test_names() -> None:
    assert defence_names() == list(DEFENCES)
