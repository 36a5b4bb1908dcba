"""Attacks and detectors of users' own that go wrong: one line with the place, and no output."""

from __future__ import annotations

import pytest

from advpipe.pipeline.core.errors import AdvpipeError
from advpipe.pipeline.core.plugins import plugin_errors, plugin_names
from advpipe.pipeline.scenario.attacks import AttackSpec
from advpipe.stages.attack.lidar.build import build_lidar_attack
from advpipe.stages.attack.registry import find_attack
from advpipe.stages.attack.run import AttackRequest, attack

WRONG = """\
import numpy as np
from advpipe.stages.attack.lidar.base import Budget, LidarAttack, LidarTraits

TRAITS = LidarTraits(budget=Budget(title="", parameter="size", unit="m"))


class Base(LidarAttack):
    bounds = {}

    def __call__(self, cloud, boxes, detector, rng):
        return self.change(cloud)


class Missing(Base):
    traits = TRAITS

    def change(self, cloud):
        return {}["key"]


class Deep(Base):
    traits = TRAITS

    def change(self, cloud):
        np.zeros(3).reshape(2, 2)


class ReadOnly(Base):
    traits = TRAITS

    def change(self, cloud):
        cloud["x"] += 1


class Ends(Base):
    traits = TRAITS

    def change(self, cloud):
        raise SystemExit(0)


class NoArguments(Base):
    traits = TRAITS

    def __call__(self):
        return None


class Unmade(Base):
    traits = TRAITS

    def __init__(self, *, size: int = 3):
        raise KeyError(size)


class Positional(Base):
    traits = TRAITS

    def __init__(self, size):
        pass
"""


@pytest.fixture(autouse=True)
def _their_module(tmp_path, monkeypatch):
    (tmp_path / "wrong_attack.py").write_text(WRONG)
    monkeypatch.chdir(tmp_path)
    yield
    monkeypatch.undo()


def request(attack_name):
    return AttackRequest((AttackSpec(type=attack_name, detector="linear_detector:Shipped"),))


@pytest.mark.parametrize(
    ("name", "said"),
    [
        ("Missing", r"KeyError: 'key' \(wrong_attack\.py, line 18\)"),
        ("Deep", r"ValueError: cannot reshape .* \(wrong_attack\.py, line 25\)"),
        ("ReadOnly", r"ValueError: .*read-only \(wrong_attack\.py, line 32\)"),
        ("Ends", r"SystemExit: 0 \(wrong_attack\.py, line 39\)"),
        ("NoArguments", r"TypeError: .*__call__\(\) takes 1 positional argument"),
    ],
)
def test_a_mistake_on_a_cloud_is_one_line(clean_bag, tmp_path, name, said):
    attack_name = f"wrong_attack:{name}"
    with pytest.raises(
        AdvpipeError, match=rf"^{attack_name} or linear_detector:Shipped failed: {said}"
    ) as caught:
        attack(clean_bag, tmp_path / "out", request(attack_name), workers=1)
    assert "\n" not in str(caught.value)
    assert not (tmp_path / "out").exists()


def test_a_mistake_in_a_worker_is_the_same_line(clean_bag, tmp_path, monkeypatch):
    monkeypatch.setattr("advpipe.pipeline.core.jobs.JOBS_WORTH_A_WORKER", 1)
    monkeypatch.setenv("PYTHONPATH", str(tmp_path))
    with pytest.raises(AdvpipeError, match=r"KeyError: 'key' \(wrong_attack\.py, line 18\); fix it"):
        attack(clean_bag, tmp_path / "out", request("wrong_attack:Missing"), workers=2)


@pytest.mark.parametrize(
    ("name", "said"), [("Unmade", r"KeyError: 3 \(wrong_attack"), ("Positional", "TypeError: .*argument")]
)
def test_a_constructor_that_goes_wrong_is_one_line(name, said):
    with pytest.raises(AdvpipeError, match=f"wrong_attack:{name} failed: {said}"):
        build_lidar_attack(AttackSpec(type=f"wrong_attack:{name}"))


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("1 / 0", "ZeroDivisionError: division by zero"),
        ("x = y", "NameError: "),
        ("def f(:", "SyntaxError: "),
        ("raise SystemExit(0)", "SystemExit: 0"),
    ],
)
def test_a_module_that_goes_wrong_is_one_line(tmp_path, monkeypatch, text, said):
    name = f"broken_{abs(hash(text))}"
    (tmp_path / f"{name}.py").write_text(text)
    monkeypatch.syspath_prepend(str(tmp_path))
    with pytest.raises(AdvpipeError, match=f"cannot load attack {name}:X: {said}"):
        find_attack(f"{name}:X")


def test_what_is_not_the_users_stays_as_it_is():
    assert plugin_names(["detach", "small"]) == ()
    assert plugin_names(["detach", "mine:Detector", "mine:Detector"]) == ("mine:Detector",)
    with pytest.raises(KeyError), plugin_errors(()):
        raise KeyError("of ours")
    with pytest.raises(AdvpipeError, match=r"^said$"), plugin_errors(["mine:Detector"]):
        raise AdvpipeError("said")
    with pytest.raises(FileNotFoundError), plugin_errors(["mine:Detector"]):
        open("not there")  # noqa: SIM115
