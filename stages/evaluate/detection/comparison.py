"""A clean bag against one adversarial bag, frame by frame: the detector's results on each cloud."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import numpy.typing as npt

from advpipe.pipeline.bag.provenance_record import Provenance
from advpipe.pipeline.detector.protocol import Detections
from advpipe.stages.evaluate.detection.checked_cloud import CheckedFrame
from advpipe.stages.evaluate.detection.displacement import Displacement
from advpipe.stages.evaluate.detection.matches import Matches
from advpipe.stages.evaluate.detection.point_traces import PointTraces
from advpipe.stages.evaluate.detection.scoring import Truth

Int64 = npt.NDArray[np.int64]
Bool = npt.NDArray[np.bool_]


@dataclass(frozen=True, slots=True)
class CloudResult:
    """The detector's results on one cloud, and how far the cloud is from the clean one.

    box_points: (K,) points of the cloud in the box of each detection.
    emptied: (M,) objects that are evaluated, and have too few points in this cloud.
    recounted: the strict matches if the objects were counted on this cloud alone; None where they are alike.
    """

    detections: Detections
    matches: Matches
    box_points: Int64
    points: int
    emptied: Bool = field(default_factory=lambda: np.zeros(0, dtype=bool))
    recounted: Matches | None = None
    points_removed: int = 0
    points_added: int = 0
    points_moved: int = 0
    intensities_changed: int = 0
    displacement: Displacement = field(default_factory=Displacement)
    chamfer_distance_m2: float = 0.0
    traces: PointTraces = field(default_factory=PointTraces)


@dataclass(frozen=True, slots=True)
class FrameResult:
    """One frame: its ground truth and the clouds of it. Indices count in their own bag.

    baselines: by the names of `baseline_names`. defended: the clean and the adversarial cloud, by `under`.
    note: why the clean cloud was not levelled for the detector, where it was to be. attack_checks: by name;
    checks_not_run: why others say nothing.
    """

    index: int
    adversarial_index: int
    stamp_ns: int
    truth: Truth
    clean: CloudResult
    adversarial: CloudResult | None = None
    baselines: Mapping[str, CloudResult] = field(default_factory=dict)
    defended: Mapping[str, CloudResult] = field(default_factory=dict)
    note: str = ""
    attack_checks: Mapping[str, CheckedFrame] = field(default_factory=dict)
    checks_not_run: Mapping[str, str] = field(default_factory=dict)

    @property
    def is_attacked(self) -> bool:
        """Whether points of the cloud were removed, added or moved, or got another intensity."""
        cloud = self.adversarial
        if cloud is None:
            return False
        return bool(
            cloud.points_removed or cloud.points_added or cloud.points_moved or cloud.intensities_changed
        )

    def clouds(self) -> dict[str, CloudResult]:
        """The clouds that the detector sees as they are, by condition, as reports name it."""
        given = {"clean": self.clean}
        if self.adversarial is not None:
            given["adv"] = self.adversarial
        return given | dict(self.baselines)

    def all_clouds(self) -> dict[str, CloudResult]:
        """Those, and the ones that a defence changed before the detector saw them."""
        return self.clouds() | dict(self.defended)


def under(condition: str, defence: str) -> str:
    """The name of a condition under a defence: `adv under jitter:sigma_m=0.01`."""
    return f"{condition} under {defence}"


@dataclass(frozen=True)
class Comparison:
    """The frames of one adversarial bag, or of the clean bag alone, as one detector sees them.

    detector: its name in reports. classes: those that it finds. baseline_tries: of how many random tries the
    best is among the baselines; 0 without baselines. defences: their names; the clouds were also scored under
    each. sequence_checks: the attack checks of consecutive clouds that were asked for.
    """

    bag: Path | None
    provenance: Provenance
    frames: tuple[FrameResult, ...]
    detector: str = ""
    detector_sha256: str = ""
    classes: tuple[str, ...] = ()
    defences: tuple[str, ...] = ()
    baseline_tries: int = 0
    sequence_checks: tuple[str, ...] = ()

    @property
    def name(self) -> str:
        """The name of the adversarial bag; `clean` without one."""
        return bag_name(self.bag) if self.bag else "clean"

    @property
    def is_white_box(self) -> bool | None:
        """Whether the evaluated detector was attacked, alone or in an ensemble; None where that is unknown.

        One file may hold several detectors `module:Class`: they are told apart by name too.
        """
        attacked = self.provenance.fields.detector_sha256
        if not attacked or not self.detector_sha256:
            return None
        members = attacked.split(",")
        name = self.provenance.get("detector", self.detector)
        names = name.split(",") if len(members) > 1 else [name]
        return any(
            sha256 == self.detector_sha256 and (name == self.detector or ":" not in self.detector)
            for name, sha256 in zip(names, members, strict=False)
        )


def touches_clouds(provenance: Provenance) -> bool:
    """Whether an attack changed clouds, and not only messages or GPS."""
    attacks = provenance.fields.attacks
    return not attacks or any(one.family == "lidar" for one in attacks)


def bag_name(bag: Path) -> str:
    """The folder of a bag, or its file without `.mcap`."""
    return bag.stem if bag.suffix == ".mcap" else bag.name
