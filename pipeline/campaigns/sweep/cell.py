"""One cell of a sweep: a recipe at a budget, with every value that tables and pictures need."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field, fields, replace
from pathlib import Path
from typing import Any

from advpipe.pipeline.core import plain_json
from advpipe.pipeline.detector.device import CPU
from advpipe.pipeline.results.deprecated import with_new_keys
from advpipe.pipeline.results.evaluation import plain_value
from advpipe.pipeline.results.metrics import CloudMetrics
from advpipe.pipeline.results.row import ResultRow
from advpipe.pipeline.results.stored import stored_row

LIMIT_BYTES = 1 << 24
"""The longest cell that is read: one of 100 frames has 40 kB."""


@dataclass(frozen=True)
class Settings:
    """The settings that a cell's values depend on, besides recipe and budget.

    clean_sha256: of the clean bag, as `parent_sha256` has it. detector: its name in reports. frames:
    start:stop:step, counted in the clean bag. seed: of the attack, the baselines and the bootstrap.
    baseline_tries: the best of so many is scored, None for the attack's query budget. advpipe,
    code_sha256: the version of this package, and of its code that attacks clouds and scores.
    device: what the detector computed on, cpu or cuda. lidar_height_m, level, scale_intensity: how clouds
    were presented to it, see `Adaptation`. defences, detect_attacks: what else was scored, by their texts.
    """

    clean_sha256: str
    detector: str
    detector_sha256: str
    frames: str
    seed: int
    baseline_tries: int | None
    lidar_topic: str | None
    advpipe: str
    code_sha256: str
    device: str = CPU
    lidar_height_m: float | None = None
    level: bool = False
    scale_intensity: float = 1.0
    defences: tuple[str, ...] = ()
    detect_attacks: tuple[str, ...] = ()


@dataclass(frozen=True)
class Cell:
    """The results of one cell.

    budget: a name of `budgets`. row: of the evaluation's report. bag_sha256: of the adversarial bag.
    frames, found_objects, lost_objects: of each frame that was scored, its index in the clean bag, how many
    objects the detector finds in the clean cloud, and how many of those the attack hides, both at loose
    overlap and a score of at least the row's `working_score`.
    map_ratio_draws: of the bootstrap, in percent; cells of the same frames and seed are drawn together.
    other_draws: the same at loose overlap (`loose`), and of the baseline to beat (`random_best`,
    `random_best_loose`); cells of older versions have none.
    listed: what the evaluation's report lists about the attack, by key, see `listed_results`; cells of older
    versions have none. commit: of advpipe's sources, by `source_commit`. What differs from run to run is not
    in it: see `Times`.
    """

    budget: str
    recipe: str
    settings: Settings
    row: ResultRow
    bag_sha256: str
    frames: tuple[int, ...]
    found_objects: tuple[int, ...]
    lost_objects: tuple[int, ...]
    map_ratio_draws: tuple[float | None, ...]
    other_draws: Mapping[str, Sequence[float | None]] = field(default_factory=dict)
    listed: Mapping[str, Sequence[Mapping[str, Any]]] = field(default_factory=dict)
    commit: str | None = None

    @property
    def attacked(self) -> CloudMetrics:
        """The attack's metrics: every cell has one."""
        assert self.row.attacked is not None
        return self.row.attacked

    @property
    def strongest_random(self) -> CloudMetrics | None:
        """Those of the baseline to beat; None without one."""
        name = self.row.strongest_baseline
        return None if name is None else self.row.metrics_of(name)

    @property
    def name(self) -> str:
        """Such as `best-perturb-10`."""
        return f"{self.recipe}-{self.budget}"

    def reproducible_values(self) -> dict[str, Any]:
        """All values that stay the same when the cell is computed again; not the commit, since most commits
        do not change this code."""
        return {key: value for key, value in self._record().items() if key != "commit"}

    def to_json(self) -> str:
        """The cell as a JSON document with sorted keys."""
        return json.dumps(self._record(), indent=1, sort_keys=True, allow_nan=False) + "\n"

    def _record(self) -> dict[str, Any]:
        record = {each.name: getattr(self, each.name) for each in fields(self)}
        return record | {"settings": asdict(self.settings), "row": plain_value(self.row.record())}

    @staticmethod
    def from_json(text: str, folder: Path) -> Cell:
        """A cell stored in this folder. Raises ValueError, KeyError or TypeError for invalid text."""
        stored = with_new_keys(plain_json.load_json(text, LIMIT_BYTES), folder)
        settings = Settings(**stored.pop("settings"))
        settings = replace(
            settings, defences=tuple(settings.defences), detect_attacks=tuple(settings.detect_attacks)
        )
        for key in ("frames", "found_objects", "lost_objects", "map_ratio_draws"):
            stored[key] = tuple(stored[key])
        for key in ("attack_s", "evaluate_s"):  # they stood here before there was a times.json
            stored.pop(key, None)
        row = stored_row(stored.pop("row"))
        if row.attacked is None:
            raise ValueError("a cell without an attack")
        return Cell(settings=settings, row=row, **stored)


@dataclass(frozen=True)
class Times:
    """Wall-clock time that the run which finished a cell took to attack and to evaluate.

    Of recipes that were evaluated together, each has an equal share of that time.
    """

    attack_s: float
    evaluate_s: float
