"""The bags of an evaluation: what can be refused is, before anything is computed."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from advpipe.pipeline.bag.frames import has_ground_truth
from advpipe.pipeline.bag.ground_truth import BOX_TYPES
from advpipe.pipeline.bag.provenance_record import Provenance
from advpipe.pipeline.bag.reader import BagReader
from advpipe.pipeline.bag.window import window_of
from advpipe.pipeline.core.errors import UsageError
from advpipe.stages.evaluate.detection.comparison import bag_name, touches_clouds
from advpipe.stages.evaluate.detection.pairing import chosen_indices
from advpipe.stages.evaluate.options import Options


@dataclass(frozen=True)
class Bags:
    """A clean bag and adversarial versions of it, with the record of each."""

    clean: Path
    provenances: Mapping[Path, Provenance]

    @classmethod
    def checked(cls, clean: Path, adversarial: Sequence[Path], options: Options) -> Bags:
        """Raises UsageError for a clean bag that is none, lacks clouds or ground truth, for two adversarial
        bags of one name, and for a choice of no frames."""
        _refuse_adversarial(clean)
        bags = cls(clean, {bag: BagReader(bag).provenance for bag in adversarial})
        _refuse_equal_names(adversarial)
        if bags.has_clouds_to_score:
            _require_ground_truth(clean, options.lidar_topic)
            chosen_indices(clean, options.frames, options.lidar_topic)  # refuses a bag without clouds
        window_of(BagReader(clean), options.frames, options.lidar_topic)  # refuses a choice of none
        return bags

    @property
    def adversarial(self) -> list[Path]:
        return list(self.provenances)

    @property
    def on_clouds(self) -> list[Path]:
        """Those whose attacks changed clouds: the others are not shown to detectors."""
        return [bag for bag, provenance in self.provenances.items() if touches_clouds(provenance)]

    @property
    def has_clouds_to_score(self) -> bool:
        """Without adversarial bags, the clean clouds are scored."""
        return bool(self.on_clouds) or not self.provenances

    def refuse_another_parent(self, clean_sha256: str) -> None:
        """Raises UsageError for an adversarial bag that says that it was made from another bag."""
        for bag, provenance in self.provenances.items():
            _refuse_another_parent(bag, provenance, self.clean, clean_sha256)


def _refuse_adversarial(clean: Path) -> None:
    if BagReader(clean).provenance.is_attack:
        raise UsageError(
            f"{clean} is an adversarial bag; give the clean bag that it was made from first, then this one"
        )


def _require_ground_truth(clean: Path, lidar_topic: str | None) -> None:
    if not has_ground_truth(clean, lidar_topic):
        raise UsageError(
            f"{clean} has no ground truth (no topic of {' or '.join(BOX_TYPES)}); "
            "give the clean bag that holds it"
        )


def _refuse_another_parent(bag: Path, provenance: Provenance, clean: Path, clean_sha256: str) -> None:
    """Raises AdvpipeError for an adversarial bag that says that it was made from another bag."""
    told = provenance.said.parent_sha256
    if told is not None and told != clean_sha256:
        raise UsageError(
            f"{bag} was made from another bag than {clean} (parent SHA-256 {told[:12]}…, not "
            f"{clean_sha256[:12]}…); give the bag that was attacked; if that was recorded anew since, "
            "attack again with --overwrite or remove that folder"
        )


def _refuse_equal_names(bags: Sequence[Path]) -> None:
    names = [bag_name(bag) for bag in bags]
    for name in names:
        if names.count(name) > 1:
            raise UsageError(
                f"two adversarial bags are named {name}; rename one, the report tells them by name"
            )
