"""The public names: loaded when they are first used, seen by type checkers, and the command line's own."""

from __future__ import annotations

import ast
import inspect
import re
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

import advpipe
from advpipe.pipeline.cli import COMMANDS

ROOT = Path(__file__).parents[2]
HEAVY = ("numpy", "torch", "open3d", "libsumo", "pandas", "pydantic", "pyarrow", "typing")

ONLY_IN_PYTHON = {"evaluate": {"clean"}, "attack": {"parameters"}}
"""Options of the functions that are no options of the command line, which has one list of bags."""
ONLY_FOR_TERMINALS = {
    "attack": {"settings"},
    "sweep": {"check"},
    "simulate": {"seeds", "workers", "cluster"},
}
"""Options of the command line that are parameters of an attack, by their names, in Python; a check; and those
of several drives, each of which is a call in Python."""
RENAMED = {"evaluate": {"bags": "adversarial"}, "simulate": {"scenarios": "scenario"}}
"""A few options have other names inside the command line, which users do not see; it takes several scenarios,
each of which is a call in Python."""
SHOWN = {
    "evaluate": {"detector": "small", "defence": "default", "detect_attacks": "ray"},
    "simulate": {"scenario": "district"},
}
"""Defaults that the command line does not state as such, but shows."""


def test_importing_loads_nothing_heavy() -> None:
    code = f"import advpipe, sys; print([name for name in {HEAVY} if name in sys.modules])"
    done = subprocess.run([sys.executable, "-I", "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout == "[]\n"


def test_importing_takes_less_than_a_fifth_of_a_second() -> None:
    code = "import time; begin = time.process_time(); import advpipe; print(time.process_time() - begin)"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert float(done.stdout) < 0.2


def imported_for_type_checkers() -> dict[str, str]:
    """Module of each name that the public package imports for type checkers."""
    tree = ast.parse((ROOT / "api" / "__init__.py").read_text(encoding="utf-8"))
    (block,) = (node for node in tree.body if isinstance(node, ast.If))
    found = {}
    for node in block.body:
        if isinstance(node, ast.ImportFrom):
            for alias in node.names:
                assert alias.asname == alias.name, "not exported in the eyes of a type checker"
                found[alias.name] = str(node.module)
    return found


def test_type_checkers_see_the_names_that_are_loaded() -> None:
    known = {name: f"advpipe.{module}" for name, module in advpipe._MODULE_OF.items()}
    assert imported_for_type_checkers() == known
    assert set(advpipe.__all__) == {*known, "__version__"}
    assert set(advpipe.__all__) <= set(dir(advpipe))


@pytest.mark.parametrize("name", sorted(advpipe._MODULE_OF))
def test_every_name_is_there_and_documented(name: str) -> None:
    found = getattr(advpipe, name)
    assert found is getattr(advpipe, name)
    if inspect.isclass(found) or inspect.isfunction(found):
        assert inspect.getdoc(found)


def test_other_names_are_not_there() -> None:
    with pytest.raises(AttributeError, match="no attribute 'attak'"):
        advpipe.attak  # type: ignore[attr-defined] # noqa: B018


def defaults(function: Callable[..., Any]) -> dict[str, Any]:
    """The options by name with their defaults; None for what is empty, and one thing for a list of it."""
    found = {}
    for one in inspect.signature(function).parameters.values():
        alone = one.default[0] if isinstance(one.default, tuple) and one.default else one.default
        found[one.name] = None if alone in (inspect.Parameter.empty, ()) else alone
    return found


@pytest.mark.parametrize("command", ["simulate", "attack", "evaluate", "sweep", "grid", "train", "verify"])
def test_names_and_defaults_are_those_of_the_command_line(command: str) -> None:
    ours, theirs = defaults(getattr(advpipe, command)), defaults(COMMANDS[command])
    for name in ONLY_IN_PYTHON.get(command, ()):
        del ours[name]
    for name in ONLY_FOR_TERMINALS.get(command, ()):
        del theirs[name]
    renamed = RENAMED.get(command, {})
    assert ours == {renamed.get(name, name): default for name, default in theirs.items()} | SHOWN.get(
        command, {}
    )


ARRAYS = re.compile(r"NDArray|Float64|Float32|Bools|\bCloud\b|\bTensor\b|ArrayLike|\bTable\b")
SHAPE = re.compile(r"\([A-Z0-9]\w*(?: [+*] \w+)?(?:,\)|(?:, ?\w+)+\))")


def documented() -> dict[str, Callable[..., Any]]:
    """The public functions by name, with the methods that the public classes define themselves."""
    found: dict[str, Callable[..., Any]] = {}
    for name in advpipe._MODULE_OF:
        thing = getattr(advpipe, name)
        if inspect.isfunction(thing):
            found[name] = thing
        elif inspect.isclass(thing):
            for key, member in vars(thing).items():
                method = member.fget if isinstance(member, property) else getattr(member, "__func__", member)
                if not key.startswith("_") and inspect.isfunction(method):
                    found[f"{name}.{key}"] = method
    return found


@pytest.mark.parametrize("name", sorted(documented()))
def test_docstrings_give_shapes_and_errors(name: str) -> None:
    """A function that takes or returns arrays gives their shapes, and one that raises says what; a method may
    leave it to its class."""
    function, owner = documented()[name], name.partition(".")[0]
    text = inspect.getdoc(getattr(advpipe, owner)) or ""
    if "." in name:
        text += inspect.getdoc(getattr(getattr(advpipe, owner), name.partition(".")[2])) or ""
    assert inspect.getdoc(function) or text, "no docstring"
    if any(ARRAYS.search(str(one)) for one in function.__annotations__.values()):
        assert SHAPE.search(text), "no shape"
    if re.search(r"raise (Usage|Advpipe|Cam|Key|Value)Error", inspect.getsource(function)):
        assert "aise" in text, "no errors"
