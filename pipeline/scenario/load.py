"""Loads scenario files and applies overrides."""

from __future__ import annotations

import os
import typing
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Annotated, Any

import yaml
from pydantic import BaseModel, ValidationError

from advpipe.pipeline.core.errors import AdvpipeError
from advpipe.pipeline.core.nearest import suggestion
from advpipe.pipeline.core.option_names import option_name
from advpipe.pipeline.core.section import IsFile
from advpipe.pipeline.core.shipped_scenarios import shipped_folder, shipped_scenarios
from advpipe.pipeline.core.short_repr import short_repr, shorten
from advpipe.pipeline.scenario.attack_mistakes import AttackCheck, attack_mistakes
from advpipe.pipeline.scenario.document import LIMIT_BYTES, DocumentError, ScenarioText, read_document
from advpipe.pipeline.scenario.further_mistakes import further_mistakes
from advpipe.pipeline.scenario.map import MAP_SOURCES
from advpipe.pipeline.scenario.mistake import Mistake, Place
from advpipe.pipeline.scenario.mistakes import mistakes_line, schema_mistakes
from advpipe.pipeline.scenario.models import Scenario


def load_scenario(
    name_or_path: str | os.PathLike[str],
    overrides: Sequence[str] | Mapping[str, object] = (),
    check_attacks: AttackCheck | None = None,
) -> Scenario:
    """Load a scenario from a file, or a shipped scenario by name.

    overrides: keys to set, as a mapping from `section.key` to a value, or as strings `section.key=value` with
    the value in YAML. Paths are made absolute: a path in the file is relative to the file's folder (or names
    a shipped road network), and a path in an override is relative to the working directory. check_attacks:
    finds what is wrong with attacks beyond their schema, as `run` does.

    Raises AdvpipeError, one line with all mistakes, the file and the line numbers, for an invalid scenario.

    >>> load_scenario("smoke", {"simulation.duration_s": 2}).simulation.duration_s
    2.0
    """
    path = _find(os.fspath(name_or_path))
    document = _read(path)
    tree: dict[str, Any] = document.tree
    _make_paths_absolute(tree, path.parent)
    settings = overrides.items() if isinstance(overrides, Mapping) else map(_setting, overrides)
    overridden = [_apply(tree, place, value) for place, value in settings]
    scenario, mistakes = _validated(tree)
    if check_attacks is not None:
        mistakes += attack_mistakes(tree, scenario, check_attacks)
    if (
        mistakes
    ):  # whoever corrects them need not come back for these; `simulate` finds them where they are alone
        mistakes += _missing_files(tree)
    if scenario is None or mistakes:
        raise AdvpipeError(mistakes_line(mistakes, path, document, overridden))
    return scenario


def dump_scenario(scenario: Scenario) -> str:
    """The resolved scenario as YAML: every key except the attacks, including defaults.

    Only the file name of a path is kept, so that a data set does not reveal paths of its author's machine.
    """
    tree = scenario_tree(scenario)
    return yaml.safe_dump(tree, sort_keys=False, allow_unicode=True, width=100)


def scenario_tree(scenario: Scenario) -> dict[str, Any]:
    """The resolved scenario as plain values, without its attacks; only the file names of paths are kept.

    The bytes of a clean bag therefore do not depend on attacks. The attacks of an adversarial bag are in its
    attack.yaml.
    """
    tree: dict[str, Any] = scenario.model_dump(mode="json", exclude={"attacks"})
    for section, key in _files(tree):
        section[key] = Path(section[key]).name
    return tree


def _validated(tree: dict[str, Any]) -> tuple[Scenario | None, list[Mistake]]:
    try:
        return Scenario.model_validate(tree), []
    except ValidationError as error:
        found = list(schema_mistakes(error))
        return None, [*found, *further_mistakes(tree, error, found)]


def _missing_files(tree: dict[str, Any]) -> Iterator[Mistake]:
    for place in FILE_PLACES:
        for section, keys in _sections(tree, place[:-1]):
            name = section.get(place[-1])
            if isinstance(name, str) and name and not os.path.exists(name):
                yield (*keys, place[-1]), f"{short_repr(name)} does not exist"


def _find(name_or_path: str) -> Path:
    shipped = shipped_scenarios()
    if name_or_path in shipped:
        return shipped[name_or_path]
    path = Path(name_or_path)
    if os.path.isfile(path):  # unlike Path.is_file, no error for a name that is too long
        return path
    if os.path.isdir(path):
        raise AdvpipeError(f"{path} is a folder; give a scenario file")
    hint = suggestion(name_or_path, shipped)
    raise AdvpipeError(
        f"no scenario {short_repr(name_or_path)}: neither a file nor one of {', '.join(shipped)}"
        f"{'; ' if hint else ''}{hint}"
    )


def _read(path: Path) -> ScenarioText:
    if path.stat().st_size > LIMIT_BYTES:
        raise AdvpipeError(f"{path} is over {LIMIT_BYTES // 1_000_000} MB, too large for a scenario file")
    try:
        document = read_document(path.read_text(encoding="utf-8"))
    except (UnicodeDecodeError, OSError) as error:
        raise AdvpipeError(f"{path} cannot be read as text: {error}") from None
    except DocumentError as error:
        where = f" line {error.line}" if error.line else ""
        raise AdvpipeError(f"{path}{where}: {error}") from None
    if not isinstance(document.tree, dict):
        raise AdvpipeError(f"{path} holds no scenario: expected `name:`, `map:`, ... at the top level")
    return document


def _files(tree: dict[str, Any]) -> list[tuple[dict[str, Any], str]]:
    """All keys of the tree that hold a path, each as its section and its name."""
    return [
        (section, place[-1])
        for place in FILE_PLACES
        for section, _ in _sections(tree, place[:-1])
        if isinstance(section.get(place[-1]), str)
    ]


def _sections(tree: Any, place: Place, keys: Place = ()) -> list[tuple[dict[str, Any], Place]]:
    """The sections at a place, each with its keys; `*` in it is any key of a mapping or item of a list."""
    if not place:
        return [(tree, keys)] if isinstance(tree, dict) else []
    if isinstance(tree, dict):
        parts = [(str(key), part) for key, part in tree.items() if place[0] in ("*", key)]
    else:
        parts = [(str(i), part) for i, part in enumerate(tree)] if isinstance(tree, list) else []
        parts = parts if place[0] == "*" else []
    return [found for key, part in parts for found in _sections(part, place[1:], (*keys, key))]


def _file_places(model: type[BaseModel]) -> list[tuple[str, ...]]:
    """The key paths of a model that hold a file path; `*` is any key of a mapping or item of a list."""
    places: list[tuple[str, ...]] = []
    for name, field in model.model_fields.items():
        parts, is_many = [field.annotation], False
        while parts:
            part: Any = parts.pop()
            origin = typing.get_origin(part)
            is_many |= origin in (dict, tuple)
            if isinstance(part, type) and issubclass(part, BaseModel):
                places += [(name, *(("*",) if is_many else ()), *place) for place in _file_places(part)]
            elif origin is Annotated and any(isinstance(mark, IsFile) for mark in part.__metadata__):
                places.append((name,))
            else:
                parts += typing.get_args(part)
        if any(isinstance(mark, IsFile) for mark in field.metadata):
            places.append((name,))
    return places


FILE_PLACES = _file_places(Scenario)
MOST_KEYS = 12
"""Keys in a path of `--set`; no key of a scenario is nested so deeply."""


def _make_paths_absolute(tree: dict[str, Any], folder: Path) -> None:
    for section, key in _files(tree):
        path, shipped = folder / section[key], shipped_folder() / "networks" / section[key]
        if os.path.exists(path):
            section[key] = str(path.resolve())
        elif os.path.isfile(shipped):
            section[key] = str(shipped.resolve())
        elif folder != shipped_folder():  # a shipped scenario without its map needs the user's
            section[key] = str(path.absolute())


def _setting(override: str) -> tuple[str, object]:
    """The key path and the value of an override `section.key=value`."""
    where = f"{option_name('settings')} {short_repr(override)}"
    place, equals, text = override.partition("=")
    if not equals or not _is_place(place):
        raise AdvpipeError(f"{where}: write section.key=value")
    try:
        return place, read_document(text).tree
    except DocumentError as error:
        raise AdvpipeError(f"{where}: the value cannot be read: {error}") from None


def _is_place(place: str) -> bool:
    keys = place.strip().split(".")
    return all(keys) and len(keys) <= MOST_KEYS


def _apply(tree: dict[str, Any], place: str, value: object) -> tuple[str, ...]:
    """Set one key and return its path."""
    if not _is_place(place):
        raise AdvpipeError(f"{short_repr(place)} is not a key of a scenario; write section.key")
    keys, section = place.strip().split("."), tree
    for key in keys[:-1]:
        section = section.setdefault(key, {})
        if not isinstance(section, dict):
            raise AdvpipeError(
                f"{option_name('settings')} {short_repr(place)}: {shorten(key)} is a value, not a section"
            )
    if keys[:-1] == ["map"] and keys[-1] in MAP_SOURCES:
        for other in MAP_SOURCES:
            section.pop(other, None)
    section[keys[-1]] = value = os.fspath(value) if isinstance(value, os.PathLike) else value
    if isinstance(value, str):
        for holder, key in _files(tree):
            if holder is section and key == keys[-1]:
                section[key] = str(Path(value).absolute())
    return tuple(keys)
