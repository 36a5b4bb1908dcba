"""`advpipe demo` as a new user types it: an empty folder, no network, one command."""

from __future__ import annotations

import os
import re
import stat
import subprocess
import sys
from pathlib import Path

import pytest
from first_words import without_progress

from advpipe.pipeline.bag.locate import adversarial_bags
from advpipe.pipeline.cli import app
from advpipe.pipeline.dataset.sample import shipped_report


@pytest.mark.skipif(sys.platform == "win32", reason="needs a shell script for a browser")
def test_a_report_opens_and_another_one_is_made(tmp_path: Path) -> None:
    browser, opened = tmp_path / "browser", tmp_path / "opened"
    browser.write_text(f'#!/bin/sh\necho "$1" >> "{opened}"\n')
    browser.chmod(browser.stat().st_mode | stat.S_IXUSR)
    empty = tmp_path / "empty"
    empty.mkdir()
    environment = {
        **os.environ,
        "BROWSER": f"{browser} %s",
        "DISPLAY": ":0",
        "http_proxy": "http://127.0.0.1:9",
    }
    done = subprocess.run(
        [sys.executable, "-m", "advpipe", "demo"], cwd=empty, env=environment, capture_output=True, text=True
    )
    assert done.returncode == 0, done.stderr
    assert opened.read_text().strip() == shipped_report().as_uri()
    _, second, *_ = done.stderr.splitlines()  # after its first word
    assert second == f"a report made earlier is in your browser: {shipped_report()}"
    assert [path.name for path in empty.iterdir()] == ["advpipe-demo"]
    clean = r"3 clouds, \d+ objects +mAP +of clean\nclean +0\.\d{3} +100 %\n"
    table = clean + r"300 points .* (\d+) %\n300 .* (\d+) %\n"
    found = re.match(table, done.stdout)
    assert found is not None, done.stdout
    attacked, random = map(int, found.groups())
    assert 2 * attacked < random
    assert max(map(len, done.stdout.splitlines())) <= 80
    assert "report: advpipe-demo/reports/small/report.html\n" in done.stdout
    assert (empty / "advpipe-demo/reports/small/report.html").is_file()
    assert len(adversarial_bags(empty / "advpipe-demo")) == 1
    commands = re.findall(r"advpipe (\w+) (.*)", done.stdout.partition("next:")[2])
    assert commands == [
        ("attack", "advpipe-demo --type detach"),
        ("evaluate", "advpipe-demo --overwrite"),
    ]


def test_what_is_there_stays(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "here").mkdir()
    with pytest.raises(SystemExit) as ended:
        app(["demo", "--no-browser", "--out", str(tmp_path / "here")])
    assert ended.value.code == 2
    line = without_progress(capsys.readouterr().err)
    assert line == f"advpipe: {tmp_path / 'here'} already exists; pass --overwrite to replace it\n"
    assert list((tmp_path / "here").iterdir()) == []
