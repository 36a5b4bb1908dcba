"""The wheel holds every sub-package and all data; the layers import downward only."""

from __future__ import annotations

import ast
import shutil
import subprocess
import sys
import zipfile
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]


@pytest.fixture(scope="module")
def wheel(tmp_path_factory: pytest.TempPathFactory) -> list[str]:
    """Names of the files in a wheel built from a copy of the tree, where no older build can help."""
    folder = tmp_path_factory.mktemp("wheel")
    source = folder / "source"
    source.mkdir()
    for name in ("pyproject.toml", "README.md", "LICENSE"):
        shutil.copy(ROOT / name, source)
    for name in ("api", "pipeline", "stages", "scenarios"):
        shutil.copytree(ROOT / name, source / name, ignore=shutil.ignore_patterns("__pycache__"))
    command = [
        sys.executable,
        "-m",
        "build",
        "--wheel",
        "--no-isolation",
        "--outdir",
        str(folder),
        str(source),
    ]
    subprocess.run(command, check=True, capture_output=True)
    (path,) = folder.glob("*.whl")
    return zipfile.ZipFile(path).namelist()


def test_every_module_is_in_the_wheel(wheel: list[str]) -> None:
    for top in ("pipeline", "stages"):
        for module in (ROOT / top).rglob("*.py"):
            assert f"advpipe/{module.relative_to(ROOT)}" in wheel


def test_data_is_in_the_wheel(wheel: list[str]) -> None:
    expected = [
        *(ROOT / "scenarios").glob("*.yaml"),
        *(ROOT / "scenarios" / "networks").glob("*.xml"),
        *(ROOT / "pipeline" / "bag" / "msgs").rglob("*.msg"),
        *(ROOT / "pipeline" / "detector" / "second" / "checkpoints").glob("*.safetensors"),
        *(ROOT / "pipeline" / "detector" / "second" / "checkpoints").glob("*.md"),
        *(ROOT / "stages" / "evaluate" / "report").glob("*.html"),
    ]
    assert len(expected) > 8
    for path in expected:
        assert f"advpipe/{path.relative_to(ROOT)}" in wheel


def test_the_top_level_package_is_in_the_wheel_and_typed(wheel: list[str]) -> None:
    for file in (ROOT / "api").iterdir():
        if file.is_file():
            assert f"advpipe/{file.name}" in wheel
    assert "advpipe/py.typed" in wheel


def test_type_checkers_see_the_whole_package() -> None:
    """`typings/advpipe` puts together by links what lies in several folders here."""
    seen = {path.name: path.resolve() for path in (ROOT / "typings" / "advpipe").iterdir()}
    assert seen == {
        **{file.name: file for file in (ROOT / "api").glob("*.py")},
        **{top: ROOT / top for top in ("pipeline", "stages")},
    }


def imported(path: Path) -> set[str]:
    tree = ast.parse(path.read_text(encoding="utf-8"))
    names = {alias.name for node in ast.walk(tree) if isinstance(node, ast.Import) for alias in node.names}
    return names | {
        node.module for node in ast.walk(tree) if isinstance(node, ast.ImportFrom) and node.module
    }


def test_the_pipeline_imports_no_stage() -> None:
    for path in (ROOT / "pipeline").rglob("*.py"):
        if path.parent.name != "cli":
            assert not [name for name in imported(path) if name.startswith("advpipe.stages")], path


def test_nothing_imports_the_command_line() -> None:
    """`pipeline/cli/` stands above the stages: it knows them, and nothing below knows it."""
    for folder in ("pipeline", "stages"):
        for path in (ROOT / folder).rglob("*.py"):
            if path.parent.name != "cli":
                assert not [name for name in imported(path) if name.startswith("advpipe.pipeline.cli")], path


def test_no_stage_imports_another() -> None:
    for path in (ROOT / "stages").rglob("*.py"):
        own = path.relative_to(ROOT / "stages").parts[0]
        for name in imported(path):
            if name.startswith("advpipe.stages."):
                assert name.split(".")[2] == own, path
