"""`advpipe attacks` as a user reads it: whole, within 80 columns, and with a command that works."""

from __future__ import annotations

import json
import re
from collections.abc import Callable

import pytest
from first_words import without_progress

from advpipe.pipeline.cli import app
from advpipe.stages.attack.gnss.registry import GNSS_ATTACKS
from advpipe.stages.attack.registry import ATTACKS
from advpipe.stages.attack.v2x.registry import V2X_ATTACKS

Show = Callable[..., str]


@pytest.fixture
def show(capfd: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> Show:
    """What `advpipe attacks` prints with these words, on a terminal of 80 columns."""
    monkeypatch.setenv("COLUMNS", "80")

    def show(*words: str, code: int = 0) -> str:
        capfd.readouterr()
        with pytest.raises(SystemExit) as ended:
            app(["attacks", *words], prog_name="advpipe")
        assert (ended.value.code or 0) == code
        done = capfd.readouterr()
        return without_progress(done.err) if code else done.out

    return show


def test_the_list_holds_all_attacks_in_80_columns(show: Show) -> None:
    text = show()
    assert re.findall(r"^  ([a-z]\S*) ", text, re.MULTILINE) == sorted(
        ATTACKS, key=lambda name: text.index(f"\n  {name} ")
    )
    assert max(map(len, text.splitlines())) <= 80
    assert re.search(r"detach .*\n(?: +.*\n)*? +Budget: --ratio \(default 0\.01\); the", text)
    assert re.search(r"cam-delay .*\n(?: +.*\n)*? +Bounds: delay_s 2 to 4 s\.", text)


@pytest.mark.parametrize("name", ["perturb", "detach", "cam-mix", "cam-sybil-grid", "gnss-drift-aware"])
def test_one_attack_is_explained_in_80_columns(show: Show, name: str) -> None:
    text = show(name)
    assert max(map(len, text.splitlines())) <= 80
    assert text.startswith(f"{name} (")
    assert f"advpipe attack --type {name}" in text.splitlines()[-1]


def test_parameters_are_told_as_options(show: Show) -> None:
    assert "  --ratio FLOAT (default 0.01)\n" in show("detach")
    assert "  --restamp BOOL (default False)\n" in show("cam-delay")
    assert "share_removed: 0 to 0.01" in show("detach")


def test_for_programs(show: Show) -> None:
    assert {one["name"] for one in json.loads(show("--json"))["attacks"]} == set(ATTACKS)
    (one,) = json.loads(show("detach", "--json"))["attacks"]
    assert one["budget"] == "ratio"


@pytest.mark.parametrize(
    ("family", "count"), [("lidar", 3), ("gnss", len(GNSS_ATTACKS)), ("V2X", len(V2X_ATTACKS))]
)
def test_a_family_is_listed_alone(show: Show, family: str, count: int) -> None:
    found = json.loads(show(family, "--json"))["attacks"]
    assert {one["family"] for one in found} == {family.lower()}
    assert len(found) == count


def test_one_unlike_all_comes_with_three(show: Show) -> None:
    line = show("xyzzy", code=2)
    assert re.fullmatch(
        r"advpipe: unknown attack .xyzzy.; most like it: \S+, \S+, \S+ \(or .*`advpipe attacks` lists .*\n",
        line,
    )


def test_budgets_have_numbers(show: Show) -> None:
    said = " ".join(show("perturb").split())
    assert "Budget: --eps-cm (default 10); the paper: 0.5 to 10. Perturbation" in said
    assert "(default 0.01); the paper: 0.0005 to 0.015." in " ".join(show("detach").split())


def test_an_unknown_one_is_a_line(show: Show) -> None:
    assert re.fullmatch(
        r"advpipe: unknown attack 'detahc'; did you mean 'detach'\?.*\n", show("detahc", code=2)
    )
