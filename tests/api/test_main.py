"""`advpipe` and `python -m advpipe`: the same, light to import, from any folder."""

from __future__ import annotations

import subprocess
import sys
import sysconfig
from importlib.metadata import entry_points, version
from pathlib import Path

import advpipe


def output_of(*command: str, folder: Path | None = None) -> str:
    return subprocess.run(command, cwd=folder, capture_output=True, text=True, check=True).stdout


def test_the_module_runs_what_the_script_runs(tmp_path: Path) -> None:
    script = Path(sysconfig.get_path("scripts")) / "advpipe"
    for arguments in (["--version"], ["simulate", "--help"]):
        as_module = output_of(sys.executable, "-m", "advpipe", *arguments, folder=tmp_path)
        assert as_module == output_of(str(script), *arguments, folder=tmp_path)
    (script_entry,) = entry_points(group="console_scripts", name="advpipe")
    assert script_entry.value == "advpipe.__main__:main"


def test_importing_is_light_and_gives_the_version() -> None:
    code = (
        "import sys; before = set(sys.modules); import advpipe; "
        "print(sorted(set(sys.modules) - before)); print(advpipe.__version__)"
    )
    loaded, number = output_of(sys.executable, "-c", code).splitlines()
    assert loaded == "['advpipe']"
    assert number == version("advpipe") == advpipe.__version__


def test_only_light_modules_come_before_the_handlers_of_signals() -> None:
    code = (
        "import sys; import advpipe.__main__; from advpipe.pipeline.core import signals, streams;"
        "print([name for name in ('typer', 'rich', 'numpy', 'tempfile') if name in sys.modules])"
    )
    assert output_of(sys.executable, "-c", code) == "[]\n"
