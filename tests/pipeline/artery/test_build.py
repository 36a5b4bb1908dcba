"""The script that builds Artery fetches what is missing, also after an interruption. Nothing is built."""

from __future__ import annotations

import os
import shutil
import subprocess
from pathlib import Path

import pytest

from advpipe.pipeline.core.code import PACKAGE

SCRIPT = PACKAGE / "pipeline" / "artery" / "build.sh"
TOOLS = ("cmake", "make", "g++", "bison", "flex", "perl", "python3", "pkg-config")
PARTS = {"inet": "src", "vanetza": "vanetza", "veins": "docs"}
PINNED = "e0ddd8c0414b079f28e8efa932f52f66ae5a3c73"


def repository(folder: Path, *files: str) -> None:
    for file in files:
        (folder / file).parent.mkdir(parents=True, exist_ok=True)
        (folder / file).write_text("omnetpp-5.6.2\n")
    git(folder, "init", "--quiet", "--initial-branch", "omnetpp-5.6.2")
    git(folder, "add", ".")
    git(folder, "commit", "--quiet", "--message", "first")


def git(folder: Path, *arguments: str) -> str:
    options = {"user.name": "a", "user.email": "a", "protocol.file.allow": "always"}
    given = [part for name, value in options.items() for part in ("-c", f"{name}={value}")]
    command = ["git", "-C", str(folder), *given, *arguments]
    return subprocess.run(command, check=True, capture_output=True, encoding="utf-8").stdout.strip()


@pytest.fixture
def build(tmp_path: Path):
    """Runs the script on small repositories in the public ones' stead; that of Veins lacks what it wants."""
    if shutil.which("git") is None:
        pytest.skip("git is not installed")
    public, copy, tools = tmp_path / "public", tmp_path / "artery" / "build.sh", tmp_path / "tools"
    repository(public / "omnetpp", "Version")
    repository(public / "artery", "CMakeLists.txt")
    for name, inside in PARTS.items():
        repository(public / name, f"{inside}/code")
        git(public / "artery", "submodule", "add", "--quiet", f"file://{public / name}", f"extern/{name}")
    git(public / "artery", "commit", "--quiet", "--message", "parts")
    (copy.parent / "module").mkdir(parents=True)
    commit = git(public / "artery", "rev-parse", "HEAD")
    text = SCRIPT.read_text(encoding="utf-8")
    assert PINNED in text
    copy.write_text(text.replace(PINNED, commit), encoding="utf-8")
    tools.mkdir()
    for tool in TOOLS:
        (tools / tool).symlink_to("/bin/true")
    of_public = {"omnetpp": "https://github.com/omnetpp/omnetpp", "artery": "https://github.com/riebl/artery"}
    config = [(f"url.file://{public / name}.insteadOf", url) for name, url in of_public.items()]
    config.append(("protocol.file.allow", "always"))
    numbered = {
        f"GIT_CONFIG_{kind}_{number}": text
        for number, pair in enumerate(config)
        for kind, text in zip(("KEY", "VALUE"), pair, strict=True)
    }
    paths = f"{tools}:{os.environ['PATH']}"
    environment = {**os.environ, **numbered, "GIT_CONFIG_COUNT": str(len(config)), "PATH": paths}

    def run(*options: str) -> str:
        command = ["sh", str(copy), "--accept-omnetpp-license", *options]
        done = subprocess.run(command, capture_output=True, encoding="utf-8", env=environment, cwd=tmp_path)
        assert done.returncode == 1
        return done.stderr.splitlines()[-1]

    return run


def test_what_an_interrupted_run_left_is_fetched_again(build, tmp_path: Path) -> None:
    sources = tmp_path / "my sources"
    for half in ("omnetpp.part", "artery.part"):
        (sources / half).mkdir(parents=True)
        (sources / half / "half").write_text("")
    assert "artery/extern/veins is empty; get Artery's submodules" in build("--sources", str(sources))
    assert sorted(path.name for path in sources.iterdir()) == ["artery", "omnetpp"]
    inet = sources / "artery" / "extern" / "inet"
    assert (inet / "src" / "code").is_file()
    assert not (sources / "artery" / "half").exists()
    shutil.rmtree(inet / "src")  # cloned, and not checked out yet
    assert "extern/veins is empty" in build("--sources", str(sources))
    assert (inet / "src" / "code").is_file()


def test_an_option_without_a_value_is_named(build) -> None:
    assert build("--into") == "build.sh: --into needs a value"
