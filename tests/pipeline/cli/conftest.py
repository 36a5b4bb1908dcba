"""A hostile data set, with escape sequences in names and in the provenance, and commands that are killed."""

from __future__ import annotations

import shutil
import sys
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import pytest
from first_words import without_progress

from advpipe.pipeline.bag.reader import BagReader
from advpipe.pipeline.bag.writer import BagWriter
from advpipe.pipeline.cli import app

sys.path.insert(0, str(Path(__file__).parent))

from forked import Forks
from hostile_set import ESCAPES, FOLDER, SHORT, TOPIC, Done, Run


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with the hostile data set: a drive of three frames, recorded with other names."""
    folder = tmp_path_factory.mktemp("made")
    with pytest.raises(SystemExit) as ended:
        app(["simulate", "smoke", "--out", str(folder / "plain"), *SHORT, "--quiet"])
    assert ended.value.code == 0
    data_set = folder / FOLDER
    data_set.mkdir()
    shutil.copy(folder / "plain" / "scenario.yaml", data_set)
    reader = BagReader(folder / "plain" / "clean")
    provenance = {**reader.provenance, "scenario_name": f"town {ESCAPES} [/red] :smile: $\\frac$"}
    with BagWriter(data_set / "clean", provenance=provenance) as bag:
        for raw in reader.raw_messages():
            bag.copy(raw)
            if raw.topic.name == "/clock":
                bag.copy(replace(raw, topic=replace(raw.topic, name=TOPIC)))
    with pytest.raises(SystemExit):
        app(["share", str(folder / "plain"), "--out", str(folder / "plain.tar"), "--quiet"])
    return folder


@pytest.fixture
def run(
    capfd: pytest.CaptureFixture[str], made: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> Run:
    monkeypatch.chdir(made)

    def run(*arguments: str) -> Done:
        capfd.readouterr()
        with pytest.raises(SystemExit) as ended:
            app([argument.format(out=tmp_path, drive=FOLDER) for argument in arguments])
        out, errors = capfd.readouterr()
        harmless = set(errors).isdisjoint("\x1b\x07\u202e")  # the command's first word, too
        assert harmless, errors
        return Done(int(ended.value.code or 0), out, without_progress(errors))

    return run


@pytest.fixture(scope="session")
def forks() -> Iterator[Forks]:
    """Runs commands that load no library anew; only files of cli/ that ask for it pay for its start."""
    forks = Forks([str(Path(__file__).parent)])
    yield forks
    forks.close()
