"""Where the figures of a report come from: enough to compute them again."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass

from advpipe.pipeline.results.metrics import Record


@dataclass(frozen=True)
class CleanBag:
    """The clean bag: its name, its checksum, and the name of its scenario."""

    bag: str
    sha256: str
    scenario: str | None


@dataclass(frozen=True)
class ComparedBag:
    """A bag beside it, with what its record says; frames: those of the clean bag that were scored."""

    bag: str
    sha256: str | None
    provenance: Mapping[str, str]
    frames: tuple[int, ...]


@dataclass(frozen=True)
class DetectorOrigin:
    """A detector by name, checksum, classes and range, and whether it was trained on the clean bag's map."""

    name: str
    sha256: str
    classes: tuple[str, ...]
    range_m: Mapping[str, float]
    is_training_map: bool | None


@dataclass(frozen=True)
class ResultsOrigin:
    """advpipe: its version. code_sha256: of the code that decides what a report says. device: the kind of
    GPU; None for the CPU, of which a report says nothing."""

    advpipe: str
    code_sha256: str
    clean: CleanBag
    compared: tuple[ComparedBag, ...]
    detectors: tuple[DetectorOrigin, ...]
    bootstrap_draws: int
    seed: int
    baseline_tries: int | None
    defences: tuple[str, ...]
    device: str | None = None

    def record(self) -> Record:
        """What `report.json` has as `provenance`."""
        row: Record = asdict(self)
        if self.device is None:
            del row["device"]
        return row
