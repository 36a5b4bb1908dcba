"""Labels of every family that tell something else than the two bags, column by column."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pyarrow as pa
import pyarrow.compute as pc
import pyarrow.parquet as pq
import pytest

from advpipe.pipeline.bag.provenance_record import Provenance
from advpipe.pipeline.bag.reader import BagReader
from advpipe.pipeline.scenario.attacks import attack_spec
from advpipe.stages.attack.run import AttackRequest, attack
from advpipe.stages.verify.checks.base import BagCheck
from advpipe.stages.verify.checks.cams import CamsCheck
from advpipe.stages.verify.checks.fixes import Fixes
from advpipe.stages.verify.checks.points import Points
from advpipe.stages.verify.result import Fault
from advpipe.stages.verify.run import verify
from advpipe.stages.verify.subject import find_subject

POINTS, FRAMES = "labels.parquet", "frames.parquet"
CAMS, FIXES = "v2x_labels.parquet", "gnss_labels.parquet"
Attacks = list[dict[str, Any]]


def faults(bag: Path, check: type[BagCheck], change: Callable[[Attacks], None] | None = None) -> list[str]:
    """What one check finds. change: of the attacks that the bag names."""
    (subject,) = find_subject(bag).bags
    if change is not None:
        attacks = json.loads(subject.provenance["attacks"])
        change(attacks)
        subject.provenance = Provenance({**subject.provenance, "attacks": json.dumps(attacks)})
    return [found.what for found in check(subject).check() if isinstance(found, Fault)]


def other(value: Any, data_type: pa.DataType) -> Any:
    if pa.types.is_boolean(data_type):
        return not value
    if pa.types.is_string(data_type):
        return f"{value or ''}x"
    return 1 if value is None else value + 1


def with_other_values(path: Path, check: type[BagCheck]) -> dict[str, list[str]]:
    """By column, what is found where a row in the middle has another value there; as it was in the end."""
    original, found = pq.read_table(path), {}
    for index, field in enumerate(original.schema):
        values = original.column(index).to_pylist()
        values[len(values) // 2] = other(values[len(values) // 2], field.type)
        pq.write_table(original.set_column(index, field, pa.array(values, field.type)), path)
        found[field.name] = faults(path.parent, check)
    pq.write_table(original, path)
    return found


@pytest.mark.parametrize(
    ("bag", "table", "check"),
    [
        *(
            ("cam", CAMS, CamsCheck),
            ("delay", CAMS, CamsCheck),
            ("dos", CAMS, CamsCheck),
            ("gnss", CAMS, CamsCheck),
        ),
        ("gnss", FIXES, Fixes),
    ],
)
def test_a_change_in_any_label_column_is_found(
    data_set: Path, bag: str, table: str, check: type[BagCheck]
) -> None:
    """One wrong value is one finding; a wrong number is about two messages."""
    assert faults(data_set / bag, check) == []
    found = with_other_values(data_set / bag / table, check)
    assert {name for name, lines in found.items() if len(lines) != 1} <= {"number"}
    assert len(found.get("number", [""] * 2)) == 2
    assert faults(data_set / bag, check) == []


def test_labels_of_several_attacks_on_one_message_are_checked(data_set: Path) -> None:
    """Each attacker is late, and heads the other way or is longer: labels are followed in that order."""
    specs = (
        {
            "type": "cam-delay",
            "parameters": {"delay_min_s": 0.05, "delay_max_s": 0.4},
            "attackers": {"share": 0.6},
        },
        {
            "type": "cam-mix",
            "parameters": {"attacks": "cam-heading-reversed,cam-dimensions"},
            "attackers": {"share": 0.6},
        },
    )
    bag = data_set / "two"
    attack(data_set / "clean", bag, AttackRequest(tuple(map(attack_spec, specs))), workers=1)
    numbers = pq.read_table(bag / CAMS)["number"].to_pylist()
    assert len(set(numbers)) < len(numbers)
    assert faults(bag, CamsCheck) == []
    found = with_other_values(bag / CAMS, CamsCheck)
    assert all(found[name] for name in ("attack", "part", "attacker", "sender", "fields", "mattered"))

    def other_mix(attacks: Attacks) -> None:
        attacks[1]["declared"]["parts"] = [{"name": "cam-dimensions"}]

    assert "with part 'cam-heading-reversed' of cam-mix" in " ".join(faults(bag, CamsCheck, other_mix))
    what = " ".join(gap.what for gap in verify(bag).unchecked)
    assert "were changed by several attacks" in what


def later(attacks: Attacks) -> None:
    attacks[0]["schedule"]["from_s"] = 0.5


def by_others(attacks: Attacks) -> None:
    attacks[0]["attackers"] = {"vehicles": ["ego"], "share": None, "roadside_unit": None}


@pytest.mark.parametrize(
    ("bag", "check", "change", "expected"),
    [
        ("cam", CamsCheck, later, "when cam-position-offset was not active"),
        ("delay", CamsCheck, later, "when cam-delay was not active"),
        ("cam", CamsCheck, by_others, "whose messages cam-position-offset does not attack"),
        ("gnss", Fixes, later, "is attacked by nothing, but its label says gnss-bias"),
    ],
)
def test_labels_that_contradict_the_declared_attacks_are_faults(
    data_set: Path, bag: str, check: type[BagCheck], change: Callable[[Attacks], None], expected: str
) -> None:
    """The bag names attackers, or a time, that labels do not keep to."""
    assert expected in " ".join(faults(data_set / bag, check, change))


def bounded_by(**bounds: list[float]) -> Callable[[Attacks], None]:
    def change(attacks: Attacks) -> None:
        attacks[0]["declared"]["bounds"] = bounds

    return change


@pytest.mark.parametrize(
    ("bag", "bounds", "expected"),
    [
        ("perturb", {"max_displacement_m": [0, 1e-4]}, "m, but the attack declares 0 to 0.0001 m"),
        ("attach", {"points_added": [1, 1]}, "points added: "),
        (
            "attach",
            {"max_added_distance_m": [0, 1e-4]},
            "largest distance of an added point from the clean cloud",
        ),
        ("detach", {"share_removed": [0, 1e-4]}, "smallest share of the points"),
    ],
)
def test_exceeded_bounds_are_faults(
    data_set: Path, bag: str, bounds: dict[str, list[float]], expected: str
) -> None:
    assert faults(data_set / bag, Points) == []
    assert expected in " ".join(faults(data_set / bag, Points, bounded_by(**bounds)))
    twice = json.loads(BagReader(data_set / bag).provenance["attacks"])

    def one_of_two(attacks: Attacks) -> None:
        """Whichever of two attacks of one name it was, one of them may have done it."""
        bounded_by(**bounds)(attacks)
        attacks += twice

    assert faults(data_set / bag, Points, one_of_two) == []


def unchecked(bag: Path, check: type[BagCheck], change: Callable[[Attacks], None]) -> str:
    (subject,) = find_subject(bag).bags
    attacks = json.loads(subject.provenance["attacks"])
    change(attacks)
    subject.provenance = Provenance({**subject.provenance, "attacks": json.dumps(attacks)})
    found = list(check(subject).check())
    assert not [one for one in found if isinstance(one, Fault)]
    return " ".join(one.what for one in found)


@pytest.mark.parametrize(
    ("bag", "check", "expected"),
    [
        ("detach", Points, "bounds of detach not checked: the bag comes from a version"),
        (
            "dos",
            CamsCheck,
            "parts, bounds, mattered and untrue fields of cam-dos not checked: the bag comes from a version",
        ),
    ],
)
def test_missing_declarations_of_older_versions_are_unchecked(
    data_set: Path, bag: str, check: type[BagCheck], expected: str
) -> None:
    def undeclared(attacks: Attacks) -> None:
        del attacks[0]["declared"]

    assert expected in unchecked(data_set / bag, check, undeclared)


def test_bounds_on_unknown_quantities_are_unchecked(data_set: Path) -> None:
    """Of a later version, or made up."""
    unchecked_text = unchecked(data_set / "detach", Points, bounded_by(points_painted=[0, 3]))
    assert "points_painted of detach not checked: unknown quantity in this version" in unchecked_text
    assert "detach declares no bounds" in unchecked(data_set / "detach", Points, bounded_by())


def test_labels_of_older_versions_are_accepted(data_set: Path) -> None:
    path = data_set / "cam" / CAMS
    table = pq.read_table(path).drop_columns(["part"])
    expected = pa.array([text.split(",") for text in table["fields"].to_pylist()])
    pq.write_table(table.set_column(table.column_names.index("fields"), "fields", expected), path)
    assert faults(path.parent, CamsCheck) == []
    unchecked = " ".join(gap.what for gap in verify(path.parent).unchecked)
    assert "part and fields: not in the form of this version" in unchecked


@pytest.mark.parametrize(
    ("bag", "table", "columns", "check"),
    [
        ("detach", POINTS, ("point", "frame"), "points"),
        ("attach", POINTS, ("displacement_m",), "points"),
        ("attach", FRAMES, ("points_adversarial", "stamp_ns", "frame"), "points"),
        ("cam", CAMS, ("number", "false_acceleration_control"), "cams"),
        ("gnss", FIXES, ("stamp_ns",), "fixes"),
    ],
)
def test_a_label_with_another_message_number_is_a_fault(
    data_set: Path, bag: str, table: str, columns: tuple[str, ...], check: str
) -> None:
    """One more in the last row that has a number there."""
    path = data_set / bag / table
    original = pq.read_table(path)
    for name in columns:
        index = original.column_names.index(name)
        values = original[name].to_pylist()
        row = max(row for row, value in enumerate(values) if value is not None)
        values[row] += 1
        field = original.schema.field(name)
        pq.write_table(original.set_column(index, field, pa.array(values, field.type)), path)
        found = verify(data_set / bag).findings
        assert {finding.check for finding in found} - {"debug"} == {"beside", check}, name
    pq.write_table(original, path)
    assert {finding.check for finding in verify(data_set / bag).findings} <= {"beside"}


@pytest.mark.parametrize(
    ("bag", "table", "check"),
    [
        *(("detach", POINTS, "points"), ("attach", POINTS, "points"), ("gnss", FIXES, "fixes")),
        *(("cam", CAMS, "cams"), ("delay", CAMS, "cams"), ("dos", CAMS, "cams")),
    ],
)
def test_a_missing_label_row_is_a_fault(data_set: Path, bag: str, table: str, check: str) -> None:
    path = data_set / bag / table
    rows = pq.read_table(path)
    pq.write_table(rows.slice(0, len(rows) - 1), path)
    assert {finding.check for finding in verify(data_set / bag).findings} - {"debug"} == {"beside", check}


def test_a_label_with_another_action_is_a_fault(data_set: Path) -> None:
    """A removed point is labelled as moved."""
    path = data_set / "detach" / POINTS
    rows = pq.read_table(path)
    index = rows.column_names.index("action")
    moved = pc.if_else(pc.equal(pc.cast(rows["action"], pa.string()), "removed"), "moved", "added")
    pq.write_table(rows.set_column(index, "action", moved), path)
    assert {finding.check for finding in verify(data_set / "detach").findings} == {"beside", "points"}
