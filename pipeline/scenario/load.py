"""Reading scenario files: overrides, and errors that name the place and the nearest key."""

from __future__ import annotations

import difflib
import typing
from collections.abc import Sequence
from importlib.resources import files
from pathlib import Path
from typing import Any

import yaml
from pydantic import BaseModel, ValidationError

from advpipe.pipeline.errors import AdvpipeError
from advpipe.pipeline.scenario.models import Scenario

MAX_FILE_BYTES = 4_000_000
MAP_KEYS = ("opendrive", "sumo_net")


def shipped_scenarios() -> dict[str, Path]:
    """The scenarios that come with advpipe: name to file."""
    return {path.stem: path for path in sorted(shipped_folder().glob("*.yaml"))}


def shipped_folder() -> Path:
    """Where the shipped scenarios lie, with their road networks in `networks/`."""
    return Path(str(files("advpipe.scenarios")))


def load_scenario(name_or_path: str, overrides: Sequence[str] = ()) -> Scenario:
    """A scenario from a file, or one of the shipped ones by name.

    Overrides read `section.key=value`, the value as YAML. The map's path is made absolute: that of the
    file is relative to its folder or names a shipped network, that of an override is relative to the
    working directory.
    """
    path = _find(name_or_path)
    tree = _read(path)
    _make_paths_absolute(tree, path.parent)
    for override in overrides:
        _apply(tree, override)
    try:
        return Scenario.model_validate(tree)
    except ValidationError as error:
        raise AdvpipeError(f"{path}: {_explain(error, tree, _lines(path))}") from None


def dump_scenario(scenario: Scenario) -> str:
    """The resolved scenario as YAML: every key, defaults included.

    Of the map's path only the file name stays: a data set tells nobody how its maker's disk is laid out.
    """
    tree = scenario_tree(scenario)
    return yaml.safe_dump(tree, sort_keys=False, allow_unicode=True, width=100)


def scenario_tree(scenario: Scenario) -> dict[str, Any]:
    """The resolved scenario as plain values, the map by its file name."""
    tree = scenario.model_dump(mode="json")
    for key in MAP_KEYS:
        if tree["map"][key] is not None:
            tree["map"][key] = Path(tree["map"][key]).name
    return tree


def _find(name_or_path: str) -> Path:
    shipped = shipped_scenarios()
    if name_or_path in shipped:
        return shipped[name_or_path]
    path = Path(name_or_path)
    if path.is_file():
        return path
    if path.is_dir():
        raise AdvpipeError(f"{path} is a folder; give a scenario file")
    hint = _nearest(name_or_path, list(shipped), otherwise="")
    raise AdvpipeError(f"no scenario {name_or_path!r}: neither a file nor one of {', '.join(shipped)}{hint}")


def _read(path: Path) -> dict[str, Any]:
    if path.stat().st_size > MAX_FILE_BYTES:
        raise AdvpipeError(f"{path} is over {MAX_FILE_BYTES // 1_000_000} MB; that is no scenario file")
    try:
        tree = yaml.safe_load(path.read_text(encoding="utf-8"))
    except (UnicodeDecodeError, OSError) as error:
        raise AdvpipeError(f"{path} cannot be read as text: {error}") from None
    except yaml.YAMLError as error:
        mark = getattr(error, "problem_mark", None)
        where = f" line {mark.line + 1}" if mark else ""
        problem = getattr(error, "problem", None) or "not YAML"
        raise AdvpipeError(f"{path}{where}: {problem}") from None
    if not isinstance(tree, dict):
        raise AdvpipeError(f"{path} holds no scenario: expected `name:`, `map:`, ... at the top level")
    return tree


def _make_paths_absolute(tree: dict[str, Any], folder: Path) -> None:
    section = tree.get("map")
    if isinstance(section, dict):
        for key in MAP_KEYS:
            if isinstance(section.get(key), str):
                path, shipped = folder / section[key], shipped_folder() / "networks" / section[key]
                section[key] = str((shipped if shipped.is_file() and not path.exists() else path).resolve())


def _apply(tree: dict[str, Any], override: str) -> None:
    place, equals, text = override.partition("=")
    keys = place.strip().split(".")
    if not equals or not all(keys):
        raise AdvpipeError(f"--set {override!r}: write section.key=value")
    try:
        value = yaml.safe_load(text)
    except yaml.YAMLError:
        raise AdvpipeError(f"--set {override!r}: the value is not YAML") from None
    section = tree
    for key in keys[:-1]:
        section = section.setdefault(key, {})
        if not isinstance(section, dict):
            raise AdvpipeError(f"--set {override!r}: {key} is a value, not a section")
    if keys[:-1] == ["map"] and keys[-1] in MAP_KEYS and isinstance(value, str):
        value = str(Path(value).resolve())
        section.pop({"opendrive": "sumo_net", "sumo_net": "opendrive"}[keys[-1]], None)
    section[keys[-1]] = value


def _explain(error: ValidationError, tree: dict[str, Any], lines: dict[tuple[str, ...], int]) -> str:
    """The first problem in one line: place, line of the file, what is wrong, nearest key."""
    first = error.errors()[0]
    place = tuple(str(part) for part in first["loc"] if part != "[key]")
    message = first["msg"].removeprefix("Value error, ")
    if first["type"] == "extra_forbidden":
        message = f"unknown key{_nearest(place[-1], _keys_at(place[:-1]))}"
    elif first["type"] == "missing":
        message = "is missing"
    elif not isinstance(first["input"], dict):
        message = f"{message}, not {first['input']!r}"
    line = f" (line {lines[place]})" if place in lines else ""
    where = ".".join(place) + line + ": " if place else ""
    more = f" (and {error.error_count() - 1} more)" if error.error_count() > 1 else ""
    return " ".join(f"{where}{message}{more}".split())


def _keys_at(place: tuple[str, ...]) -> list[str]:
    model: type[BaseModel] = Scenario
    for part in place:
        annotation: Any = model.model_fields[part].annotation if part in model.model_fields else model
        for candidate in (annotation, *typing.get_args(annotation)):
            if isinstance(candidate, type) and issubclass(candidate, BaseModel):
                model = candidate
    return list(model.model_fields)


def _nearest(word: str, known: list[str], otherwise: str | None = None) -> str:
    close = difflib.get_close_matches(word, known, n=1, cutoff=0.5)
    if close:
        return f"; did you mean {close[0]!r}?"
    return f"; known: {', '.join(known)}" if otherwise is None else otherwise


def _lines(path: Path) -> dict[tuple[str, ...], int]:
    """The line of the file that each key stands in."""
    found: dict[tuple[str, ...], int] = {}

    def visit(node: yaml.Node, place: tuple[str, ...]) -> None:
        if isinstance(node, yaml.MappingNode):
            for key, value in node.value:
                here = (*place, str(key.value))
                found[here] = key.start_mark.line + 1
                visit(value, here)

    root = yaml.compose(path.read_text(encoding="utf-8"), Loader=yaml.SafeLoader)
    if root is not None:
        visit(root, ())
    return found
