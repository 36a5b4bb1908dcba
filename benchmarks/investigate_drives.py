"""The drives of the benchmark of `advpipe investigate`, their attacks, and who truly lies in them."""

from __future__ import annotations

import pickle
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

import advpipe
from advpipe.pipeline.bag.reader import BagReader
from advpipe.pipeline.bag.receptions import recorded_receptions
from advpipe.pipeline.core.bounded_parquet import ColumnType, rows
from advpipe.pipeline.labels import fixes
from advpipe.pipeline.labels.clouds import FRAMES
from advpipe.pipeline.labels.messages import read_labels
from advpipe.pipeline.scenario.attacks import AttackSpec, attack_spec
from advpipe.pipeline.v2x.message_type import MESSAGE_TYPES, claimed_station_id
from advpipe.stages.attack.registry import default_budget
from advpipe.stages.attack.run import AttackRequest, attack
from advpipe.stages.investigate.cue import GNSS, CueReading, Suspect, station
from advpipe.stages.investigate.evidence_topics import find_evidence
from advpipe.stages.investigate.registry import CUES
from advpipe.stages.investigate.situation import PriorKnowledge, read_situations

VEHICLE = "ego"
FROM_S, TO_S = 5.0, 12.0
LIDAR = "sensors.lidars={lidar: {channels: 32, points_per_second: 288000}}"

V2X = (
    *("cam-position-offset", "cam-position-constant", "cam-position-random-offset", "cam-speed-offset"),
    *("cam-heading-reversed", "cam-sudden-stop", "cam-replay", "cam-masquerade", "cam-dos"),
    *("cam-dos-random-sybil", "cam-sybil-grid", "cam-sybil-congestion", "cam-ghost-stop", "cam-ghost-brake"),
)
GNSS_WORDS = (
    *("gnss-bias", "gnss-relocate", "gnss-drift", "gnss-drift-aware", "gnss-jump", "gnss-walk"),
    *("gnss-replay", "gnss-freeze"),
)
LIDAR_WORDS = ("detach", "perturb", "attach")
ATTACKS = (*V2X, *GNSS_WORDS, *LIDAR_WORDS)

MORE = (
    *("cam-position-random", "cam-position-mirrored", "cam-speed-constant", "cam-speed-random"),
    *("cam-speed-random-offset", "cam-speed-frozen", "cam-heading-rotating", "cam-acceleration"),
    *("cam-feigned-braking", "cam-dimensions", "cam-out-of-range", "cam-eventual-stop", "cam-mix"),
    *("cam-disruptive-replay", "cam-stale", "cam-delay", "cam-drop", "cam-dos-random", "cam-dos-disruptive"),
    *("cam-dos-disruptive-sybil", "cam-sybil-replay", "gnss-jam"),
)
"""Attacks that nothing is tuned on; the evaluation covers them, too."""


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
            *("attacks={}", LIDAR, "vehicles={ego: {}, other: {}}"),
            *(f"simulation.seed={seed}", f"simulation.duration_s={duration_s}", *more),
        ),
    )


def _generated(kind: str, size: int, block_m: float, lanes: int) -> tuple[str, str]:
    network = f"{{kind: {kind}, size: {size}, block_m: {block_m}, lanes: {lanes}}}"
    return "map.sumo_net=null", f"map.generator={network}"


GRID, SPIDER = _generated("grid", 4, 180, 2), _generated("spider", 6, 160, 2)

TUNING = (
    _site("d711", "coordinated", 711, "traffic.vehicles=110"),
    _site("d712", "district", 712),
    _site("d713", "boulevard", 713, "traffic.vehicles=60", duration_s=40),
)
"""The boulevard and a random network."""

TESTS = (
    _site("t811", "boulevard", 811, *GRID, "traffic.vehicles=110"),
    _site("t812", "boulevard", 812, *SPIDER, "traffic.vehicles=110"),
)
"""A grid and a spider's web, on which nothing was tuned."""


def coordinated_sites(count: int) -> list[tuple[InvestigatedSite, tuple[str, ...]]]:
    """Drives on both test maps, and the three attacks that lie together in each."""
    pairs = []
    for number in range(count):
        network = (GRID, SPIDER)[number % 2]
        site = _site(f"c{number:02d}", "boulevard", 900 + number, *network, "traffic.vehicles=110")
        words = V2X[(5 * number + 11) % len(V2X)], GNSS_WORDS[number % len(GNSS_WORDS)]
        pairs.append((site, (*words, LIDAR_WORDS[number % 3])))
    return pairs


def clean_sites(whole_s: float) -> list[InvestigatedSite]:
    """Clean drives of 300 s on both test maps, as many as make the whole time."""
    return [
        _site(
            *(f"h{number:02d}", "boulevard", 1000 + number, *(GRID, SPIDER)[number % 2]),
            "traffic.vehicles=60",
            duration_s=min(300.0, whole_s - start_s),
        )
        for number, start_s in enumerate(range(0, int(whole_s), 300))
    ]


def recorded(folder: Path, site: InvestigatedSite) -> Path:
    """The clean bag of a site, recorded if it is not there."""
    if not (folder / site.name / "clean" / "metadata.yaml").exists():
        print(f"recording {site.name} ...", flush=True)
        advpipe.simulate(site.scenario, settings=list(site.settings), out=folder / site.name, overwrite=True)
    return folder / site.name / "clean"


def attacked(folder: Path, site: InvestigatedSite, words: Sequence[str]) -> Iterator[Path]:
    """Yield the bags of a site with one attack each, made if they are not there."""
    clean = recorded(folder, site)
    for word in words:
        out = folder / site.name / word
        if not (out / "metadata.yaml").exists():
            _attack(clean, out, word)
        yield out


def together(folder: Path, site: InvestigatedSite, words: Sequence[str]) -> Path:
    """The bag of a site in which attacks of three families lie in the same seconds."""
    clean, out = recorded(folder, site), folder / site.name / "+".join(words)
    if not (out / "metadata.yaml").exists():
        _attack(clean, out, *words)
    return out


def _attack(clean: Path, out: Path, *words: str) -> None:
    print(f"attacking {out} ...", flush=True)
    attack(clean, out, AttackRequest(tuple(map(_spec, words))), overwrite=True, workers=1)


def _spec(word: str) -> AttackSpec:
    of_lidar = {"recipe": "random-near", "frames": "::2"} if word in LIDAR_WORDS else {}
    return attack_spec(
        {
            "type": word,
            "parameters": default_budget(word),
            "schedule": {"from_s": FROM_S, "to_s": TO_S},
            "victim": VEHICLE,
            **of_lidar,
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
    """All lies that reach the vehicle, by the labels of a bag."""
    found: dict[Suspect, TrueLie] = {}
    for suspect, word, time_ns in _false_times(bag):
        known = found.get(suspect, TrueLie(suspect, word, time_ns, time_ns))
        found[suspect] = TrueLie(
            suspect, known.attack, min(known.start_ns, time_ns), max(known.end_ns, time_ns)
        )
    return list(found.values())


def _false_times(bag: Path) -> Iterator[tuple[Suspect, str, int]]:
    """Each false thing that the vehicle received or measured: by whom, the attack and the time."""
    labels = {label.number: label for label in read_labels(bag) if label.is_false}
    reader = BagReader(bag)
    for kind in MESSAGE_TYPES.values() if labels else ():
        for one in recorded_receptions(reader, VEHICLE, kind=kind):
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


_DECIDING = {"situation.py", "observations.py", "judged_scan.py", "map_anchor.py", "evidence_topics.py"} | {
    f"{name.replace('-', '_')}.py" for name in CUES
}
