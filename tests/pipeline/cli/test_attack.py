"""The options of `advpipe attack`: what they become, and mistakes in them."""

from __future__ import annotations

import re
import shlex
import sys
from collections.abc import Callable
from pathlib import Path

import pytest
from first_words import without_progress

from advpipe.pipeline.bag.provenance import clean_provenance
from advpipe.pipeline.bag.writer import BagWriter
from advpipe.pipeline.cli import app
from advpipe.pipeline.cli.attack import attack_command, given_parameters
from advpipe.pipeline.cli.shared import print_line
from advpipe.pipeline.core.errors import AdvpipeError
from advpipe.pipeline.scenario.attacks import AttackSpec
from advpipe.stages.attack.run import AttackRequest, AttackSummary

ROOT = Path(__file__).parents[3]


def test_parameters_are_read_as_yaml() -> None:
    assert given_parameters(
        {}, ["ratio=0.1", "along-ray=true", "ids=[a, b]", "mode=place", "most=null", "x_m=1e6"]
    ) == {
        "ratio": 0.1,
        "along_ray": True,
        "ids": ["a", "b"],
        "mode": "place",
        "most": None,
        "x_m": "1e6",
    }


@pytest.fixture
def bag(tmp_path: Path) -> Path:
    with BagWriter(tmp_path / "bag", provenance=clean_provenance("t", "", 1, "")):
        pass
    return tmp_path / "bag"


def requested(bag: Path, monkeypatch: pytest.MonkeyPatch, **options: object) -> AttackSpec:
    """What the command asks of the stage, which does not go to work."""
    seen: list[AttackRequest] = []

    def note(clean: Path, out: Path, request: AttackRequest, **_: object) -> AttackSummary:
        seen.append(request)
        return AttackSummary(out)

    monkeypatch.setattr("advpipe.stages.attack.run.attack", note)
    attack_command(bag, **options)  # type: ignore[arg-type]
    (spec,) = seen[0].attacks
    return spec


def test_options_become_an_attack(bag: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    spec = requested(bag, monkeypatch)
    assert (spec.type, spec.parameters, spec.recipe) == ("detach", {"ratio": 0.01}, None)
    spec = requested(bag, monkeypatch, ratio=0.02, settings=["rounds=4"], recipe="paper", frames="::5")
    assert spec.parameters == {"ratio": 0.02, "rounds": 4}
    assert (spec.recipe, spec.frames) == ("paper", "::5")
    spec = requested(bag, monkeypatch, type="cam-dos", attacker=["10%"], victim="ego", from_s=2.0, to_s=5.0)
    assert spec.attackers is not None
    assert (spec.attackers.share, spec.victim, spec.schedule.to_s) == (0.1, "ego", 5.0)
    assert not spec.dcc_reacts
    assert requested(bag, monkeypatch, type="cam-dos", dcc_reacts=True).dcc_reacts
    assert spec.network == "embedded"
    assert requested(bag, monkeypatch, type="cam-dos", network="artery").network == "artery"
    assert spec.parameters == {}


@pytest.mark.parametrize(
    ("options", "line"),
    [
        ({"ratio": float("nan")}, "ratio is nan"),
        ({"ratio": -0.1}, r"ratio is -0\.1"),
        ({"ratio": 0.0}, r"ratio is 0\.0"),
        ({"ratio": 1.0}, r"ratio is 1\.0"),
        ({"settings": ["rounds"]}, "--set 'rounds': write name=value"),
        ({"settings": ["rounds=[1"]}, r"--set 'rounds=\[1': the value cannot be read"),
        (
            {"settings": ["rounds=&a [*a]"]},
            "the value cannot be read: an alias refers to",
        ),
        ({"settings": ["rounds=!!bool x"]}, "the value cannot be read: 'x' is not a valid bool"),
        ({"settings": ["rounds=!!binary aGk="]}, "the value cannot be read: the tag"),
        ({"settings": ["rounds=" + "[" * 1000]}, "the value cannot be read: is nested more than"),
        ({"settings": ["rounds=[[[[1]]]]"]}, "nests lists too deeply"),
        ({"settings": ["rounds={a: 1}"]}, "rounds is a dict; give a number, a string or a list"),
        ({"settings": [r'objects="\ud800"']}, r"the value cannot be read: .*(U\+D800|Unicode)"),
        ({"settings": ["rounds=true"]}, "detach: rounds is True: Input should be a valid integer"),
        ({"settings": ["rounds=1e12"]}, r"detach: rounds is 1000000000000: it may be 1e\+06 at most"),
        ({"settings": ["rounds=1e300"]}, "rounds is 1e[+]300: Input should be a valid integer"),
        ({"settings": ["rounds=.inf"]}, r"rounds is inf; it must be finite and within 1e\+15"),
        ({"settings": ["rounds=" + "9" * 50]}, "rounds is 9+; it must be finite"),
        ({"settings": ["rounds=" + "x" * 100_000]}, "^.{,200}rounds is a string of 100000 characters.{,50}$"),
        ({"settings": ["x" * 100_000]}, "^--set .{,110}: write name=value.{,50}$"),
        ({"settings": ["x" * 100_000 + "=1"]}, "^.{,500}$"),
        ({"recipe": "x" * 100_000}, "^.{,300}$"),
        ({"ratio": 0.1, "settings": ["ratio=0.5"]}, "--set 'ratio=0.5': ratio is already 0.1; give it once"),
        ({"settings": ["rounds=4", "rounds=5"]}, "--set 'rounds=5': rounds is already 4; give it once"),
        ({"settings": ["round=1"]}, r"detach: unknown parameter 'round'; did you mean 'rounds'"),
        ({"settings": ["rounds=many"]}, "detach: rounds is 'many'"),
        ({"type": "detatch"}, "unknown attack 'detatch'; did you mean 'detach'"),
        ({"recipe": "worst"}, "recipe is 'worst'; known"),
        ({"attacker": ["a"]}, "detach has no use for attackers"),
        (
            {"type": "cam-dos", "attacker": ["a", "5%"]},
            "attacker=.5%.: a share or a roadside unit must be the only attacker",
        ),
        (
            {"type": "cam-dos", "attacker": ["0%"]},
            r"attackers\.share: Input should be greater",
        ),
        ({"type": "cam-dos", "attacker": ["x%"]}, "attacker=.x%.: write a vehicle's id, 20%, or rsu:X,Y"),
        ({"type": "cam-dos", "attacker": ["rsu:1"]}, r"attackers\.roadside_unit\.y_m: Field required"),
        ({"type": "cam-dos", "ratio": 0.1}, "cam-dos: unknown parameter 'ratio'; known: "),
        ({"from_s": 5.0, "to_s": 4.0}, "to_s 4 is not after from_s 5"),
        ({"from_s": -1.0}, r"from_s: Input should be greater than or equal to 0, not -1\.0"),
        ({"frames": "1;2"}, "frames '1;2': expected start:stop:step"),
        ({"detector": "large"}, "holds no messages"),  # the bag is looked at first
    ],
)
def test_mistakes_are_one_line(bag: Path, options: dict[str, object], line: str) -> None:
    with pytest.raises(AdvpipeError, match=line) as caught:
        attack_command(bag, **options)  # type: ignore[arg-type]
    assert "\n" not in str(caught.value)
    assert [path.name for path in bag.parent.iterdir()] == ["bag"]


Said = Callable[..., str]


@pytest.fixture
def said(capfd: pytest.CaptureFixture[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Said:
    """All that `advpipe attack` prints with these words, in a folder without data sets."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("COLUMNS", "200")

    def said(*arguments: str) -> str:
        capfd.readouterr()
        with pytest.raises(SystemExit):
            app(["attack", *arguments], prog_name="advpipe")
        done = capfd.readouterr()
        return done.out + without_progress(done.err)

    return said


def test_each_attack_has_its_parameters_as_options(said: Said) -> None:
    shown = said("--type", "detach", "--help")
    assert "detach: Remove exactly round(ratio * N)" in shown
    assert re.search(r"--ratio .*in \(0, 1\)", shown)
    assert re.search(r"--goal .*break\" detections", shown)  # in the words of `Constraints`
    assert "--eps-cm" not in shown
    assert "--ghosts" in said("--help", "--type=cam-sybil-grid")


def test_an_attack_of_a_user_has_its_own_too(said: Said, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.syspath_prepend(ROOT / "examples")
    assert re.search(r"--width-deg +<?float", said("--type", "my_attack:Dazzle", "--help"), re.IGNORECASE)
    assert "no data set" in said("--type", "my_attack:Dazzle", "--width-deg", "10")


@pytest.mark.parametrize(
    ("arguments", "line"),
    [
        (
            ["--ratoi", "0.1"],
            r"--ratoi; did you mean '--ratio'\? \(see advpipe attacks detach\)",
        ),
        (["--type", "detach", "--eps-cm", "3"], r"--eps-cm.* \(see advpipe attacks detach\)"),
        (["--type", "gnss-jam", "--ratio", "3"], "--ratio; gnss-jam has no parameters"),
        (["--type", "attach", "--ratio", "3"], r"--ratio \(see advpipe attacks attach\)"),
        (["--type", "nope", "--help"], "unknown attack 'nope'; most like it: "),
        (["--type", "nope", "--ratio", "1"], "unknown attack 'nope'; most like it: "),
        (["--ratio", "x"], "Invalid value for '?--ratio.* 'x' is not a share; write 0.01 or 1%"),
        (["--ratio", "x%"], "Invalid value for '?--ratio"),
        (["--type", "perturb", "--eps-cm", "1%"], "Invalid value for '?--eps-cm"),
        (["--objects", "[a"], r"--objects '\[a': the value cannot be read"),
        (["--ratio", "0.1", "--set", "ratio=0.2"], "ratio is already 0.1; give it once"),
        (["--type"], "--type"),
    ],
)
def test_mistakes_in_parameters_given_as_options(said: Said, arguments: list[str], line: str) -> None:
    text = said(*arguments)
    assert re.fullmatch(rf"advpipe: .*{line}.*\n", text)


def test_options_of_an_attack_reach_it(bag: Path, said: Said, monkeypatch: pytest.MonkeyPatch) -> None:
    seen: list[AttackRequest] = []

    def note(clean: Path, out: Path, request: AttackRequest, **_: object) -> AttackSummary:
        seen.append(request)
        return AttackSummary(out)

    monkeypatch.setattr("advpipe.stages.attack.run.attack", note)
    said(str(bag), "--type", "perturb", "--eps-cm", "3", "--along-ray", "--goal=hide", "--set", "steps=2")
    said("--objects", "[a, b]", "--type", "perturb", str(bag))
    said("--ratio", "0.3%", str(bag))
    said(str(bag), "--type", "cam-position-constant", "--x-m=-1e1", "--y-m", "5", "--no-rebuild-path")
    assert [spec.parameters for request in seen for spec in request.attacks] == [
        {"eps_cm": 3.0, "along_ray": True, "goal": "hide", "steps": 2},
        {"eps_cm": 10.0, "objects": ("a", "b")},
        {"ratio": 0.003},
        {"x_m": -10.0, "y_m": 5.0, "rebuild_path": False},
    ]


def test_a_summary_breaks_between_words_on_a_terminal(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    text = "attacked with detach-best-0.01: " + "twenty-three of the clouds, " * 8
    print_line(text)()
    assert capsys.readouterr().out == f"{text}\n"  # a file has whole lines
    monkeypatch.setattr(sys.stdout, "isatty", lambda: True)
    monkeypatch.setenv("COLUMNS", "80")
    print_line(text)()
    lines = capsys.readouterr().out.splitlines()
    assert len(lines) > 1
    assert max(map(len, lines)) <= 80
    assert " ".join(lines).split() == text.split()


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ({}, []),
        ({"level": True, "scale_intensity": 1 / 255}, ["--level", "--scale-intensity", str(1 / 255)]),
        ({"lidar_height_m": 2.2}, ["--lidar-height", "2.2"]),
        ({"detector": "small,mine:Net"}, ["--detector", "small", "--detector", "mine:Net"]),
    ],
)
def test_the_evaluation_sees_the_clouds_as_the_attack_did(
    bag: Path, monkeypatch: pytest.MonkeyPatch, given: dict[str, object], words: list[str]
) -> None:
    def note(clean: Path, out: Path, request: AttackRequest, **_: object) -> AttackSummary:
        return AttackSummary(out)

    monkeypatch.setattr("advpipe.stages.attack.run.attack", note)
    (command,) = attack_command(bag, **given).next_commands  # type: ignore[arg-type]
    made = bag.with_name("bag-detach-best-0.01")
    assert shlex.split(command)[-3 - len(words) :] == ["evaluate", str(bag), str(made), *words]
