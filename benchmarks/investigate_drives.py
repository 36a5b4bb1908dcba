"""The drives of the benchmark of `advpipe investigate`, their attacks, and who truly lies in them."""

from __future__ import annotations

import pickle
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple
from zlib import crc32

import advpipe
from advpipe.pipeline.bag.reader import BagReader
from advpipe.pipeline.bag.receptions import recorded_receptions
from advpipe.pipeline.core.bounded_parquet import ColumnType, rows
from advpipe.pipeline.labels import fixes
from advpipe.pipeline.labels.clouds import FRAMES
from advpipe.pipeline.labels.messages import read_labels
from advpipe.pipeline.scenario.attacks import AttackSpec, attack_spec
from advpipe.pipeline.v2x.message_type import MESSAGE_TYPES, claimed_station_id
from advpipe.stages.attack.gnss.registry import GNSS_ATTACKS
from advpipe.stages.attack.registry import default_budget
from advpipe.stages.attack.run import AttackRequest, attack
from advpipe.stages.attack.v2x.registry import V2X_ATTACKS
from advpipe.stages.investigate.cue import GNSS, CueReading, Suspect, station
from advpipe.stages.investigate.evidence_topics import find_evidence
from advpipe.stages.investigate.registry import CUES
from advpipe.stages.investigate.situation import PriorKnowledge, read_situations

VEHICLE = "ego"
LIDAR = "sensors.lidars={lidar: {channels: 32, points_per_second: 144000}}"
EARLIEST_S, LATEST_S = 4.0, 8.0
"""A lie begins between these times, elsewhere in each bag."""
LIE_S, CLOUD_LIE_S = 6.0, 2.0
"""How long it lasts; that of a LiDAR is shorter, as it takes a second of work for each cloud (half a second
with recipes that search)."""

V2X = tuple(name for name in V2X_ATTACKS if name.startswith("cam-"))
GNSS_WORDS = tuple(GNSS_ATTACKS)
LIDAR_WORDS = ("detach", "perturb", "attach")
ATTACKS = (*V2X, *GNSS_WORDS, *LIDAR_WORDS)
PERCEPTION = tuple(name for name in V2X_ATTACKS if not name.startswith("cam-"))
"""Attacks on CPMs and DENMs, in drives of their own."""
SEARCHED = tuple(f"{word}:{recipe}" for word in ("attach", "detach") for recipe in ("best", "stealthy"))
"""LiDAR attacks that search with the shipped detector, of which each cloud takes many seconds."""

COORDINATED = 12
"""Drives with three attacks at once."""
TOGETHER = (
    *("cam-position-offset", "cam-position-constant", "cam-position-random-offset", "cam-speed-offset"),
    *("cam-heading-reversed", "cam-sudden-stop", "cam-replay", "cam-masquerade", "cam-dos"),
    *("cam-dos-random-sybil", "cam-sybil-grid", "cam-sybil-congestion", "cam-ghost-stop", "cam-ghost-brake"),
)
"""Attacks on CAMs that a coordinated drive combines with one on the GNSS and one on the LiDAR."""


class InvestigatedSite(NamedTuple):
    """A drive of a shipped scenario with other settings."""

    name: str
    scenario: str
    settings: tuple[str, ...]


def _site(name: str, scenario: str, seed: int, *more: str, duration_s: float = 16) -> InvestigatedSite:
    return InvestigatedSite(
        name,
        scenario,
        (
            *("attacks={}", LIDAR, "vehicles={ego: {}}", "traffic.pedestrians=15"),
            *(f"simulation.seed={seed}", f"simulation.duration_s={duration_s}", *more),
        ),
    )


def _generated(kind: str, size: int, block_m: float, lanes: int) -> tuple[str, str]:
    network = f"{{kind: {kind}, size: {size}, block_m: {block_m}, lanes: {lanes}}}"
    return "map.sumo_net=null", f"map.generator={network}"


GRID, SPIDER = _generated("grid", 3, 210, 2), _generated("spider", 4, 150, 2)
CARS, FEWER_CARS = "traffic.vehicles=80", "traffic.vehicles=50"
MESSAGES = ("traffic.vehicles=40", "v2x.cpm={}", "v2x.denm={}")

TUNING = (
    _site("d711", "boulevard", 711, CARS),
    _site("d712", "district", 712, CARS),
)
"""The boulevard and a random network; each attack is made on one of them."""
TUNING_PERCEPTION = (_site("d731", "boulevard", 731, *MESSAGES, duration_s=14),)
TUNING_CLEAN = (
    _site("d721", "boulevard", 721, "traffic.vehicles=60", duration_s=60),
    _site("d722", "district", 722, "traffic.vehicles=60", duration_s=60),
)
LOOKED_AT_CLEAN = tuple(
    _site(f"e{number:02d}", ("boulevard", "district")[number % 2], 740 + number, FEWER_CARS, duration_s=150)
    for number in range(24)
)
"""An hour on the tuning maps whose false alarms were looked at one by one; nothing is fitted to it."""

TESTS = (
    _site("t811", "boulevard", 811, *GRID, FEWER_CARS),
    _site("t812", "boulevard", 812, *SPIDER, FEWER_CARS),
)
"""A grid and a spider's web. Nothing was fitted to them, nor the checks of CAMs (`misbehaviour_drives.py`);
docs/investigate.md names the one rule that was chosen after a look at them."""
TEST_PERCEPTION = (_site("t831", "boulevard", 831, *GRID, *MESSAGES, duration_s=14),)


def coordinated_sites(count: int) -> list[tuple[InvestigatedSite, tuple[str, ...]]]:
    """Drives on both test maps, and the three attacks that lie together in each."""
    pairs = []
    for number in range(count):
        network = (GRID, SPIDER)[number % 2]
        site = _site(f"c{number:02d}", "boulevard", 900 + number, *network, FEWER_CARS)
        words = TOGETHER[(5 * number + 11) % len(TOGETHER)], GNSS_WORDS[number % len(GNSS_WORDS)]
        pairs.append((site, (*words, LIDAR_WORDS[number % 3])))
    return pairs


def clean_sites(whole_s: float) -> list[InvestigatedSite]:
    """Clean drives of 150 s on both test maps, as many as make the whole time."""
    return [
        _site(
            *(f"h{number:02d}", "boulevard", 1000 + number, *(GRID, SPIDER)[number % 2]),
            FEWER_CARS,
            duration_s=min(150.0, whole_s - start_s),
        )
        for number, start_s in enumerate(range(0, int(whole_s), 150))
    ]


@dataclass(frozen=True)
class DriveFolder:
    """Where the bags are. makes: whether those that are not there are made, or left out."""

    path: Path
    makes: bool = True

    def clean(self, site: InvestigatedSite) -> Iterator[Path]:
        """Yield the clean bag of a site."""
        out = self.path / site.name
        if not (out / "clean" / "metadata.yaml").exists() and self.makes:
            print(f"recording {site.name} ...", flush=True)
            advpipe.simulate(site.scenario, settings=list(site.settings), out=out, overwrite=True)
        if (out / "clean" / "metadata.yaml").exists():
            yield out / "clean"

    def attacked(self, site: InvestigatedSite, *words: str) -> Iterator[Path]:
        """Yield the bag of a site in which these attacks lie in the same seconds."""
        for clean in self.clean(site):
            out = self.path / site.name / "+".join(words).replace(":", "-")
            if not (out / "metadata.yaml").exists() and self.makes:
                _attack(clean, out, *words)
            if (out / "metadata.yaml").exists():
                yield out

    def looked_at(self) -> Iterator[Path]:
        """Yield the clean bags of the hour on the tuning maps."""
        for site in LOOKED_AT_CLEAN:
            yield from self.clean(site)

    def tuning(self) -> Iterator[Path]:
        """Yield the bags that limits and weights are fitted to."""
        for number, site in enumerate(TUNING):
            yield from self.clean(site)
            for at, word in enumerate(ATTACKS):
                if (at % 3 == 0) == (number == 1):
                    yield from self.attacked(site, word)
        for site in TUNING_PERCEPTION:
            yield from self.clean(site)
            for word in PERCEPTION:
                yield from self.attacked(site, word)
        for site in TUNING_CLEAN:
            yield from self.clean(site)

    def tests(self) -> Iterator[tuple[str, Path]]:
        """Yield the attack and the bag of each drive with one attack."""
        for sites, words in ((TESTS, ATTACKS), (TEST_PERCEPTION, PERCEPTION), (TESTS[:1], SEARCHED)):
            for site in sites:
                for word in words:
                    for bag in self.attacked(site, word):
                        yield word, bag

    def coordinated(self, count: int) -> Iterator[Path]:
        """Yield the bags with three attacks at once."""
        for site, words in coordinated_sites(count):
            yield from self.attacked(site, *words)

    def clean_drives(self, whole_s: float) -> Iterator[Path]:
        """Yield the clean drives on the test maps."""
        for site in (*TESTS, *TEST_PERCEPTION, *(site for site, _ in coordinated_sites(COORDINATED))):
            yield from self.clean(site)
        for site in clean_sites(whole_s):
            yield from self.clean(site)


def _attack(clean: Path, out: Path, *words: str) -> None:
    print(f"attacking {out} ...", flush=True)
    start_s = EARLIEST_S + (LATEST_S - EARLIEST_S) * (crc32(out.name.encode()) % 100) / 100
    specs = tuple(_spec(word, start_s) for word in words)
    attack(clean, out, AttackRequest(specs), overwrite=True, workers=1)


def _spec(word: str, start_s: float) -> AttackSpec:
    name, _, recipe = word.partition(":")
    is_of_clouds = name in LIDAR_WORDS
    lasts_s = LIE_S if not is_of_clouds else 0.5 if recipe else CLOUD_LIE_S
    return attack_spec(
        {
            "type": name,
            "parameters": default_budget(name),
            "schedule": {"from_s": start_s, "to_s": start_s + lasts_s},
            "victim": VEHICLE,
            **({"recipe": recipe or "random-near"} if is_of_clouds else {}),
        }
    )


@dataclass(frozen=True)
class TrueLie:
    """Who lies in a bag, by which attack, and when the vehicle could first notice."""

    suspect: Suspect
    attack: str
    start_ns: int
    end_ns: int


def true_lies(bag: Path) -> list[TrueLie]:
    """All lies that reach the vehicle, by the labels of a bag; kept beside it."""
    cache = bag / "investigate-lies.pickle"
    if cache.exists():
        return pickle.loads(cache.read_bytes())
    found: dict[Suspect, TrueLie] = {}
    for suspect, word, time_ns in _false_times(bag):
        known = found.get(suspect, TrueLie(suspect, word, time_ns, time_ns))
        found[suspect] = TrueLie(
            suspect, known.attack, min(known.start_ns, time_ns), max(known.end_ns, time_ns)
        )
    cache.write_bytes(pickle.dumps(list(found.values())))
    return list(found.values())


def _false_times(bag: Path) -> Iterator[tuple[Suspect, str, int]]:
    """Each false thing that the vehicle received or measured: by whom, the attack and the time."""
    labels = {label.number: label for label in read_labels(bag) if label.is_false}
    reader = BagReader(bag)
    kinds = {label.attack.partition("-")[0] for label in labels.values()} & MESSAGE_TYPES.keys()
    for name in sorted(kinds):
        for one in recorded_receptions(reader, VEHICLE, kind=MESSAGE_TYPES[name]):
            if one.number in labels and one.payload is not None:
                number = claimed_station_id(one.payload)
                yield station(-1 if number is None else number), labels[one.number].attack, one.arrival_ns
    if (bag / fixes.FILE).exists():
        word = next(each for each in bag.name.split("+") if each.startswith("gnss-"))
        wanted: dict[str, ColumnType] = {"vehicle": "text", "stamp_ns": "whole", "mattered": "truth"}
        for row in rows(bag / fixes.FILE, wanted):
            if row["vehicle"] == VEHICLE and row["mattered"]:
                yield GNSS, word, row["stamp_ns"]
    if (bag / FRAMES).exists():
        columns: dict[str, ColumnType] = {"topic": "text", "stamp_ns": "whole", "attack": "text"}
        for row in rows(bag / FRAMES, columns):
            if row["attack"]:
                yield Suspect(row["topic"]), row["attack"], row["stamp_ns"]


CuedReading = tuple[str, CueReading]
"""The name of a cue, and its reading."""


def cued_readings(bag: Path) -> list[CuedReading]:
    """What all cues read in a bag, in time order; kept beside the bag, as tuning needs it again and again."""
    cache = bag / "investigate-readings.pickle"
    newest = max(path.stat().st_mtime for path in _sources())
    if cache.exists() and cache.stat().st_mtime > newest:
        return pickle.loads(cache.read_bytes())
    reader = BagReader(bag)
    topics = find_evidence(reader, VEHICLE)
    background = PriorKnowledge.of(reader, topics)
    cues = {name: cue(background) for name, cue in CUES.items() if all(map(topics.has, cue.needs))}
    found = [
        (name, reading._replace(picture=None))
        for situation in read_situations(reader, topics, background)
        for name, cue in cues.items()
        for reading in cue.judge(situation)
    ]
    cache.write_bytes(pickle.dumps(found))
    return found


def _sources() -> list[Path]:
    import advpipe.stages.investigate as package

    return [path for path in Path(package.__file__ or "").parent.rglob("*.py") if path.name in _DECIDING]


_DECIDING = {
    *("situation.py", "observations.py", "judged_scan.py", "map_anchor.py", "evidence_topics.py"),
    *("manoeuvres.py", "sight.py", "seen_vehicles.py"),
    *(f"{name.replace('-', '_')}.py" for name in CUES),
}
