"""A page opens in a browser with a screen, and nowhere else."""

from __future__ import annotations

import stat
import sys
import webbrowser
from pathlib import Path

import pytest

from advpipe.pipeline.process.browser import open_page

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="screens of other systems have no variable")


@pytest.fixture
def opened(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The file that a browser notes addresses in, on a machine that has this browser alone."""
    script, note = tmp_path / "browser", tmp_path / "opened"
    script.write_text(f'#!/bin/sh\necho "$1" >> "{note}"\n')
    script.chmod(script.stat().st_mode | stat.S_IXUSR)
    monkeypatch.setattr(webbrowser, "_tryorder", [])
    monkeypatch.setattr(webbrowser, "_browsers", {})
    webbrowser.register("mine", None, webbrowser.GenericBrowser([str(script), "%s"]))
    return note


def test_with_a_screen(opened: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("DISPLAY", ":0")
    assert open_page(tmp_path / "my report.html")
    assert opened.read_text() == f"{tmp_path.as_uri()}/my%20report.html\n"


def test_without_a_screen(opened: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("DISPLAY", raising=False)
    monkeypatch.delenv("WAYLAND_DISPLAY", raising=False)
    assert not open_page(tmp_path / "report.html")
    assert not opened.exists()


def test_without_a_browser(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("DISPLAY", ":0")
    monkeypatch.setattr(webbrowser, "_tryorder", [])
    monkeypatch.setattr(webbrowser, "_browsers", {})
    assert not open_page(tmp_path / "report.html")
