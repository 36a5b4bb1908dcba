"""The base of LiDAR attacks: from a frame and a detector to the adversarial cloud and its labels."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from advpipe.pipeline.adversary.constraints import BLACK_BOX, HIDE
from advpipe.pipeline.adversary.surrogate import SurrogateDetector
from advpipe.pipeline.core.errors import UsageError
from advpipe.pipeline.detector.protocol import ObjectDetector
from advpipe.pipeline.geometry.boxes import Boxes
from advpipe.pipeline.labels.cloud_change import CloudChange
from advpipe.pipeline.labels.cloud_quantity import AGGREGATES, COLUMNS, CloudQuantity
from advpipe.pipeline.labels.points import PointLabels
from advpipe.pipeline.labels.quantities import CLOUD_QUANTITIES, cloud_quantities
from advpipe.pipeline.labels.quantity import Quantity
from advpipe.pipeline.messages.cloud import Cloud
from advpipe.stages.attack.base import Attack, Traits

NO_GRADIENT = "no gradient: the detector's loss depends on no point"
"""The note on a frame where the loss has no gradient."""

NO_OCCUPANCY = "no occupancy_loss: searched by the detections, and the gradient of the loss where it has one"
"""The note on a frame that recipes attack by its detections."""

SURROGATE = "small"
"""The shipped detector that proposes changes against one without `occupancy_loss`."""

WITH_SURROGATE = (
    f"no occupancy_loss: searched by the detections, and the gradients of the shipped detector {SURROGATE}"
)
"""The note on a frame where a surrogate proposes changes."""

STEPPING = ("best", "hide", "robust", "stealthy", "transfer", "random-best")
"""The recipes that query the detector in so many steps or rounds, and keep the best candidate."""

PROPOSING = tuple(recipe for recipe in STEPPING if recipe != "random-best")
"""The recipes that have a surrogate propose changes against a detector without `occupancy_loss`."""

QUERYING = (*STEPPING, *BLACK_BOX)
"""The recipes that query the detector, and keep the best candidate."""

QUERIES = 50
"""How many detections a black-box recipe asks for by default: about as much time as `best` takes."""

WITH_GOAL = tuple(recipe for recipe in QUERYING if recipe != HIDE)
"""Those whose goal can be chosen: `hide` has its own."""

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


def search_note(detector: ObjectDetector) -> str:
    """The note on a frame of a detector without `occupancy_loss`."""
    return WITH_SURROGATE if isinstance(detector, SurrogateDetector) else NO_OCCUPANCY


def unchanged(cloud: Cloud, note: str, loss: float = np.nan) -> LidarResult:
    """The result for a cloud (N,) that the attack leaves as it is; the note says why."""
    return LidarResult(cloud, PointLabels.removed(np.zeros(0, np.int64)), loss, loss, note)


@dataclass(frozen=True, kw_only=True)
class PublishedFigure:
    """The paper's mAP ratio and Chamfer distance at one budget, as its table prints it: table_value."""

    table_value: float
    map_ratio_percent: float
    chamfer_distance_m2: float


@dataclass(frozen=True, kw_only=True)
class Budget:
    """The budget of an attack on a cloud.

    parameter: the one that limits the attack. title, unit: as tables print them; a printed number times
    `scale` is the parameter. default: the parameter if the user gives none; None if it has to be given.
    steps: the parameter that limits the attack's queries, if any. shared_parameters: parameters that all
    budgets of the attack have in common. published: figures of the paper (arXiv 2509.05332, Table II).
    """

    title: str
    parameter: str
    unit: str
    scale: float = 1.0
    default: float | None = None
    steps: str = ""
    shared_parameters: Mapping[str, float | int] = field(default_factory=dict)
    published: tuple[PublishedFigure, ...] = ()

    @property
    def default_parameters(self) -> dict[str, float]:
        """The parameter with its default, if it has one."""
        return {} if self.default is None else {self.parameter: self.default}


@dataclass(frozen=True, kw_only=True)
class LidarTraits(Traits):
    """Properties of an attack on clouds that do not depend on its parameters. only_for: by name, the recipes
    that use a parameter; it is refused with any other recipe. quantities: the attack's own, for its bounds;
    the bag carries them."""

    budget: Budget
    quantities: tuple[CloudQuantity, ...] = ()
    only_for: Mapping[str, tuple[str, ...]] = field(default_factory=dict)


class LidarAttack(Attack):
    """An attack on clouds. Its constructor takes the hyper-parameters, keyword-only, and checks them.

    It declares its `traits` and its `bounds`: a cloud beyond the bounds is refused, and `verify` measures
    them again. `examples/my_attack.py` is a complete one. Two attacks on one cloud cannot be active at the
    same time.
    """

    family = "lidar"
    family_title = "LiDAR: change the points of clouds"
    own_keys = ("recipe", "lidar", "frames", "detector", "lidar_height_m", "level", "scale_intensity")
    traits_type = LidarTraits
    quantities = CLOUD_QUANTITIES

    @property
    @abstractmethod
    def traits(self) -> LidarTraits: ...

    @property
    @abstractmethod
    def bounds(self) -> Mapping[str, tuple[float, float]]:
        """Minimum and maximum of each quantity that the attack bounds, with its parameters, in any cloud that
        it changes; by names of `advpipe.pipeline.labels.quantities` and of the quantities in its traits."""

    def without_losses(self) -> LidarAttack:
        """The same attack for where nobody reads the losses of its results, and time counts; it may leave
        them NaN."""
        return self

    @property
    def uses_surrogate(self) -> bool:
        """Whether a detector of ours may propose changes against one without `occupancy_loss`: the attack is
        then given a `SurrogateDetector`."""
        return False

    @classmethod
    def measurable(cls) -> Mapping[str, Quantity[CloudChange]]:
        """What its bounds may be of, by name. Raises UsageError for a quantity of its own that cannot be
        measured, or has the name of another one."""
        own = lidar_traits(cls).quantities
        names = [*CLOUD_QUANTITIES, *(each.name for each in own)]
        for each in own:
            if not each.is_measurable:
                raise UsageError(
                    f"{cls.__name__}: {each.name} is the {each.aggregate} of {each.column}; known columns: "
                    f"{', '.join(COLUMNS)}; known aggregates: {', '.join(AGGREGATES)}"
                )
            if names.count(each.name) > 1:
                raise UsageError(f"{cls.__name__}: there is another quantity {each.name}; rename this one")
        return cloud_quantities(own)

    @property
    def query_budget(self) -> int | None:
        """How many candidates the detector judges, of which the attack keeps the best. None if it declares
        none."""
        return None

    @property
    def baseline_tries(self) -> int | None:
        """How many candidates the random baseline `random-best` judges: by default as many as the attack."""
        return self.query_budget

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


def lidar_traits(attack_class: type[LidarAttack]) -> LidarTraits:
    """The traits of a class."""
    found: LidarTraits = vars(attack_class)["traits"]
    return found
