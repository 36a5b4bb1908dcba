"""The wheel holds every sub-package and all data; the layers import downward only."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
import zipfile
from dataclasses import dataclass
from email.parser import Parser
from pathlib import Path

import pytest
from packaging.requirements import Requirement

ROOT = Path(__file__).parents[1]


LEFT_BEHIND = (
    ".venv",
    ".git",
    "__pycache__",
    "*.egg-info",
    "build",
    "dist",
    "datasets",
    "tests",
    "benchmarks",
)


@dataclass(frozen=True)
class Built:
    """names: of the files in the wheel. metadata: its METADATA. log: what the build printed."""

    names: list[str]
    metadata: str
    log: str


@pytest.fixture(scope="module")
def built(tmp_path_factory: pytest.TempPathFactory) -> Built:
    """A wheel made from an sdist, which is made from a copy of the tree, where no older build can help."""
    folder = tmp_path_factory.mktemp("wheel")
    source = folder / "source"
    shutil.copytree(ROOT, source, ignore=shutil.ignore_patterns(*LEFT_BEHIND), symlinks=True)
    command = [sys.executable, "-m", "build", "--no-isolation", "--outdir", str(folder), str(source)]
    environment = {name: value for name, value in os.environ.items() if name != "PYTHONDONTWRITEBYTECODE"}
    done = subprocess.run(command, capture_output=True, text=True, env=environment)
    assert done.returncode == 0, done.stdout + done.stderr
    (path,) = folder.glob("*.whl")
    with zipfile.ZipFile(path) as archive:
        names = archive.namelist()
        (metadata,) = (name for name in names if name.endswith(".dist-info/METADATA"))
        return Built(names, archive.read(metadata).decode(), done.stdout + done.stderr)


@pytest.fixture(scope="module")
def wheel(built: Built) -> list[str]:
    return built.names


def test_the_build_has_no_warnings(built: Built) -> None:
    warnings = [
        line for line in built.log.splitlines() if re.search(r"(?<!/)(warn|deprecat)", line, re.IGNORECASE)
    ]
    assert warnings == []


def test_all_data_files_are_in_the_wheel(wheel: list[str]) -> None:
    """All data files in packages: messages, networks, templates, weights and their cards."""
    found = 0
    for top in ("pipeline", "stages", "sample", "scenarios"):
        for path in (ROOT / top).rglob("*"):
            if path.is_file() and path.suffix not in (".py", ".pyc"):
                found += 1
                assert f"advpipe/{path.relative_to(ROOT)}" in wheel
    assert found > 30


LINUX = {"platform_system": "Linux", "platform_machine": "x86_64"}
ARM = {"platform_system": "Linux", "platform_machine": "aarch64"}
MACOS = {"platform_system": "Darwin", "platform_machine": "arm64"}
WINDOWS = {"platform_system": "Windows", "platform_machine": "AMD64"}


@pytest.mark.parametrize(
    ("system", "python", "expected"),
    [
        # Each release has wheels on PyPI for the system and Python beside it (looked up in November 2026).
        (LINUX, "3.10", {"open3d-cpu": "0.19.0"}),
        (LINUX, "3.11", {"open3d-cpu": "0.19.0"}),
        (LINUX, "3.12", {"open3d-cpu": "0.19.0"}),
        (LINUX, "3.13", {"open3d-cpu": "0.20.0", "libusb-package": "1.0.30.0"}),
        (LINUX, "3.14", {"open3d-cpu": "0.20.0", "libusb-package": "1.0.30.0"}),
        (ARM, "3.11", {"open3d": "0.20.0", "libusb-package": "1.0.30.0"}),
        (ARM, "3.13", {"open3d": "0.20.0", "libusb-package": "1.0.30.0"}),
        (MACOS, "3.12", {"open3d": "0.19.0"}),
        (MACOS, "3.13", {"open3d": "0.20.0"}),
        (WINDOWS, "3.12", {"open3d": "0.19.0"}),
        (WINDOWS, "3.13", {"open3d": "0.20.0"}),
    ],
)
def test_pip_selects_the_open3d_that_loads(
    built: Built, system: dict[str, str], python: str, expected: dict[str, str]
) -> None:
    """0.20 needs libusb, and comes with it, wherever there are no wheels of 0.19."""
    environment = system | {"python_version": python, "extra": ""}
    wanted = {}
    for line in Parser().parsestr(built.metadata).get_all("Requires-Dist", []):
        requirement = Requirement(line)
        if requirement.marker is not None and not requirement.marker.evaluate(environment):
            continue
        if requirement.name in ("open3d", "open3d-cpu", "libusb-package"):
            releases = ("0.19.0", "0.20.0", "0.21.0", "1.0.30.0")
            wanted[requirement.name] = max(requirement.specifier.filter(releases))
    assert wanted == expected


def test_libsumo_and_pyarrow_are_built_against_the_same_arrow() -> None:
    """Otherwise libsumo prints a warning at every start."""
    done = subprocess.run([sys.executable, "-c", "import libsumo"], capture_output=True, text=True)
    assert (done.returncode, done.stdout, done.stderr) == (0, "", "")


def test_the_table_of_sizes_names_every_dependency(built: Built) -> None:
    text = (ROOT / "docs" / "install.md").read_text(encoding="utf-8")
    rows = text.partition("<!-- sizes -->")[2].partition("<!-- end of sizes -->")[0]
    sys.path.insert(0, str(ROOT / "benchmarks"))
    try:
        from installed_size import PURPOSES
    finally:
        sys.path.remove(str(ROOT / "benchmarks"))
    for line in Parser().parsestr(built.metadata).get_all("Requires-Dist", []):
        requirement = Requirement(line)
        if requirement.marker is None:
            assert f"`{requirement.name}`" in rows
        if requirement.marker is None or requirement.marker.evaluate({"extra": ""}):
            assert requirement.name in PURPOSES


@pytest.mark.skipif(sys.platform == "win32", reason="needs make")
@pytest.mark.parametrize("index", ["https://download.pytorch.org/whl/cpu", "https://example.org/whl", ""])
def test_make_installs_the_cpu_build_of_torch_by_default(index: str, tmp_path: Path) -> None:
    default = index == "https://download.pytorch.org/whl/cpu"
    command = ["make", "--dry-run", "--always-make", "install", f"VENV={tmp_path}/venv"]
    command += [] if default else [f"TORCH_INDEX={index}"]
    done = subprocess.run(command, capture_output=True, text=True, cwd=ROOT, check=True)
    requested = re.search(r"--no-deps --retries 0 --index-url (\S*) torch==2\.13\.0", done.stdout)
    assert requested is not None
    assert f'test -z "{index}" ||' in done.stdout


def test_every_module_is_in_the_wheel(wheel: list[str]) -> None:
    for top in ("api", "pipeline", "stages"):
        for module in (ROOT / top).rglob("*.py"):
            assert f"advpipe/{module.relative_to(ROOT)}".replace("/api/", "/") in wheel


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
        "commands": ROOT / "api" / "commands",
        **{top: ROOT / top for top in ("pipeline", "stages")},
    }
