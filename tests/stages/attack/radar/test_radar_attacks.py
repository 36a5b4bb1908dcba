"""Attacks on the radars of a drive: what they change, what they label, what verify and evaluate say."""

from __future__ import annotations

import shutil
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow.parquet as pq
import pytest

from advpipe.pipeline.bag.reader import BagReader
from advpipe.pipeline.core.errors import AdvpipeError, UsageError
from advpipe.pipeline.messages.radar import StampedScan, scan_from_cdr
from advpipe.pipeline.scenario.attacks import AttackSpec, Schedule
from advpipe.stages.attack.base import Attack
from advpipe.stages.attack.radar.base import RadarAttack, RadarTraits, kept_returns
from advpipe.stages.attack.run import AttackRequest, attack
from advpipe.stages.evaluate.coordinated.attack_timeline import read_attack_timelines
from advpipe.stages.evaluate.coordinated.section import coordinated_sections
from advpipe.stages.evaluate.options import Options
from advpipe.stages.evaluate.run import evaluate
from advpipe.stages.verify.run import verify

FRONT, SIDE = "/ego/front/scan", "/ego/side/scan"


class Blind(RadarAttack):
    """Removes every return."""

    traits = RadarTraits()

    def __init__(self, *, limit: float = 1e6) -> None:
        self.limit = limit

    @property
    def bounds(self) -> dict[str, tuple[float, float]]:
        return {"returns_removed": (0, self.limit)}

    def begin(self, rng: np.random.Generator) -> Any:
        return lambda returns, context: kept_returns(returns, np.zeros(len(returns), bool))


def scans(bag: Path, topic: str = FRONT) -> list[StampedScan]:
    return [scan_from_cdr(raw.cdr) for raw in BagReader(bag).raw_messages([topic])]


def pairs(drive: Path, name: str, topic: str = FRONT) -> Iterator[tuple[bool, StampedScan, StampedScan]]:
    """Whether each scan is in the schedule, and the scan in both bags."""
    clean, attacked = scans(drive / "clean", topic), scans(drive / name, topic)
    start_ns = clean[0].stamp_ns
    for before, after in zip(clean, attacked, strict=True):
        yield 0.4 <= (before.stamp_ns - start_ns) / 1e9 < 1.0, before, after


def labels(bag: Path) -> list[dict[str, Any]]:
    return pq.read_table(bag / "radar_labels.parquet").to_pylist()


def test_the_drive_has_scans_at_the_rates_of_its_radars(radar_drive: Path) -> None:
    counts = {topic: len(scans(radar_drive / "clean", topic)) for topic in (FRONT, SIDE)}
    assert counts == {FRONT: 12, SIDE: 6}
    assert all(len(one.returns) for one in scans(radar_drive / "clean", SIDE))


def test_a_forged_car_comes_nearer_with_the_doppler_of_that(radar_drive: Path) -> None:
    added_m, added_mps = [], []
    for number, (active, before, after) in enumerate(pairs(radar_drive, "spoof")):
        assert (np.diff(after.returns["range"]) >= 0).all()  # as the radar sorts them
        is_forged = ~np.isin(after.returns, before.returns)
        assert (after.returns[~is_forged] == before.returns).all()
        forged = after.returns[is_forged]
        assert active or not len(forged)
        if len(forged):
            added_m.append((number - 4, float(forged["range"].mean())))
            added_mps += forged["velocity"].tolist()
    steps, ranges_m = np.array(added_m).T
    assert len(steps) >= 3
    assert ranges_m == pytest.approx(30 - 1.0 * steps, abs=0.5)  # 10 m/s, ten scans a second
    assert added_mps == pytest.approx([-10.0] * len(added_mps), abs=0.15)
    assert [one.returns.tobytes() for one in scans(radar_drive / "spoof", SIDE)] == [
        one.returns.tobytes() for one in scans(radar_drive / "clean", SIDE)
    ]


def test_jamming_leaves_what_is_strong(radar_drive: Path) -> None:
    """20 dB more noise: what had less than the threshold of 12 dB over it vanishes nearly always."""
    weak = strong = weak_left = strong_left = 0
    for active, before, _ in pairs(radar_drive, "jam", SIDE):
        if active:
            weak += int((before.returns["amplitude"] < 25).sum())
            strong += int((before.returns["amplitude"] > 45).sum())
    changed = [
        row for row in labels(radar_drive / "jam") if row["topic"] == SIDE and row["action"] == "changed"
    ]
    clean = scans(radar_drive / "clean", SIDE)
    for row in changed:
        was_db = clean[row["scan"]].returns["amplitude"][row["clean"]]
        weak_left += was_db < 25
        strong_left += was_db > 45
        assert row["amplitude_db"] == pytest.approx(was_db - 20, abs=12)
    assert weak > 20
    assert weak_left < 0.1 * weak
    assert strong_left > 0.9 * strong


def test_deletion_removes_the_returns_of_one_road_user(radar_drive: Path) -> None:
    removed = labels(radar_drive / "delete")
    assert {row["action"] for row in removed} == {"removed"}
    assert {row["attack"] for row in removed} == {"radar-delete"}
    count = 0
    for active, before, after in pairs(radar_drive, "delete"):
        assert len(after.returns) == len(before.returns) or active
        count += len(before.returns) - len(after.returns)
    assert count == sum(row["topic"] == FRONT for row in removed)
    spread_m = np.ptp([row["range_m"] for row in removed if row["topic"] == FRONT])
    assert spread_m < 30  # one road user, not all


def test_all_else_is_copied_and_the_bags_verify(radar_drive: Path) -> None:
    found = verify(radar_drive)
    assert found.is_good, found.findings


@pytest.mark.parametrize("radar", ["front", "side"])
def test_an_attack_on_either_radar_verifies(radar: str, radar_drive: Path, tmp_path: Path) -> None:
    """Whatever order the scans of an instant have in the attacked bag."""
    shutil.copytree(radar_drive / "clean", tmp_path / "clean")
    spec = AttackSpec(type="radar-jam", parameters={"radar": radar})
    attack(tmp_path / "clean", tmp_path / "jam", AttackRequest((spec,)))
    for topic in (FRONT, SIDE):
        before, after = (
            sum(len(one.returns) for one in scans(tmp_path / each, topic)) for each in ("clean", "jam")
        )
        assert (after < before) == (topic == f"/ego/{radar}/scan")
    assert [one for one in verify(tmp_path).findings if one.check != "scenario"] == []


@pytest.mark.parametrize(
    ("name", "damage", "what"),
    [
        ("spoof", lambda row: {**row, "range_m": row["range_m"] + 1}, "misstates its return"),
        ("delete", lambda row: {**row, "attack": "radar-jam"}, "of radar-jam, which was not active"),
        ("delete", lambda row: {**row, "clean": 0}, "misstates its return|confuses|without a label"),
        ("jam", lambda row: {**row, "stamp_ns": row["stamp_ns"] + 1}, "with another stamp"),
        ("jam", lambda row: {**row, "action": "moved"}, "unknown action moved"),
        ("spoof", lambda row: None, "more or fewer returns than its labels say"),
    ],
)
def test_verify_finds_labels_that_are_wrong(
    name: str, damage: Any, what: str, radar_drive: Path, tmp_path: Path
) -> None:
    import re

    import pyarrow as pa

    for each in ("clean", name):
        shutil.copytree(radar_drive / each, tmp_path / each)
    path = tmp_path / name / "radar_labels.parquet"
    table = pq.read_table(path)
    rows = table.to_pylist()
    last = damage(rows[-1])
    pq.write_table(pa.Table.from_pylist(rows[:-1] + ([last] if last else []), table.schema), path)
    found = [one.what for one in verify(tmp_path / name).findings if one.check == "scans"]
    assert len(found) == 1
    assert re.search(what, found[0]), found


def test_the_report_says_what_radars_lose_and_see_besides(radar_drive: Path, tmp_path: Path) -> None:
    bags = [radar_drive / name for name in ("spoof", "jam", "delete")]
    report = evaluate(radar_drive / "clean", bags, tmp_path / "report", Options())
    rows = {(row["bag"], row["radar"]): row for row in report.to_dicts("radar")}
    assert set(rows) == {
        ("spoof", "front"),
        *((bag, r) for bag in ("jam", "delete") for r in ("front", "side")),
    }
    spoof, delete = rows["spoof", "front"], rows["delete", "front"]
    assert (spoof["scans"], spoof["attacked_scans"]) == (12, 6)
    assert spoof["returns"] == pytest.approx(spoof["returns_clean"] + spoof["added"])
    assert spoof["ghosts"] >= spoof["ghosts_clean"]
    assert delete["returns"] == pytest.approx(delete["returns_clean"] - delete["removed"])
    detected = {(r["bag"], r["radar"], r["class"], r["range"]): r for r in report.to_dicts("radar_detection")}
    whole = detected["jam", "side", "all", "all"]
    assert whole["detected"] < whole["detected_clean"]
    assert whole["lost"] >= whole["detected_clean"] - whole["detected"]
    assert whole["objects"] == sum(
        row["objects"]
        for key, row in detected.items()
        if key[:2] == ("jam", "side") and key[2] != "all" and key[3] == "all"
    )
    again = evaluate(radar_drive / "clean", bags, tmp_path / "again", Options())
    assert again.to_json() == report.to_json()


def test_radars_and_gps_are_attacked_at_the_same_moment(radar_drive: Path, tmp_path: Path) -> None:
    """A coordinated attack is on one time axis, in the bag and in the report."""
    schedule = Schedule(from_s=0.4, to_s=1.0)
    specs = (
        AttackSpec(type="gnss-bias", victim="ego", schedule=schedule),
        AttackSpec(type="radar-spoof", victim="ego", schedule=schedule, parameters={"radar": "front"}),
    )
    clean, bag = radar_drive / "clean", tmp_path / "both"
    attack(clean, bag, AttackRequest(specs))
    fixes, of_radar = read_attack_timelines(BagReader(clean), bag)["ego"]
    assert (fixes.what, of_radar.what) == ("fixes", "scans")
    assert of_radar.attacks == ("radar-spoof",)
    assert set(of_radar.times_ns) <= set(fixes.times_ns)
    (section,) = coordinated_sections(clean, [bag])
    (record,) = section.records
    row = record.record()
    assert row["attacks"]["scans"] == ("radar-spoof",)
    assert row["attacked_scans"] == len(of_radar.times_ns)
    assert row["returns_touched"] >= 1


def test_same_seed_same_bytes(radar_drive: Path, tmp_path: Path) -> None:
    spec = AttackSpec(type="radar-jam", parameters={"radar": "front"})
    for name, seed in (("a", 1), ("b", 1), ("c", 2)):
        attack(radar_drive / "clean", tmp_path / name, AttackRequest((spec,), seed=seed))
    a, b, c = ([one.returns.tobytes() for one in scans(tmp_path / name)] for name in "abc")
    assert a == b != c
    assert labels(tmp_path / "a") == labels(tmp_path / "b")


def test_two_attacks_act_one_after_the_other(radar_drive: Path, tmp_path: Path) -> None:
    """Of what the first adds, the second removes all, and no label of it stays."""
    specs = (
        AttackSpec(type="radar-spoof", parameters={"radar": "front"}),
        AttackSpec(type=f"{__name__}:Blind", victim="ego"),
    )
    attack(radar_drive / "clean", tmp_path / "both", AttackRequest(specs))
    assert all(not len(one.returns) for one in scans(tmp_path / "both"))
    assert {(row["attack"], row["action"]) for row in labels(tmp_path / "both")} == {
        (f"{__name__}:Blind", "removed")
    }
    assert issubclass(Blind, Attack)


@pytest.mark.parametrize(
    ("keys", "what"),
    [
        ({"type": "radar-spoof", "parameters": {"range_m": 1.0}}, "radar-spoof: range_m is 1.0; it takes"),
        ({"type": "radar-jam", "parameters": {"noise_rise_db": -3.0}}, "noise_rise_db is -3.0; it takes"),
        (
            {"type": "radar-jam", "parameters": {"radar": "frnt"}},
            "ego has no radar 'frnt'; did you mean 'front'",
        ),
        ({"type": "radar-delete", "victim": "bus"}, "bus has no radar in"),
        (
            {"type": "radar-delete", "parameters": {"target": "nobody"}},
            "no attacked scan of /ego/front/scan has a road user 'nobody'",
        ),
        ({"type": "radar-jam", "recipe": "best"}, "radar-jam has no use for recipe"),
        ({"type": "radar-jam", "schedule": {"from_s": 50}}, "begins at 50 s, but the recording ends"),
        (
            {"type": f"{__name__}:Blind", "parameters": {"limit": 1}},
            "went beyond its bounds: returns removed",
        ),
    ],
)
def test_mistakes_are_one_line(keys: dict[str, Any], what: str, radar_drive: Path, tmp_path: Path) -> None:
    with pytest.raises(AdvpipeError) as error:
        attack(radar_drive / "clean", tmp_path / "out", AttackRequest((AttackSpec.model_validate(keys),)))
    assert what in str(error.value)
    assert "\n" not in str(error.value)
    assert not (tmp_path / "out").exists()


def test_a_bag_without_radars_is_refused(clean_bag: Path, tmp_path: Path) -> None:
    with pytest.raises(UsageError, match="has no radar"):
        attack(clean_bag, tmp_path / "out", AttackRequest((AttackSpec(type="radar-jam"),)))
