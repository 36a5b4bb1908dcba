"""What a LiDAR attack is: one frame and a detector in; the adversarial cloud and its labels out."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from advpipe.pipeline.detector.protocol import ObjectDetector
from advpipe.pipeline.geometry.boxes import Boxes
from advpipe.pipeline.labels.points import PointLabels
from advpipe.pipeline.labels.quantities import CLOUD_QUANTITIES
from advpipe.pipeline.messages.cloud import Cloud
from advpipe.stages.attack.base import Attack, Traits

NO_GRADIENT = "no gradient: the detector's loss depends on no point"
"""The note on a frame where there is nothing to follow."""

QUERYING = ("best", "robust", "random-best")
"""The recipes that look at what the detector finds, and keep the best."""

MAX_ROUNDS = 1_000_000
"""More steps or rounds for each cloud would take days."""


@dataclass(frozen=True)
class LidarResult:
    """The adversarial version of one cloud: the points that it keeps in their order, then those added.

    loss_before, loss_after: the detector's loss on the clean and on the adversarial cloud; NaN
    where the frame has no object to take a loss for.
    note: what the user must know about this frame, such as why it was left as it was; mostly "".
    """

    cloud: Cloud
    labels: PointLabels
    loss_before: float = np.nan
    loss_after: float = np.nan
    note: str = ""


def unchanged(cloud: Cloud, note: str, loss: float = np.nan) -> LidarResult:
    """A frame that the attack leaves as it was, and why; the note must tell."""
    return LidarResult(cloud, PointLabels.removed(np.zeros(0, np.int64)), loss, loss, note)


def join_notes(*notes: str) -> str:
    """Several notes on a frame as one; those that say nothing are left out."""
    return "; ".join(filter(None, notes))


@dataclass(frozen=True, kw_only=True)
class PublishedFigure:
    """What the paper reports of an attack at one budget, as it prints it: mAP ratio and Chamfer distance."""

    printed: float
    map_ratio_percent: float
    chamfer_distance_m2: float


@dataclass(frozen=True, kw_only=True)
class Budget:
    """What bounds an attack on a cloud.

    parameter: the one that says how much it may do, in `unit` over `scale`. title, unit: as tables print
    them; a number that is printed times `scale` is the parameter. usual: what the parameter is where the user
    names none; None where one has to be named. steps: the parameter that says how often the attack looks, if
    any. others: parameters that all budgets of the attack share. published: figures of the paper (arXiv
    2509.05332, Table II).
    """

    title: str
    parameter: str
    unit: str
    scale: float = 1.0
    usual: float | None = None
    steps: str = ""
    others: Mapping[str, float | int] = field(default_factory=dict)
    published: tuple[PublishedFigure, ...] = ()

    @property
    def usual_parameters(self) -> dict[str, float]:
        """The parameter at its usual value, where it has one."""
        return {} if self.usual is None else {self.parameter: self.usual}


@dataclass(frozen=True, kw_only=True)
class LidarTraits(Traits):
    """What is known of an attack on clouds whatever its parameters. only_for: parameters that some recipes
    alone look at, by name, with these recipes; set for another one they are refused."""

    budget: Budget
    only_for: Mapping[str, tuple[str, ...]] = field(default_factory=dict)


class LidarAttack(Attack):
    """An attack on clouds. Its constructor takes the hyper-parameters, keyword-only, and checks them.

    It declares its `traits`, and what it keeps to in numbers, its `bounds`: a cloud beyond them is refused,
    and `verify` measures them again. `examples/my_attack.py` is a whole one. Two attacks on one cloud cannot
    act at the same time.
    """

    family = "lidar"
    own_keys = ("recipe", "lidar", "frames", "detector")
    traits_type = LidarTraits
    quantities = CLOUD_QUANTITIES

    @property
    @abstractmethod
    def traits(self) -> LidarTraits: ...

    @property
    @abstractmethod
    def bounds(self) -> Mapping[str, tuple[float, float]]:
        """Least and most of each quantity that the attack bounds, with its parameters, in every cloud that it
        changes; by names of `advpipe.pipeline.labels.quantities`."""

    @property
    def query_budget(self) -> int | None:
        """Of how many attempts the detector judges to keep the best one: the random baselines then get as
        many. None where it does not say."""
        return None

    @property
    def needs_ground_truth(self) -> bool:
        """Whether it leaves every cloud without true boxes as it is, so that a bag without ground truth is
        refused."""
        return False

    @abstractmethod
    def __call__(
        self, cloud: Cloud, boxes: Boxes, detector: ObjectDetector, rng: np.random.Generator
    ) -> LidarResult:
        """Attack one cloud (N,) with its ground truth `boxes` in the cloud's frame."""


def lidar_traits(kind: type[LidarAttack]) -> LidarTraits:
    """The traits of a class."""
    found: LidarTraits = vars(kind)["traits"]
    return found
