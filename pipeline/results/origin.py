"""Where the figures of a report come from: enough to compute them again."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import Annotated

from advpipe.pipeline.results.metrics import Record


@dataclass(frozen=True)
class CleanBag:
    """The clean bag: its name, its checksum, and the name of its scenario."""

    bag: Annotated[str, "name of the clean bag"]
    sha256: Annotated[str, "SHA-256 of the clean bag"]
    scenario: Annotated[str | None, "name of its scenario; null where the bag does not say"]


@dataclass(frozen=True)
class ComparedBag:
    """A bag beside it, with what its record says; frames: those of the clean bag that were scored."""

    bag: Annotated[str, "name of the bag"]
    sha256: Annotated[str | None, "SHA-256 of the bag"]
    provenance: Annotated[Mapping[str, str], "the bag's own record, as text by key"]
    frames: Annotated[tuple[int, ...], "frames of the clean bag that were scored, by index"]


@dataclass(frozen=True)
class DetectorOrigin:
    """A detector by name, checksum, classes and range, and whether it was trained on the clean bag's map."""

    name: Annotated[str, "name of the detector"]
    sha256: Annotated[str, "SHA-256 of its weights or code"]
    classes: Annotated[tuple[str, ...], "classes that it detects"]
    range_m: Annotated[Mapping[str, float], "its detection range: limits in metres by name"]
    is_training_map: Annotated[
        bool | None, "whether it was trained on the map of the clean bag; null where that is unknown"
    ]


@dataclass(frozen=True)
class AdaptationRecord:
    """How clouds were presented to detectors."""

    lidar_height_m: Annotated[
        float | None, "height of the LiDAR above the ground that was given, in metres; null for none"
    ]
    level: Annotated[bool, "whether clouds were levelled by their ground"]
    scale_intensity: Annotated[float, "factor of all intensities"]


@dataclass(frozen=True)
class ResultsOrigin:
    """advpipe: its version. code_sha256: of the code that decides what a report says. device: the kind of
    GPU; None for the CPU, of which a report says nothing."""

    advpipe: Annotated[str, "version of advpipe"]
    code_sha256: Annotated[str, "SHA-256 of the code that decides the contents of a report"]
    clean: Annotated[CleanBag, "the clean bag"]
    compared: Annotated[tuple[ComparedBag, ...], "the bags that are compared with it"]
    detectors: Annotated[tuple[DetectorOrigin, ...], "the evaluated detectors"]
    bootstrap_draws: Annotated[int, "number of draws of the bootstrap"]
    seed: Annotated[int, "seed of all random draws"]
    baseline_tries: Annotated[
        int | None, "number of random tries asked for; null for the attack's query budget"
    ]
    defences: Annotated[tuple[str, ...], "the evaluated defences with their parameters"]
    attack_checks: Annotated[tuple[str, ...], "the checks that try to tell attacked clouds"] = ()
    device: Annotated[str | None, "kind of GPU; absent for the CPU"] = None
    adaptation: Annotated[
        AdaptationRecord | None,
        "how clouds were presented to detectors; absent where they saw them as they are",
    ] = None

    def record(self) -> Record:
        """What `report.json` has as `provenance`."""
        row: Record = asdict(self)
        for key in ("device", "adaptation"):
            if row[key] is None:
                del row[key]
        return row
