"""A missing library is one line that names its package; what the loader says is true here, not imagined.

The loader fails for real: a compiled module of a dependency is copied beside, with the name of a library that
it needs replaced by one that does not exist, or cut off.
"""

from __future__ import annotations

import importlib.util
import os
import re
import shutil
import subprocess
import sys
from functools import partial
from pathlib import Path

import pytest
from first_words import without_progress

from advpipe.pipeline.core.missing_library import (
    DEBIAN_PACKAGES,
    loader_line,
    missing_library_line,
    problem_of_this_installation,
)

ROOT = Path(__file__).parents[3]
by_night = partial(pytest.param, marks=pytest.mark.nightly)
linux = pytest.mark.skipif(sys.platform != "linux", reason="what Linux's loader says")


def advpipe(*arguments: str, shadow: Path) -> subprocess.CompletedProcess[str]:
    """The command, with the folder `shadow` before all installed packages."""
    code = f"import sys; sys.path.insert(0, {str(shadow)!r})\nfrom advpipe.pipeline.cli import app; app()"
    return subprocess.run(
        [sys.executable, "-c", code, *arguments], capture_output=True, text=True, cwd=shadow, timeout=300
    )


def line_of(done: subprocess.CompletedProcess[str]) -> str:
    assert done.returncode == 1, done
    assert "Traceback" not in done.stderr
    (line,) = without_progress(done.stderr).splitlines()
    return line


def compiled(module: str) -> Path:
    spec = importlib.util.find_spec(module)
    assert spec is not None
    assert spec.origin is not None
    return Path(spec.origin)


def broken_copy(module: str, shadow: Path, needed: bytes, missing: bytes) -> None:
    """A package `module` in `shadow` whose import loads a compiled module that needs `missing`."""
    assert len(needed) == len(missing)
    data = compiled("lz4.frame._frame").read_bytes()
    assert needed + b"\0" in data
    package = shadow.joinpath(*module.split("."))
    package.mkdir(parents=True)
    for parent in [package, *package.parents][: len(module.split("."))]:
        (parent / "__init__.py").write_text("")
    name = compiled("lz4.frame._frame").name
    (package / name).write_bytes(data.replace(needed + b"\0", missing + b"\0"))
    (package / "__init__.py").write_text("from . import _frame\n")


@pytest.fixture(scope="module")
def smoke_set(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("sets")
    done = advpipe("simulate", "smoke", shadow=folder)
    assert done.returncode == 0, done.stderr
    return folder / "datasets" / "smoke"


COMMANDS_AND_LIBRARIES = {
    "simulate": (("simulate", "smoke"), "open3d"),
    "simulate traffic": (("simulate", "smoke"), "libsumo"),
    "attack": (("attack", "{bag}"), "torch"),
    "evaluate": (("evaluate", "{bag}"), "torch"),
    "train": (("train", "{bag}", "--out", "trained"), "torch"),
    "inspect": (("inspect", "{bag}"), "zstandard"),
    "verify": (("verify", "{bag}"), "zstandard"),
    "plot": (("plot", "{bag}"), "matplotlib"),
    "schema": (("schema",), "pydantic"),
}
"""A command, and a library that it loads."""


@linux
@pytest.mark.parametrize(
    "case",
    [
        case if case in ("simulate", "inspect") else pytest.param(case, marks=pytest.mark.nightly)
        for case in COMMANDS_AND_LIBRARIES
    ],
)
def test_every_command_names_a_missing_system_library(case: str, smoke_set: Path, tmp_path: Path) -> None:
    arguments, module = COMMANDS_AND_LIBRARIES[case]
    broken_copy(module, tmp_path, b"libc.so.6", b"libQ.so.9")
    line = line_of(advpipe(*(argument.format(bag=smoke_set) for argument in arguments), shadow=tmp_path))
    assert line.startswith("advpipe: the system library libQ.so.9 is missing; on Debian or Ubuntu, `apt-file")


@linux
def test_the_package_of_a_known_library_is_named(tmp_path: Path) -> None:
    if b"libpthread.so.0\0" not in compiled("lz4.frame._frame").read_bytes():
        pytest.skip("this build of lz4 needs no library whose name is as long as libusb's")
    if is_here("libusb-1.0.so.0"):
        pytest.skip("the system has libusb")
    (tmp_path / "libusb_package").mkdir()  # hides the true one
    (tmp_path / "libusb_package" / "__init__.py").write_text("")
    broken_copy("open3d", tmp_path, b"libpthread.so.0", b"libusb-1.0.so.0")
    assert line_of(advpipe("simulate", "smoke", shadow=tmp_path)) == (
        "advpipe: the system library libusb-1.0.so.0 is missing; on Debian or Ubuntu: "
        "apt-get install libusb-1.0-0 (docs/install.md names the packages of other systems)"
    )


def is_here(soname: str) -> bool:
    """Whether the system has it: asked in a process of its own, as this one may have loaded another."""
    code = f"import ctypes; ctypes.CDLL({soname!r})"
    return subprocess.run([sys.executable, "-c", code], capture_output=True).returncode == 0


@linux
def test_a_damaged_library_is_named(smoke_set: Path, tmp_path: Path) -> None:
    broken_copy("torch", tmp_path, b"libc.so.6", b"libc.so.6")
    (library,) = (tmp_path / "torch").glob("_frame*")
    library.write_bytes(library.read_bytes()[:40])
    (tmp_path / "torch" / "__init__.py").write_text(f"import ctypes\nctypes.CDLL({str(library)!r})\n")
    line = line_of(advpipe("train", str(smoke_set), "--out", "trained", shadow=tmp_path))
    assert str(library) in line
    assert "file too short" in line


@pytest.mark.parametrize(
    ("arguments", "module", "package"),
    [
        (("simulate", "smoke"), "libsumo", "libsumo"),
        by_night(("simulate", "smoke"), "sumo", "eclipse-sumo"),
        by_night(("simulate", "smoke"), "open3d", "open3d-cpu"),
        by_night(("simulate", "smoke"), "pycrate_asn1dir", "pycrate"),
        (("schema",), "pydantic", "pydantic"),
        (("schema",), "yaml", "pyyaml"),
    ],
)
def test_a_missing_python_package_is_named(
    arguments: tuple[str, ...], module: str, package: str, tmp_path: Path
) -> None:
    done = advpipe(*arguments, shadow=absent(module, tmp_path))
    expected = rf"advpipe: the Python package {package} is missing \(no module {module}[.\w]*\); install it: "
    assert re.match(expected + "pip install advpipe$", line_of(done))


def test_signing_without_the_extra_names_the_extra(smoke_set: Path, tmp_path: Path) -> None:
    done = advpipe(
        "share",
        str(smoke_set),
        "--out",
        "shared",
        "--sign",
        "key.pem",
        shadow=absent("cryptography", tmp_path),
    )
    assert line_of(done) == (
        "advpipe: the Python package cryptography is missing (no module cryptography); "
        "install it: pip install 'advpipe[sign]'"
    )
    assert not (tmp_path / "shared").exists()


def absent(module: str, folder: Path) -> Path:
    """A folder that makes Python find no such module, as it says so itself."""
    (folder / f"{module}.py").write_text(
        f"raise ModuleNotFoundError(\"No module named '{module}'\", name='{module}')\n"
    )
    return folder


@linux
def test_a_worker_reports_a_missing_library_too(tmp_path: Path) -> None:
    broken_copy("zstandard", tmp_path, b"libc.so.6", b"libQ.so.9")
    code = (
        f"import sys; sys.path.insert(0, {str(tmp_path)!r})\n"
        "from advpipe.pipeline.core.jobs import map_jobs\n"
        "from tasks import work\n"
        "map_jobs(work, range(8), 'x', workers=2)\n"
    )
    (tmp_path / "tasks.py").write_text("def work():\n    import zstandard\n")
    script = tmp_path / "script.py"
    script.write_text(code)
    done = subprocess.run([sys.executable, str(script)], capture_output=True, text=True, timeout=300)
    assert done.stderr.splitlines()[-1].startswith(
        "advpipe.pipeline.core.errors.AdvpipeError: the system library libQ.so.9 is missing"
    )


@linux
def test_a_sumo_program_that_does_not_start_is_explained(tmp_path: Path) -> None:
    """libexpat is needed by netconvert; the loader is told of a cut-off one first."""
    (tmp_path / "libexpat.so.1").write_bytes(b"\x7fELF")
    code = (
        "from advpipe.stages.simulate.road_network.file import run_sumo\n"
        "run_sumo('netconvert', ['--version'], 'a map')"
    )
    environment = os.environ | {"LD_LIBRARY_PATH": str(tmp_path)}
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, env=environment)
    assert done.stderr.splitlines()[-1] == (
        f"advpipe.pipeline.core.errors.AdvpipeError: netconvert: the shared library {tmp_path}/libexpat.so.1 "
        "cannot be loaded (file too short); reinstall its package: apt-get install --reinstall libexpat1"
    )


def test_wrapped_and_old_messages_are_recognised() -> None:
    """What numpy, a program, glibc and macOS say, as they said it."""
    wrapped = ImportError(
        "IMPORTANT: PLEASE READ THIS\n\nOriginal error was: libgomp.so.1: cannot open "
        "shared object file: No such file or directory\n"
    )
    assert "apt-get install libgomp1" in (missing_library_line(wrapped) or "")
    cause = ImportError("libGL.so.1: cannot open shared object file: No such file or directory")
    outer = ImportError("could not import the renderer")
    outer.__cause__ = cause
    assert "apt-get install libgl1" in (missing_library_line(outer) or "")
    old = "/lib/x86_64-linux-gnu/libc.so.6: version `GLIBC_2.35' not found (required by /a/pybind.so)"
    assert "pybind.so needs GLIBC 2.35, which this operating system lacks" in (loader_line(old) or "")


@pytest.mark.parametrize(
    "error",
    [
        FileNotFoundError(2, "No such file or directory", "libX.so.1: cannot open shared object file"),
        OSError(28, "No space left on device"),
        ImportError("cannot import name 'a' from 'b'"),
        ModuleNotFoundError("No module named 'advpipe.x'", name="advpipe.x"),
        OSError("nothing of the loader's"),
    ],
)
def test_other_errors_are_not_reported_as_missing_libraries(error: ImportError | OSError) -> None:
    assert missing_library_line(error) is None


def test_this_installation_is_complete() -> None:
    assert problem_of_this_installation() is None


@linux
@pytest.mark.skipif(shutil.which("dpkg-query") is None, reason="asks Debian whose library it is")
def test_debian_agrees_with_the_table() -> None:
    checked = 0
    for soname, package in DEBIAN_PACKAGES.items():
        done = subprocess.run(["dpkg-query", "--search", f"*/{soname}"], capture_output=True, text=True)
        owners = {line.split(":")[0].removesuffix("t64") for line in done.stdout.splitlines()}
        if done.returncode == 0:
            checked += 1
            assert package in owners, (soname, owners)
    assert checked > 5


def test_the_documentation_lists_every_package_and_command() -> None:
    text = (ROOT / "docs" / "install.md").read_text(encoding="utf-8")
    for soname, package in DEBIAN_PACKAGES.items():
        assert f"| `{soname}` | `{package}` |" in text
    for error in DOCUMENTED:
        line = missing_library_line(error)
        assert line is not None
        assert f"advpipe: {line}\n" in text


DOCUMENTED = (
    ImportError("libGL.so.1: cannot open shared object file: No such file or directory"),
    ImportError("libusb-1.0.so.0: cannot open shared object file: No such file or directory"),
    ImportError("libfoo.so.1: cannot open shared object file: No such file or directory"),
    OSError("/usr/lib/x86_64-linux-gnu/libgomp.so.1: file too short"),
    ImportError("/lib/libc.so.6: version `GLIBC_2.35' not found (required by /a/pybind.so)"),
    ModuleNotFoundError("No module named 'torch'", name="torch"),
    ModuleNotFoundError("No module named 'cryptography'", name="cryptography"),
)
