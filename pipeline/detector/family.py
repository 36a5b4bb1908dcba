"""The interface of a detector family: networks of one architecture in several sizes."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING

from advpipe.pipeline.core.errors import UsageError
from advpipe.pipeline.core.nearest import known_names
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
        """The sizes of its networks by name; each preset has the family's registered name."""

    @property
    def shipped(self) -> Mapping[str, Path]:
        """Checkpoints shipped with the package, by their name for `--detector`; no two families share
        one."""
        return {}

    @abstractmethod
    def network(self, preset: str) -> DetectionNetwork:
        """A network with random weights, on the CPU; `preset` is one of `presets`."""

    def import_weights(self, file: Path) -> tuple[DetectionNetwork, dict[str, str]]:
        """Import a network trained with another tool: the network, and its origin as text.

        Raises AdvpipeError for any other file; never runs code from it.
        """
        raise UsageError(f"cannot import {file}: this detector family supports no external weights")

    def preset(self, name: str) -> Preset:
        """The preset of that name. Raises UsageError, listing the known ones, for an unknown name."""
        if name not in self.presets:
            raise UsageError(f"unknown detector preset {short_repr(name)}; {known_names(name, self.presets)}")
        return self.presets[name]
