"""The drives of the benchmark of misbehaviour detection, their attacks, and what detectors find in them."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import NamedTuple, TypeVar

from advpipe.pipeline.bag.reader import BagReader
from advpipe.pipeline.core.errors import AdvpipeError
from advpipe.pipeline.core.jobs import map_jobs
from advpipe.pipeline.labels.messages import are_false, read_labels
from advpipe.pipeline.misbehaviour.detectors import MISBEHAVIOUR_DETECTORS, OURS
from advpipe.pipeline.misbehaviour.tuning import Stream
from advpipe.pipeline.misbehaviour.verdicts import MisbehaviourDetector
from advpipe.pipeline.replay.v2x_attackers import AttackerSelection
from advpipe.pipeline.replay.v2x_drive import V2xDrive
from advpipe.pipeline.scenario import load_scenario
from advpipe.pipeline.scenario.attacks import AttackSpec, Schedule
from advpipe.stages.attack.gnss.base import gnss_traits
from advpipe.stages.attack.gnss.registry import GNSS_ATTACKS
from advpipe.stages.attack.request import AttackRequest
from advpipe.stages.attack.run import attack
from advpipe.stages.attack.v2x.registry import V2X_ATTACKS
from advpipe.stages.evaluate.v2x.detection import Detection, detect
from advpipe.stages.evaluate.v2x.receptions import read_receptions
from advpipe.stages.simulate.run import simulate

NO_LIDAR = (
    *("sensors.lidars={}", "recording.markers=false", "traffic.pedestrians=0", "traffic.parked_per_km=0"),
    "environment.buildings=0",
)
LISTENERS = "vehicles={ego: {}, other: {}}"
"""Two receivers; the GNSS of the second one, which runs its own filter, is spoofed."""
FROM_S = 3.0
"""Attacks begin when the first honest messages have been received."""
PUBLISHED: dict[str, dict[str, str | int]] = {"cam-sybil-congestion": {"first_copy": 0}}
"""Parameters of presets: ghost vehicles that come 2 to 200 s late are few in a short drive."""
T = TypeVar("T")


class Site(NamedTuple):
    """A drive of a shipped scenario with other settings."""

    place: str
    seed: int
    scenario: str = "boulevard"
    settings: tuple[str, ...] = ()
    is_fast: bool = False

    @property
    def name(self) -> str:
        return f"{self.place}-{self.seed}"


def _generated(kind: str, seed: int, size: int, block_m: float, lanes: int, speed_mps: float = 13.89) -> Site:
    network = f"{{kind: {kind}, size: {size}, block_m: {block_m}, lanes: {lanes}, speed_mps: {speed_mps}}}"
    settings = ("map.sumo_net=null", f"map.generator={network}")
    return Site(kind, seed, settings=settings, is_fast=speed_mps > 20)


TUNING = (
    _generated("spider", 21, size=6, block_m=160, lanes=2),
    _generated("grid", 22, size=4, block_m=180, lanes=2),
    _generated("random", 23, size=6, block_m=150, lanes=1),
    _generated("grid", 24, size=3, block_m=700, lanes=3, speed_mps=36.11),
)
"""Streets of a town, and a grid of fast roads, so that our thresholds do not flag honest motorway traffic.
The baseline is
tuned on the towns alone: its published tolerance shrinks above 11 m/s and is zero at 37 m/s, so that no
parameters meet the bound on the fast roads, and those that come closest would make it weaker everywhere
else."""
BOULEVARD = tuple(Site("boulevard", seed) for seed in (1, 91, 92))
HONEST = (Site("highway", 3, "highway"),)


class MisbehaviourDrives:
    """The drives and their bags, below one folder; existing ones are not made again."""

    def __init__(
        self, folder: Path, seconds: float, attack_names: Sequence[str], workers: int | None
    ) -> None:
        self._folder, self.seconds = folder, seconds
        self._attack_names, self._workers = attack_names, workers
        folder.mkdir(parents=True, exist_ok=True)

    def heard(self, *, is_fast: bool) -> list[Stream]:
        """What was received in the drives of `TUNING`, either the fast ones or the others: by both listeners
        where no one attacks, and by the first one under attack."""
        attack_names = ["", *self._attack_names]
        sites = [site for site in TUNING if site.is_fast == is_fast]
        return [
            stream
            for site in sites
            for each in self._each(site, attack_names, _streams)
            for stream in each or ()
        ]

    def test(self, site: Site, detectors: Mapping[str, MisbehaviourDetector]) -> dict[str, Detection]:
        """Results by attack name; those of the clean drive are under the empty name."""
        attack_names = ["", *self._attack_names]
        made = self._each(site, attack_names, partial(_detection, detectors))
        return {
            attack_name: found
            for attack_name, found in zip(attack_names, made, strict=True)
            if found is not None
        }

    def heard_honestly(self, site: Site) -> list[Stream]:
        """What both listeners receive in a drive in which no one attacks."""
        return _streams(self._clean(site), "")

    def honest(self, site: Site, detectors: Mapping[str, MisbehaviourDetector]) -> Detection:
        """The result on a drive without an attack."""
        return _detection(detectors, self._clean(site), "")

    def seconds_a_minute(self, site: Site) -> float:
        """Seconds of processor time to check one minute of one receiver's messages."""
        one = read_receptions(BagReader(self._clean(site)))[0]
        start_s = time.process_time()
        MISBEHAVIOUR_DETECTORS[OURS].judge(one.claims, one.receivers)
        return (time.process_time() - start_s) * 60 / self.seconds

    def _clean(self, site: Site) -> Path:
        folder = self._folder / f"{site.name}-{self.seconds:g}s"
        if not (folder / "clean").exists():
            settings = [*NO_LIDAR, LISTENERS, *site.settings]
            settings += [f"simulation.seed={site.seed}", f"simulation.duration_s={self.seconds}"]
            simulate(load_scenario(site.scenario, settings), folder)
        return folder / "clean"

    def _each(
        self, site: Site, attack_names: Sequence[str], look: Callable[[Path, str], T]
    ) -> list[T | None]:
        clean = self._clean(site)
        work = partial(partial, _attacked, clean, site.seed, attack_names, look)
        return map_jobs(work, range(len(attack_names)), site.name, self._workers)


def _attacked(
    clean: Path, seed: int, attack_names: Sequence[str], look: Callable[[Path, str], T], place: int
) -> T | None:
    """The result of one attack on a drive, "" for the clean drive; None where the attack is not possible."""
    attack_name = attack_names[place]
    bag = clean.parent / attack_name if attack_name else clean
    try:
        if not bag.exists():
            attack(clean, bag, AttackRequest(_specs(attack_name, clean, seed), seed=seed))
    except AdvpipeError as error:
        print(f"{clean.parent.name}: {attack_name} left out: {error}", file=sys.stderr)
        return None
    return look(bag, attack_name)


def _specs(attack_name: str, clean: Path, seed: int) -> tuple[AttackSpec, ...]:
    """An attack by a fifth of the fleet: false messages, as NextGen publishes them where it does and with our
    defaults otherwise, or as many vehicles with false GNSS.

    Messages are aimed at the ego where they need a victim. Beside the instrumented listener, the vehicles
    whose GNSS is spoofed are those that otherwise send false messages; an attack that needs a filter is
    aimed at the instrumented listener alone.
    """
    schedule = Schedule(from_s=FROM_S)
    if attack_name in V2X_ATTACKS:
        parameters: dict[str, str | int] = {}
        if "nextgen" in V2X_ATTACKS[attack_name].presets:
            parameters = {"preset": "nextgen", **PUBLISHED.get(attack_name, {})}
        return (AttackSpec(type=attack_name, parameters=parameters, schedule=schedule, victim="ego"),)
    victims = ["other"]
    if not gnss_traits(GNSS_ATTACKS[attack_name]).needs_filter:
        selection = AttackerSelection(V2xDrive(BagReader(clean)), str(clean), seed)
        victims += [selection.names[number] for number in selection.attackers(AttackSpec(type="cam-drop"))]
    return tuple(AttackSpec(type=attack_name, schedule=schedule, victim=victim) for victim in victims)


def _streams(bag: Path, attack_name: str) -> list[Stream]:
    labels = read_labels(bag)
    heard = read_receptions(BagReader(bag))
    return [
        Stream(one.claims, one.receivers, are_false(one.numbers, labels), attack_name)
        for one in (heard[:1] if attack_name else heard)
    ]


def _detection(detectors: Mapping[str, MisbehaviourDetector], bag: Path, attack_name: str) -> Detection:
    del attack_name
    found = detect(read_receptions(BagReader(bag)), read_labels(bag), detectors)
    return replace(found, verdicts=())
