"""What advpipe asks of a family of detectors: networks of one architecture in several sizes."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING

from advpipe.pipeline.core.errors import UsageError
from advpipe.pipeline.core.short_repr import short_repr
from advpipe.pipeline.detector.common.preset import Preset

if TYPE_CHECKING:
    from advpipe.pipeline.detector.common.network import DetectionNetwork


class Family(ABC):
    """Trained by `advpipe train --family NAME`, loaded from any checkpoint that names it.

    A family is a folder beside `second/` and a line in `families.FAMILIES`. Its module imports no PyTorch;
    its methods may.
    """

    @property
    @abstractmethod
    def presets(self) -> Mapping[str, Preset]:
        """The sizes of its networks by name; each says the name that the family is registered under."""

    @property
    def shipped(self) -> Mapping[str, Path]:
        """Checkpoints that come with the package, by the name that `--detector` takes; no two families share
        one."""
        return {}

    @abstractmethod
    def network(self, preset: str) -> DetectionNetwork:
        """A network with random weights, on the CPU; `preset` is one of `presets`."""

    def import_weights(self, file: Path) -> tuple[DetectionNetwork, dict[str, str]]:
        """The network that others trained in a file of theirs, and where it is from, as text.

        Raises AdvpipeError for a file that holds none; runs no code from it.
        """
        raise UsageError(f"cannot import {file}: this family of detectors takes no weights of others")

    def preset(self, name: str) -> Preset:
        """The preset of that name, or an error that lists the known ones."""
        if name not in self.presets:
            raise UsageError(f"unknown detector preset {short_repr(name)}; known: {', '.join(self.presets)}")
        return self.presets[name]
