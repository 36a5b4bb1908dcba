"""Which part of the project may import which: layers, and no circles between packages."""

from __future__ import annotations

import ast
from collections import defaultdict
from collections.abc import Iterator
from graphlib import CycleError, TopologicalSorter
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]

TOP = ("cli", "campaigns")
"""Packages of `pipeline/` that stand above the stages."""

PUBLIC = ("bag", "commands", "networks")
"""The modules of `api/`, above the campaigns; the command line imports them."""

LAYERS = (
    {"core"},
    {"cluster", "process", "geometry", "mcap", "metrics"},
    {"kitti", "localisation"},
    {"v2x", "misbehaviour"},
    {"messages"},
    {"sensors"},
    {"scenario"},
    {"artery", "bag", "baselines", "birds_eye", "labels", "live", "results", "viewer"},
    {"image_labels", "replay", "dataset", "detector", "image_detector", "viewer_layouts"},
    {"attack_detection", "defences"},
    {"adversary", "audit"},
)
"""Of `pipeline/`, from the ground up; each imports only from its own layer and those below it."""


def modules() -> dict[str, Path]:
    """All modules of the package by their dotted names without `advpipe`, those on top under `top`."""
    found = {}
    for top in ("api", "pipeline", "stages"):
        for path in (ROOT / top).rglob("*.py"):
            parts = path.relative_to(ROOT).with_suffix("").parts
            name = ".".join(part for part in parts if part != "__init__")
            found[_placed(name.removeprefix("api."))] = path
    return found


def _placed(module: str) -> str:
    for name in TOP:
        if module == f"pipeline.{name}" or module.startswith(f"pipeline.{name}."):
            return module.replace("pipeline", "top", 1)
    return f"top.{module}" if module.split(".")[0] in PUBLIC else module


def imports(path: Path, known: dict[str, Path]) -> Iterator[str]:
    """The modules of ours that one imports, in functions too."""
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        names = []
        if isinstance(node, ast.Import):
            names = [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom) and node.module:
            names = [f"{node.module}.{alias.name}" for alias in node.names]
        for name in names:
            module = _placed(name.removeprefix("advpipe."))
            if name.startswith("advpipe."):
                yield module if module in known else module.rpartition(".")[0]


def edges() -> Iterator[tuple[str, str]]:
    known = modules()
    for module, path in known.items():
        for other in imports(path, known):
            if other != module:
                yield module, other


def circles(pairs: Iterator[tuple[str, str]], packages: set[str]) -> list[str]:
    """Within each package, the children that import one another in a circle, if one of them is a package.

    What two modules of different packages import counts where their packages part.
    """
    graphs: dict[str, dict[str, set[str]]] = defaultdict(lambda: defaultdict(set))
    for one, other in pairs:
        left, right = one.split("."), other.split(".")
        depth = next((i for i, (a, b) in enumerate(zip(left, right, strict=False)) if a != b), None)
        if depth is not None:
            graphs[".".join(left[:depth])][left[depth]].add(right[depth])
    found = []
    for parent, graph in graphs.items():
        try:
            TopologicalSorter(graph).prepare()
        except CycleError as error:
            circle = error.args[1]
            if any(".".join(filter(None, (parent, child))) in packages for child in circle):
                found.append(f"{parent}: {' -> '.join(circle)}")
    return found


def test_import_cycles_are_detected() -> None:
    packages = {"a", "a.b", "c"}
    assert circles(iter([("a.b.x", "a.y"), ("a.y", "a.b.z")]), packages) == ["a: b -> y -> b"]
    assert circles(iter([("a.x", "c.x"), ("c.y", "a.y")]), packages) == [": a -> c -> a"]
    assert circles(iter([("a.x", "a.y"), ("a.y", "a.x")]), packages) == []  # two modules side by side


def test_no_package_imports_in_a_circle() -> None:
    packages = {module for module, path in modules().items() if path.name == "__init__.py"} | {"top"}
    assert circles(edges(), packages) == []


def test_stages_import_the_pipeline_and_not_one_another() -> None:
    for one, other in edges():
        if one.startswith("pipeline."):
            assert other.startswith("pipeline."), f"{one} imports {other}"
        if one.startswith("stages."):
            assert not other.startswith("top."), f"{one} imports {other}"
            assert not other.startswith("stages.") or one.split(".")[1] == other.split(".")[1], (
                f"{one} imports {other}"
            )


def test_only_the_command_line_imports_the_public_api() -> None:
    """`import advpipe` is for users; the packages below do not import it."""
    public = {"api", *(f"top.{name}" for name in PUBLIC)}

    def is_public(module: str) -> bool:
        return module in public or ".".join(module.split(".")[:2]) in public

    on_them = {one for one, other in edges() if is_public(other) and not is_public(one)}
    assert on_them
    assert all(one.startswith("top.cli.") for one in on_them)


def test_pipeline_packages_import_lower_layers_only() -> None:
    height = {name: level for level, names in enumerate(LAYERS) for name in names}
    for one, other in edges():
        if one.startswith("pipeline.") and other.startswith("pipeline."):
            assert height[one.split(".")[1]] >= height[other.split(".")[1]], f"{one} imports {other}"


SUMO = "stages.simulate.traffic.sumo."


def test_only_the_sumo_folder_imports_sumo() -> None:
    speaking = set()
    for module, path in modules().items():
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            names = [alias.name for alias in node.names] if isinstance(node, ast.Import) else []
            names += [node.module or ""] if isinstance(node, ast.ImportFrom) else []
            if {name.partition(".")[0] for name in names} & {"libsumo", "traci"}:
                speaking.add(module)
    assert speaking == {f"{SUMO}connection", f"{SUMO}server"}


def test_only_the_registry_imports_the_sumo_folder() -> None:
    others = {one for one, other in edges() if other.startswith(SUMO) and not one.startswith(SUMO)}
    assert others == {"stages.simulate.traffic.registry"}


@pytest.mark.parametrize("module", ["pipeline.cli", "pipeline.campaigns.sweep"])
def test_the_top_layer_is_detected(module: str) -> None:
    assert module.replace("pipeline", "top") in modules()
