"""Scenario files and `--set`: trees drawn from the JSON Schema of the scenario, and shipped ones changed."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import yaml
from hypothesis import strategies as st

from advpipe.pipeline.scenario import Scenario, dump_scenario, load_scenario
from advpipe.pipeline.scenario.load import shipped_scenarios
from tests.fuzz import base
from tests.fuzz.case import Call, Case, Target
from tests.fuzz.edits import edited_bytes
from tests.fuzz.values import TEXTS, YAML_RAWS, document, edited_trees, scalars

FILE, SETTINGS = "drive.yaml", "settings.json"
SCHEMA: dict[str, Any] = Scenario.model_json_schema()


def load(tree: Path, out: Path) -> None:
    """What every command does with a scenario; its attacks are checked as `run` does."""
    from advpipe.stages.attack.run import AttackRequest

    scenario = load_scenario(str(tree / FILE))
    dump_scenario(scenario)
    for attacks in scenario.attacks.values():
        AttackRequest(attacks, scenario.simulation.seed).check()


def override(tree: Path, out: Path) -> None:
    """The shipped scenario `smoke` with settings of the command line."""
    dump_scenario(load_scenario("smoke", json.loads((tree / SETTINGS).read_text(encoding="utf-8"))))


def attack_parameters(tree: Path, out: Path) -> None:
    """The same settings as those of an attack."""
    from advpipe.pipeline.cli.attack import given_parameters
    from advpipe.pipeline.scenario.attacks import attack_spec
    from advpipe.stages.attack.run import AttackRequest

    given = json.loads((tree / SETTINGS).read_text(encoding="utf-8"))
    spec = attack_spec(
        {"type": "cam-dos", "parameters": given_parameters({}, [s.rpartition(".")[2] for s in given])}
    )
    AttackRequest((spec,), 0).check()


CALLS: dict[str, Call] = {"load": load, "override": override, "attack": attack_parameters}


def of_schema(part: dict[str, Any], depth: int = 0) -> st.SearchStrategy[Any]:
    """Values that a part of the schema allows, and occasionally others."""
    if "$ref" in part:
        return of_schema(SCHEMA["$defs"][part["$ref"].rpartition("/")[2]], depth)
    choices = part.get("anyOf") or part.get("oneOf")
    if choices:
        return st.one_of([of_schema(choice, depth) for choice in choices])
    if "const" in part or "enum" in part:
        return st.sampled_from([part["const"]] if "const" in part else part["enum"])
    return st.one_of(_of_type(part, depth), _of_type(part, depth), _of_type(part, depth), scalars())


def _of_type(part: dict[str, Any], depth: int) -> st.SearchStrategy[Any]:
    kind = part.get("type")
    if kind == "object":
        known = part.get("properties", {})
        optional = {
            key: st.deferred(lambda value=value: of_schema(value, depth + 1)) for key, value in known.items()
        }
        more = part.get("additionalProperties")
        if isinstance(more, dict):
            names = st.sampled_from(["ego", "a", "x_1", "clean", *TEXTS[:6]])
            return st.dictionaries(names, st.deferred(lambda: of_schema(more, depth + 1)), max_size=2)
        needed = set(part.get("required", ()))
        # Few keys at a time: of many, the first bad one hides all others.
        return st.lists(st.sampled_from(sorted(optional) or [""]), max_size=3, unique=True).flatmap(
            lambda keys: st.fixed_dictionaries(
                {key: optional[key] for key in {*keys, *needed} if key in optional}
            )
        )
    if kind == "array":
        items = part.get("items") or (part.get("prefixItems") or [{}])[0]
        return st.lists(st.deferred(lambda: of_schema(items, depth + 1)), max_size=3)
    if kind in ("number", "integer"):
        low, high = part.get("minimum", part.get("exclusiveMinimum", -100)), part.get("maximum", 1000)
        ends = [low, high, part.get("default", 1)]
        numbers = (
            st.integers(int(low), int(max(low, high)))
            if kind == "integer"
            else st.floats(low, max(low, high))
        )
        return st.one_of(st.sampled_from(ends), numbers)
    if kind == "string":
        return st.sampled_from(["ego", "small", "detach", "cam-dos", "gnss-bias", "::2", "20%", *TEXTS])
    return st.booleans() if kind == "boolean" else scalars()


@st.composite
def file_cases(draw: st.DrawFn, trees: list[dict[str, Any]]) -> Case:
    """A whole file: a shipped one changed, or one that the schema drew, as YAML."""
    if draw(st.booleans()):
        tree, note = draw(edited_trees(draw(st.sampled_from(trees)), YAML_RAWS))
    else:
        drawn = draw(of_schema(SCHEMA))
        tree = {"name": "drawn", "map": {"sumo_net": "boulevard.net.xml"}} | (
            drawn if isinstance(drawn, dict) else {}
        )
        note = f"drawn: {drawn!r:.200}"
        if draw(st.booleans()):
            tree, more = draw(edited_trees(tree, YAML_RAWS))
            note += more
    text = document(tree)
    data = text.encode()
    if draw(st.integers(0, 9)) == 0:
        data, note = draw(edited_bytes(data))
    return Case("load", FILE, data, note)


def _keys(tree: Any, place: str = "") -> list[str]:
    found = [place] if place else []
    if isinstance(tree, dict):
        for key, value in tree.items():
            found += _keys(value, f"{place}.{key}" if place else key)
    return found


@st.composite
def setting_cases(draw: st.DrawFn, trees: list[dict[str, Any]]) -> Case:
    """Settings as on the command line."""
    keys = _keys(draw(st.sampled_from(trees)))
    settings = []
    for _ in range(draw(st.integers(1, 2))):
        key = draw(st.one_of(st.sampled_from(keys), st.sampled_from(TEXTS[:-2])))
        value = draw(st.one_of(scalars().map(str), st.sampled_from(YAML_RAWS).map(lambda raw: raw.text)))
        settings.append(f"{key}={value}")
    call = draw(st.sampled_from(["override", "attack"]))
    return Case(call, SETTINGS, json.dumps(settings).encode(), "; ".join(settings)[:200])


def cases(folder: Path) -> st.SearchStrategy[Case]:
    trees = [yaml.safe_load(path.read_text(encoding="utf-8")) for path in shipped_scenarios().values()]
    trees.append(yaml.safe_load((folder.parent / base.DRIVE / "scenario.yaml").read_text(encoding="utf-8")))
    return st.one_of(file_cases(trees), file_cases(trees), setting_cases(trees))


TARGET = Target("scenario", base.TABLES, cases, CALLS, smoke_inputs=100)
