"""The bags of an evaluation, checked before anything is computed."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from advpipe.pipeline.bag.carried import lidar_topics
from advpipe.pipeline.bag.frames import count_frames, refuse_without_ground_truth
from advpipe.pipeline.bag.provenance_record import Provenance
from advpipe.pipeline.bag.pseudonyms import read_pseudonyms
from advpipe.pipeline.bag.reader import BagReader
from advpipe.pipeline.bag.window import window_of
from advpipe.pipeline.core.errors import UsageError
from advpipe.pipeline.core.option_names import option_name
from advpipe.stages.evaluate.detection.comparison import bag_name, touches_clouds
from advpipe.stages.evaluate.options import Options


@dataclass(frozen=True)
class Bags:
    """A clean bag and adversarial versions of it, with the record of each.

    on_clouds: the adversarial bags whose attacks changed clouds; detectors see no others.
    has_clouds_to_score: whether detectors see any cloud; without adversarial bags, they see the clean ones,
    unless it is a drive without LiDARs whose stations change pseudonyms.
    """

    clean: Path
    provenances: Mapping[Path, Provenance]
    on_clouds: Mapping[Path, Provenance]
    has_clouds_to_score: bool

    @classmethod
    def checked(cls, clean: Path, adversarial: Sequence[Path], options: Options) -> Bags:
        """Raises UsageError for a clean bag that is adversarial or lacks clouds or ground truth, for two
        adversarial bags of one name, and for options that choose no frame."""
        reader = BagReader(clean)
        if reader.provenance.is_attack:
            raise UsageError(
                f"{clean} is an adversarial bag; give the clean bag that it was made from first, "
                "then this one"
            )
        provenances = {bag: BagReader(bag).provenance for bag in adversarial}
        names = [bag_name(bag) for bag in adversarial]
        for name in names:
            if names.count(name) > 1:
                raise UsageError(
                    f"two adversarial bags are named {name}; rename one, the report identifies them by name"
                )
        on_clouds = {
            bag: about
            for bag, about in provenances.items()
            if touches_clouds(about) and not _is_of_messages_alone(bag, about)
        }
        has_clouds_to_score = bool(on_clouds) or not (provenances or _is_about_privacy_alone(reader))
        if has_clouds_to_score:
            refuse_without_ground_truth(clean, options.lidar_topic)
            options.frames.indices(count_frames(clean, options.lidar_topic))  # refuses a bag without clouds
        window_of(reader, options.frames, options.lidar_topic)  # refuses a choice of no frame
        return cls(clean, provenances, on_clouds, has_clouds_to_score)

    def refuse_another_parent(self, clean_sha256: str) -> None:
        """Raises UsageError for an adversarial bag that was made from another bag."""
        for bag, provenance in self.provenances.items():
            parent = provenance.fields.parent_sha256
            if parent is not None and parent != clean_sha256:
                raise UsageError(
                    f"{bag} was made from another bag than {self.clean} (parent SHA-256 {parent[:12]}…, "
                    f"not {clean_sha256[:12]}…); give the bag that was attacked; if that was recorded anew "
                    f"since, attack again with {option_name('overwrite', True)} or remove that folder"
                )


def _is_of_messages_alone(bag: Path, about: Provenance) -> bool:
    """Whether a bag declares no attack, as one that was imported, and has no LiDAR: a published log of
    messages."""
    return not about.fields.attacks and not lidar_topics(BagReader(bag))


def _is_about_privacy_alone(clean: BagReader) -> bool:
    """Whether a bag has no LiDAR, but changes of pseudonyms, which the tracker of `privacy` follows."""
    return not lidar_topics(clean) and bool(read_pseudonyms(clean))
